"""`pointmass run`."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from pointmass.beside import take_away
from pointmass.cli.compiling import laws_said, warnings_said
from pointmass.cli.main import stopped
from pointmass.cli.options import RunOptions, as_json, default_output, load_scene, quiet, run_options
from pointmass.cli.progress import progress
from pointmass.cli.report import Report, counted
from pointmass.errors import Diverged, InvalidInput, PointmassError
from pointmass.lock import hidden, locked

if TYPE_CHECKING:
    from pointmass.cache import Cache, Plan
    from pointmass.scene import Scene

Mode = Literal["", "resume", "anew"]


@click.command("run")
@click.argument("scene")
@click.option("-o", "--output", help="The cache, a folder; <scene>.zarr by default.")
@click.option("--resume", is_flag=True, help="Only go on with a run of the same scene; refuse what has changed.")
@click.option("--anew", is_flag=True, help="Make all frames again, whatever is there.")
@run_options
@as_json
@quiet
def command(
    scene: str, output: str | None, resume: bool, anew: bool, as_json: bool, quiet: bool, **values: Any
) -> None:
    """Simulate SCENE into a cache.

    Frames are written one by one: whatever stops the run, the cache holds those before, and the same command goes on
    from there with the same bits. Of a cache that is there already, all frames stay that follow from the same scene;
    where the scene has changed, only those that the change can affect are made again: see pointmass why.
    """
    options = RunOptions(**values)
    path = Path(output) if output is not None else default_output(scene, ".zarr")
    report = Report(command="run", path=path)
    if resume and anew:
        raise InvalidInput("--resume and --anew cannot both be wanted: give one of them")
    try:
        loaded = load_scene(scene, options)
        about = {"source": {"scene": scene, "options": options.as_json()}}
        simulate(loaded, path, report, quiet, mode="resume" if resume else "anew" if anew else "", about=about)
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
        kept = "nothing was written"
        if report.frames:
            kept = f"{counted(report.frames)} kept in {str(path)!r}; the same command goes on from there"
        raise stopped(error, kept) from None
    report.show(as_json, quiet)


def simulate(
    scene: Scene,
    path: Path,
    report: Report,
    quiet: bool,
    *,
    mode: Mode = "",
    about: dict[str, Any] | None = None,
) -> None:
    """Simulate a scene into a cache, and count its frames in the report.

    Parameters
    ----------
    mode : "resume" refuses a cache of another scene, "anew" replaces one, "" keeps of it what still holds.
    about : what else the cache should know.

    Raises
    ------
    InvalidInput
        There is nothing to resume.
    """
    from pointmass.cache import check_target, record

    check_target(path, overwrite=True)
    untold: Plan | None = None  # of another scene it is not known before that it can run at all
    with warnings_said(quiet), laws_said(quiet), progress("simulating", scene.frames, quiet) as tick:

        def planned(found: Plan) -> None:
            nonlocal untold
            if mode == "resume" and not found.same:
                raise InvalidInput(_no_resume(found, path))
            report.frames = found.kept
            if found.same and not quiet:
                _say(found, path, scene.frames)
            elif not quiet:
                untold = found

        def count(frames: int) -> None:
            nonlocal untold
            if untold is not None:
                _say(untold, path, scene.frames)
                untold = None
            report.frames = frames
            tick(frames)

        record(
            scene.simulation(),
            path,
            scene.frames,
            scene.fps,
            scene=scene,
            overwrite=True,
            resume=mode != "anew",
            planned=planned,
            progress=count,
            about=about,
        )


def _say(found: Plan, path: Path, frames: int) -> None:
    """What stays of a cache that is there, and why."""
    if found.same and found.kept >= frames:
        click.echo(f"pointmass: nothing to do: the scene has not changed since {str(path)!r} was made", err=True)
    elif found.same and found.kept:
        click.echo(f"pointmass: {counted(found.kept)} of {str(path)!r} stay, the run goes on from there", err=True)
    elif found.changes:
        more = f" and {len(found.changes) - 1} more" if len(found.changes) > 1 else ""
        stay = f"{counted(found.kept)} before it stay" if found.kept else "all frames are made again"
        click.echo(f"pointmass: the scene has changed ({found.changes[0]}{more}): {stay}", err=True)


def _no_resume(found: Plan, path: Path) -> str:
    if found.cache is None:
        return f"--resume finds no cache {str(path)!r}: leave it out"
    if not found.known:
        return f"--resume cannot know what the frames of {str(path)!r} follow from: use --anew"
    return f"--resume finds another scene in {str(path)!r} ({found.changes[0]}): leave it out, or see pointmass why"


@contextmanager
def simulated(scene: Scene, output: Path, report: Report, quiet: bool) -> Iterator[Cache]:
    """A scene in a hidden cache beside the output that is made of it; the cache goes in the end.

    What is killed or interrupted leaves it there, and the same command goes on from it. Of a run that diverges it holds
    the frames before, and the report says so.

    Raises
    ------
    Diverged
        There are none.
    """
    from pointmass.cache import Cache

    path, gone = simulated_at(output), hidden(output, ".gone")
    with locked(output, ending=".run.lock"):
        shutil.rmtree(gone, ignore_errors=True)
        try:
            try:
                simulate(scene, path, report, quiet)
            except Diverged as error:
                report.diverged = error
                if not report.frames:
                    raise Diverged(f"{error}; {str(output)!r} was not written") from error
            yield Cache.open(path)
        except PointmassError:
            take_away(path, gone)
            raise
        take_away(path, gone)


def simulated_at(output: Path) -> Path:
    """Where the cache is of which an output is made."""
    return hidden(output, ".zarr")


def _kept(error: Exception, report: Report) -> str:
    return f"{error}; {counted(report.frames)} kept in {str(report.path)!r}"
