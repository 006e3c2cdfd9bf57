"""What it costs to keep a frame of fireworks with a million particles: `python -m benchmarks.cache`.

Frames of one run are simulated and written in turns, in one process, with the default compression, and read again.
"""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

import pointmass as pm
from pointmass.cache import Cache

LAUNCHES, STARS = 12.0, 12_000  # with these there are a million particles after some seconds
FPS = 60.0


@click.command(help=__doc__)
@click.option("--particles", default=1_000_000, show_default=True, help="From how many on it is measured.")
@click.option("--frames", default=12, show_default=True, help="That are measured.")
def main(particles: int, frames: int) -> None:
    """Print the table."""
    scale = particles / 1_000_000
    scene = pm.SCENES["fireworks"].with_settings({"launches": LAUNCHES, "stars": max(1, round(scale * STARS))}).build()
    sim = scene.simulation()
    with TemporaryDirectory() as folder:
        cache = Cache.create(Path(folder) / "a.zarr", scene, fps=FPS)
        simulated, written, read, sizes, counts = measure(sim, cache, particles, frames)
    count = statistics.mean(counts)
    print(f"{os.cpu_count()} cores, NumPy {np.__version__}, {count:.3g} particles, {frames} frames\n")
    print("| | for a frame | for a particle |")
    print("|---|---|---|")
    for what, seconds in (("simulate, with its looks", simulated), ("write", written), ("read", read)):
        middle = statistics.median(seconds)
        print(f"| {what} | {1000 * middle:.0f} ms | {1e9 * middle / count:.0f} ns |")
    size = statistics.mean(sizes)
    print(f"| on the disk | {size / 1e6:.1f} MB | {size / count:.1f} bytes |")
    print(f"\nWriting takes {100 * statistics.median(written) / statistics.median(simulated):.0f}% of simulating.")


def measure(
    sim: pm.Simulation, cache: Cache, particles: int, frames: int
) -> tuple[list[float], list[float], list[float], list[int], list[int]]:
    """Seconds to simulate, write and read frames, their bytes, and their particles."""
    simulated, written, read, sizes, counts = [], [], [], [], []
    stream = sim.frames(100_000, FPS)
    start = time.perf_counter()
    for frame in stream:
        made = time.perf_counter()
        if len(frame.ids) >= particles:
            before = on_disk(cache.path)
            begun = time.perf_counter()
            cache.append(frame)
            end = time.perf_counter()
            again = cache.frame(len(cache) - 1)
            done = time.perf_counter()
            assert (again.positions == frame.positions).all()
            simulated.append(made - start)
            written.append(end - begun)
            read.append(done - end)
            sizes.append(on_disk(cache.path) - before)
            counts.append(len(frame.ids))
        if len(counts) == frames + 1:
            break
        start = time.perf_counter()
    return simulated[1:], written[1:], read[1:], sizes[1:], counts[1:]  # the first one does what is done once


def on_disk(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


if __name__ == "__main__":
    main()
