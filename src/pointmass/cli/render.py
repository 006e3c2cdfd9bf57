"""`pointmass render`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import click

from pointmass.cli.compiling import compiling_said
from pointmass.cli.main import stopped
from pointmass.cli.options import (
    RunOptions,
    as_json,
    default_output,
    load_scene,
    parse_size,
    quiet,
    run_options,
)
from pointmass.cli.progress import progress
from pointmass.cli.report import Report, counted
from pointmass.cli.run import simulated, simulated_at
from pointmass.engine.threads import use_threads
from pointmass.errors import Diverged, InvalidInput, number

if TYPE_CHECKING:
    from pointmass.cache import Cache
    from pointmass.frame import Camera, Frame

UNITS = {"azimuth": "degrees", "elevation": "degrees", "fov": "degrees", "orbit": "degrees/s", "dolly": "m/s"}
SAMPLES = 48  # frames that an automatic camera looks at


@click.command("render")
@click.argument("source", metavar="SCENE|CACHE")
@click.option(
    "-o", "--output", help="A film (.mp4, .webm, .mov, .gif) or picture (.png, x_%04d.png); <scene>.mp4 by default."
)
@click.option("--frame", type=int, help="For a .png: the number of the frame, counted from 0; the last by default.")
@click.option("--size", default="1280x720", show_default=True, help="Width and height [pixels].")
@click.option("--processes", type=int, default=1, show_default=True, help="Processes that draw a film.")
@click.option("--transparent", is_flag=True, help="No background: a .png, .webm or .mov with an alpha.")
@click.option("--shutter", type=float, help="Exposure time, for motion blur [s].")
@click.option("--caption", is_flag=True, help="Write time and energy into the picture.")
@click.option("--azimuth", type=float, help="Direction from which the camera looks [degrees].")
@click.option("--elevation", type=float, help="Likewise, above the horizon [degrees].")
@click.option("--fov", type=float, help="Vertical angle of view [degrees].")
@click.option("--orbit", type=float, help="Turn of the camera about what it looks at [degrees/s].")
@click.option("--dolly", type=float, help="Speed of the camera towards it [m/s].")
@click.option("--follow", type=int, help="Id of a particle that the camera goes with.")
@click.option("--first", type=int, help="Number of the film's first frame, counted from 0.")
@click.option("--last", type=int, help="Number of its last frame.")
@run_options
@as_json
@quiet
def command(
    source: str,
    output: str | None,
    frame: int | None,
    size: str,
    processes: int,
    transparent: bool,
    shutter: float | None,
    caption: bool,
    azimuth: float | None,
    elevation: float | None,
    fov: float | None,
    orbit: float | None,
    dolly: float | None,
    follow: int | None,
    first: int | None,
    last: int | None,
    as_json: bool,
    quiet: bool,
    **values: Any,
) -> None:
    """Make a film or a picture of a scene, or of a cache.

    What is killed or interrupted goes on with the same command, from the pictures that are done: a film's parts stay in
    a hidden folder beside it until it is complete.
    """
    options = RunOptions(**values)
    path = Path(output) if output is not None else default_output(source, ".mp4")
    report = Report(command="render", path=path)
    view = {"azimuth": azimuth, "elevation": elevation, "fov": fov, "orbit": orbit, "dolly": dolly}
    style = {"caption": caption, "transparent": transparent, "shutter": shutter}
    drawing = Drawing(path, parse_size(size), frame, (first, last), style, processes, view, follow, quiet)
    if Path(source).is_file() and path.exists() and path.samefile(source):
        raise InvalidInput(f"cannot write {str(path)!r}: it is the scene itself")
    try:
        if Path(source).is_dir():
            _from_cache(source, options, drawing, report)
        else:
            _from_scene(source, options, drawing, report)
    except KeyboardInterrupt as error:
        report.frames, report.interrupted = 0, True
        report.show(as_json, quiet)
        raise stopped(error, unfinished(path)) from None
    report.show(as_json, quiet)
    if report.diverged is not None:
        raise Diverged(f"{report.diverged}; {str(path)!r} holds the {counted(report.frames)} before it")


class Drawing:
    """What to draw, and where."""

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        frame: int | None,
        part: tuple[int | None, int | None],
        style: dict[str, Any],
        processes: int,
        view: dict[str, float | None],
        follow: int | None,
        quiet: bool,
    ) -> None:
        from pointmass.render import Style
        from pointmass.render.film import is_single

        self.path, self.size, self.frame, self.quiet = path, size, frame, quiet
        self.style, self.processes = Style(**style), processes
        self.part, self.follow = part, follow
        self.view = {name: number(name, v, unit=UNITS[name]) for name, v in view.items() if v is not None}
        self.single = is_single(path)

    def check(self, count: int, fps: float, camera: Camera | None) -> None:
        """Refuse what cannot be drawn of `count` frames, or written, before anything is simulated.

        Raises
        ------
        InvalidInput
            An option that is not allowed, or a file that cannot be written.
        """
        from pointmass.render import check_write

        check_write(self.path, fps=fps, size=self.size, style=self.style, processes=self.processes)
        self.camera_with(camera)
        if self.frame is not None and not self.single:
            raise InvalidInput(f"--frame belongs to a single picture such as x.png, not to {self.path.name!r}")
        for name, value in (("frame", self.frame), ("first", self.part[0]), ("last", self.part[1])):
            if value is not None and not 0 <= value < count:
                raise InvalidInput(f"--{name} {value} is not allowed: there are {counted(count)}, counted from 0")
        if self.single and self.part != (None, None):
            raise InvalidInput(
                f"--first and --last belong to a film, not to {self.path.name!r}: --frame is for a picture"
            )
        if not self._numbers(count):
            raise InvalidInput(f"--last {self.part[1]} is not allowed: it is before --first {self.part[0]}")

    def _numbers(self, count: int) -> range:
        """Numbers of the frames of a film."""
        first, last = self.part
        return range(first or 0, count if last is None else last + 1)

    def camera_with(self, camera: Camera | None) -> Camera:
        """A camera as the options say; a direction replaces a position."""
        from pointmass.frame import Camera

        turned = {"position": None} if {"azimuth", "elevation"} & set(self.view) else {}
        followed = {} if self.follow is None else {"follow": self.follow}
        changes: dict[str, Any] = {**turned, **self.view, **followed}
        return replace(camera or Camera(), **changes)

    def draw(self, cache: Cache) -> int:
        """Draw the frames of a cache; returns how many."""
        from pointmass.render import fit_camera, write

        camera = fit_camera(sample(cache), self.camera_with(cache.camera), self.size)
        numbers: Sequence[int] = self._numbers(len(cache))
        if self.single:
            numbers = [len(cache) - 1 if self.frame is None else self.frame]
        with compiling_said(self.quiet), progress("rendering", len(numbers), self.quiet) as tick:
            write(
                Selected(cache, numbers),
                self.path,
                fps=cache.fps,
                camera=camera,
                size=self.size,
                style=self.style,
                progress=tick,
                processes=self.processes,
            )
        return len(numbers)


class Selected(Sequence["Frame"]):
    """Some frames of a cache, each of which is read when it is asked for."""

    def __init__(self, cache: Cache, numbers: Sequence[int]) -> None:
        self._cache, self._numbers = cache, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> Selected: ...
    def __getitem__(self, k: int | slice) -> Frame | Selected:
        return Selected(self._cache, self._numbers[k]) if isinstance(k, slice) else self._cache[self._numbers[k]]


def unfinished(path: Path) -> str:
    """What an interrupt leaves of a file."""
    from pointmass.render.film import kept_at

    kept = " and ".join(repr(str(place)) for place in (simulated_at(path), kept_at(path)) if place.exists())
    said = f"{str(path)!r} was not written"
    return f"{said}; the same command goes on from what is done, which is kept in {kept}" if kept else said


def _from_cache(source: str, options: RunOptions, drawing: Drawing, report: Report) -> None:
    from pointmass.cache import Cache

    if options.given():
        raise InvalidInput(f"{options.given()[0]} cannot change the cache {source!r}: render the scene instead")
    use_threads(options.threads)
    cache = Cache.open(source)
    if not len(cache):
        raise InvalidInput(f"the cache {source!r} has no frames: run the scene again")
    drawing.check(len(cache), cache.fps, cache.camera)
    report.frames = drawing.draw(cache)


def _from_scene(source: str, options: RunOptions, drawing: Drawing, report: Report) -> None:
    """Draw a scene when all of it was simulated, so that the camera can see the whole run."""
    scene = load_scene(source, options)
    drawing.check(scene.frames, scene.fps, scene.camera)
    if drawing.frame is not None:
        scene = scene.changed(frames=drawing.frame + 1)
    elif drawing.part[1] is not None:
        scene = scene.changed(frames=drawing.part[1] + 1)
    with simulated(scene, drawing.path, report, drawing.quiet) as cache:
        if report.diverged is not None and drawing.frame is not None:
            report.frames = 0
            raise Diverged(f"{report.diverged}; {str(drawing.path)!r} was not written") from report.diverged
        report.frames = drawing.draw(cache)


def sample(cache: Cache) -> list[Frame]:
    """Frames spread evenly over the run, the first and the last among them."""
    count = min(SAMPLES, len(cache))
    return [cache[round(k * (len(cache) - 1) / max(1, count - 1))] for k in range(count)]
