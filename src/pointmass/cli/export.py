"""`pointmass export`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pointmass.cli.main import stopped
from pointmass.cli.options import RunOptions, as_json, load_scene, quiet, run_options
from pointmass.cli.progress import progress
from pointmass.cli.render import sample, unfinished
from pointmass.cli.report import Report, counted
from pointmass.cli.run import simulated
from pointmass.errors import Diverged, InvalidInput, unknown

if TYPE_CHECKING:
    from pointmass.cache import Cache
    from pointmass.frame import Frame

Tick = Callable[[int], None]


@click.command("export")
@click.argument("source", metavar="CACHE|SCENE")
@click.argument("output", metavar="OUT")
@click.option("--frame", type=int, help="The number of one frame, counted from 0.")
@run_options
@as_json
@quiet
def command(source: str, output: str, frame: int | None, as_json: bool, quiet: bool, **values: Any) -> None:
    """Write the frames of a cache, or of a scene, for other programs.

    The ending of OUT says how: .usd, .usdc or .usda for Blender, Houdini and Maya; .pvd (and a .vtp for each frame) or
    .vtkhdf for ParaView; .gsd for OVITO; .glb for web pages and game engines; .npz and .csv for arrays and tables;
    .vtp, .ply or .obj for the last frame, or for each one with a name such as x_%04d.ply; .mp4, .webm, .gif or
    x_%04d.png for a film, see pointmass render; .html for a page that plays the run anywhere.
    """
    options, path = RunOptions(**values), Path(output)
    report = Report(command="export", path=path)
    way = Way(path, frame)
    try:
        if Path(source).is_dir() or Path(source).suffix == ".zarr":
            _from_cache(source, options, way, report, quiet)
        else:
            scene = load_scene(source, options)
            way.check_frame(scene.frames)
            with simulated(scene, path, report, quiet) as cache:
                report.frames = way.write(cache, quiet)
    except KeyboardInterrupt as error:
        report.frames, report.interrupted = 0, True
        report.show(as_json, quiet)
        raise stopped(error, unfinished(path)) from None
    report.show(as_json, quiet)
    if report.diverged is not None:
        raise Diverged(f"{report.diverged}; {output!r} holds the {counted(report.frames)} before it")


def _from_cache(source: str, options: RunOptions, way: Way, report: Report, quiet: bool) -> None:
    from pointmass.cache import Cache

    if options.given():
        raise InvalidInput(f"{options.given()[0]} cannot change the cache {source!r}: export the scene instead")
    cache = Cache.open(source)
    way.check_frame(len(cache))
    report.frames = way.write(cache, quiet)


class Way:
    """The way out that a file's name asks for."""

    def __init__(self, path: Path, frame: int | None) -> None:
        from pointmass.export import EXPORTERS, check_export
        from pointmass.render import SUFFIXES, check_write

        self.path, self.frame, self.suffix = path, frame, path.suffix.lower()
        self.film = self.suffix in SUFFIXES
        if self.film:
            check_write(path)
        elif self.suffix in EXPORTERS:
            check_export(path)
        elif self.suffix != ".html":
            raise unknown("kind of export", path.suffix, [*EXPORTERS, *SUFFIXES, ".html"])

    def check_frame(self, count: int) -> None:
        """Refuse a frame that is not there.

        Raises
        ------
        InvalidInput
            There are `count` frames, and not this one.
        """
        if self.frame is not None and not 0 <= self.frame < count:
            raise InvalidInput(f"--frame {self.frame} is not allowed: there are the frames 0 to {count - 1}")

    def write(self, cache: Cache, quiet: bool) -> int:
        """Write the frames of a cache; returns how many were asked for."""
        self.check_frame(len(cache))  # a run that diverged may have ended before it
        frames: Sequence[Frame] = cache if self.frame is None else [cache[self.frame]]
        with progress("exporting", len(frames), quiet) as tick:
            if self.film:
                self._film(frames, cache, tick)
            elif self.suffix == ".html":
                self._page(frames, cache, tick)
            else:
                self._file(frames, cache, tick)
        return len(frames)

    def _file(self, frames: Sequence[Frame], cache: Cache, tick: Tick) -> None:
        from pointmass.export import About, export

        about = About(fps=cache.fps, name=cache.attributes["name"])
        if self.suffix.startswith(".usd") and len(cache):
            from pointmass.render import fit_camera
            from pointmass.render.camera import moved, moves

            camera = fit_camera(sample(cache), cache.camera)
            about = replace(about, camera=camera, moved=partial(moved, camera) if moves(camera) else None)
        export(frames, self.path, tick, about)

    def _page(self, frames: Sequence[Frame], cache: Cache, tick: Tick) -> None:
        from pointmass.viewer.film import to_html

        name = cache.attributes.get("name")
        to_html(frames, self.path, fps=cache.fps, name=name, camera=cache.camera, progress=tick)

    def _film(self, frames: Sequence[Frame], cache: Cache, tick: Tick) -> None:
        from pointmass.render import fit_camera, write

        camera = fit_camera(sample(cache), cache.camera) if len(cache) else None
        write(frames, self.path, fps=cache.fps, camera=camera, progress=tick)
