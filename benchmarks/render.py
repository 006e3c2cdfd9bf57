"""Time for one 1280x720 picture beside simple peers, in one process: `python benchmarks/render.py`.

The peers draw the same frames by the same camera, and less of them: no shadows, no light, no hidden surfaces.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from functools import partial
from statistics import median

import numpy as np

import pointmass as pm
from pointmass.frame import Curves, Points, Segments
from pointmass.render import fit_camera, image
from pointmass.render.camera import View, look

SIZE = (1280, 720)
FRAMES = {"fountain": 170, "springs": 28}  # of the shipped scenes, when much is to be seen
ROUNDS = 15
REACH = 3  # half the side of a splat [pixels]
SAMPLES = 48  # splats along a line


def main() -> None:
    """Print the table."""
    rows = []
    for name, number in FRAMES.items():
        scene = pm.SCENES[name]().build()
        frames = list(scene.simulation().frames(number + 1, scene.fps))
        frame, camera = frames[-1], fit_camera(frames, scene.camera, SIZE)
        dots, lines = parts(frame)
        draws: dict[str, Callable[[], object]] = {
            "pointmass": partial(image, frame, camera=camera, size=SIZE),
            "NumPy splat": partial(splat, dots, lines, look(camera, SIZE)),
        }
        if (peer := matplotlib_drawer(dots, lines, camera)) is not None:
            draws["matplotlib"] = peer
        rows.append((name, len(dots), len(lines), times(draws)))
    show(rows)


def parts(frame: pm.Frame) -> tuple[np.ndarray, np.ndarray]:
    """Centres of all points, shape (n, 3), and both ends of all lines, shape (m, 2, 3)."""
    dots, lines = [np.zeros((0, 3))], [np.zeros((0, 2, 3))]
    for d in frame.drawables:
        corners = frame.positions if d.vertices is None else d.vertices
        if isinstance(d, Points):
            dots.append(corners if d.index is None else corners[d.index])
        elif isinstance(d, Segments):
            lines.append(corners[d.pairs])
        elif isinstance(d, Curves):
            joined = np.ones(max(0, len(d.index) - 1), bool)
            joined[d.offsets[1:-1] - 1] = False
            lines.append(np.stack([corners[d.index[:-1]], corners[d.index[1:]]], axis=1)[joined])
    return np.concatenate(dots), np.concatenate(lines)


def splat(dots: np.ndarray, lines: np.ndarray, view: View) -> np.ndarray:
    """Soft discs of one size, added up: what a page of NumPy can do."""
    share = np.linspace(0, 1, SAMPLES)[:, None, None]
    along = lines[:, 0] + share * (lines[:, 1] - lines[:, 0])
    seen = view.see(np.concatenate([dots, along.reshape(-1, 3)]))
    places = np.rint(view.project(seen[seen[:, 2] > view.near])).astype(np.int64)
    light = np.zeros((view.height, view.width))
    for dy in range(-REACH, REACH + 1):
        for dx in range(-REACH, REACH + 1):
            x, y = places[:, 0] + dx, places[:, 1] + dy
            inside = (x >= 0) & (x < view.width) & (y >= 0) & (y < view.height)
            np.add.at(light, (y[inside], x[inside]), np.exp(-0.5 * (dx * dx + dy * dy)))
    gray = (255 * (1 - np.exp(-light))).astype(np.uint8)
    return np.repeat(gray[:, :, None], 3, axis=2)


def matplotlib_drawer(dots: np.ndarray, lines: np.ndarray, camera: pm.Camera) -> Callable[[], object] | None:
    """Draws the same things with matplotlib's 3-D axes, from the artists to an array; None if it is not installed."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from mpl_toolkits.mplot3d.art3d import Line3DCollection
    except ImportError:
        return None

    def draw() -> np.ndarray:
        figure = Figure(figsize=(SIZE[0] / 100, SIZE[1] / 100), dpi=100, facecolor="black")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1), projection="3d")
        axes.set_axis_off()
        axes.view_init(camera.elevation, camera.azimuth - 90, vertical_axis="y")
        axes.add_collection3d(Line3DCollection(lines, linewidths=1))
        axes.scatter(*dots.T, s=9, c=dots[:, 1])
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())

    return draw


def times(draws: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median time of each [ms]; they take turns, so that a busy machine is as busy for all."""
    seconds: dict[str, list[float]] = {name: [] for name in draws}
    for turn in range(ROUNDS + 1):
        for name, draw in draws.items():
            start = time.perf_counter()
            draw()
            if turn:  # the first one compiles and fills caches
                seconds[name].append(time.perf_counter() - start)
    return {name: 1000 * median(all_of_it) for name, all_of_it in seconds.items()}


def show(rows: list[tuple[str, int, int, dict[str, float]]]) -> None:
    """A table in Markdown: milliseconds, and for the peers how many times ours that is."""
    names = list(rows[0][3])
    print(f"{SIZE[0]}x{SIZE[1]}, {os.cpu_count()} cores, Python {sys.version.split()[0]}, NumPy {np.__version__}\n")
    print(f"| scene | points | lines | {' | '.join(names)} |")
    print("|---|---|---|" + "---|" * len(names))
    for scene, dots, lines, took in rows:
        ours = took["pointmass"]
        cells = [f"{ours:.1f} ms"] + [f"{took[n]:.0f} ms ({took[n] / ours:.1f}x)" for n in names[1:]]
        print(f"| {scene} | {dots} | {lines} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
