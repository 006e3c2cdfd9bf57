"""`pointmass run`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pointmass.cli.compiling import laws_said, warnings_said
from pointmass.cli.main import stopped
from pointmass.cli.options import RunOptions, as_json, default_output, load_scene, quiet, run_options
from pointmass.cli.progress import progress
from pointmass.cli.report import Report, counted
from pointmass.errors import Diverged, InvalidInput

if TYPE_CHECKING:
    from pointmass.cache import Cache
    from pointmass.scene import Scene


@click.command("run")
@click.argument("scene")
@click.option("-o", "--output", help="The cache, a folder; <scene>.zarr by default.")
@run_options
@as_json
@quiet
def command(scene: str, output: str | None, as_json: bool, quiet: bool, **values: Any) -> None:
    """Simulate SCENE into a cache.

    A cache that is there already is replaced. Frames are written one by one: whatever stops the run, the cache holds
    those before.
    """
    options = RunOptions(**values)
    path = Path(output) if output is not None else default_output(scene, ".zarr")
    report = Report(command="run", path=path)
    try:
        simulate(load_scene(scene, options), path, report, quiet, overwrite=True)
    except Diverged as error:
        report.diverged = error
        report.show(as_json, quiet)
        raise Diverged(_kept(error, report)) from error
    except InvalidInput as error:  # found in the run: a parameter that is a function of t
        raise (InvalidInput(_kept(error, report)) if report.frames else error) from None
    except KeyboardInterrupt as error:
        from pointmass.cache import Cache

        report.interrupted = True
        report.frames = len(Cache.open(path)) if report.frames else 0  # the last one may not have been counted
        report.show(as_json, quiet)
        kept = f"{counted(report.frames)} kept in {str(path)!r}" if report.frames else "nothing was written"
        raise stopped(error, kept) from None
    report.show(as_json, quiet)


def simulate(scene: Scene, path: Path, report: Report, quiet: bool, *, overwrite: bool) -> None:
    """Simulate a scene into a cache, and count its frames in the report."""
    from pointmass.cache import check_target, record

    check_target(path, overwrite)
    with warnings_said(quiet), laws_said(quiet), progress("simulating", scene.frames, quiet) as tick:

        def count(frames: int) -> None:
            report.frames = frames
            tick(frames)

        record(scene.simulation(), path, scene.frames, scene.fps, scene=scene, overwrite=overwrite, progress=count)


@contextmanager
def simulated(scene: Scene, output: Path, report: Report, quiet: bool) -> Iterator[Cache]:
    """A scene in a cache beside the output that is made of it; the cache goes in the end.

    Of a run that diverges it holds the frames before, and the report says so.

    Raises
    ------
    Diverged
        There are none.
    """
    from pointmass.cache import Cache

    with tempfile.TemporaryDirectory(prefix=".pointmass-", dir=output.parent, ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "run.zarr"
        try:
            simulate(scene, path, report, quiet, overwrite=False)
        except Diverged as error:
            report.diverged = error
            if not report.frames:
                raise Diverged(f"{error}; {str(output)!r} was not written") from error
        yield Cache.open(path)


def _kept(error: Exception, report: Report) -> str:
    return f"{error}; {counted(report.frames)} kept in {str(report.path)!r}"
