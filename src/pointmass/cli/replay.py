"""`pointmass replay`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pointmass.cli.compiling import laws_said, warnings_said
from pointmass.cli.options import RunOptions, load_subject, quiet, shipped
from pointmass.cli.progress import progress
from pointmass.engine.threads import use_threads
from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.viewer.live import Live
    from pointmass.viewer.recording_file import Saved
    from pointmass.viewer.subject import Subject

CHUNK = 60  # steps between two looks at the progress


@click.command("replay")
@click.argument("recording", metavar="FILE")
@click.option("--threads", type=int, envvar="POINTMASS_THREADS", help="Threads; the result is the same.")
@quiet
def command(recording: str, threads: int | None, quiet: bool) -> None:
    """Run what `pointmass view --record FILE` has recorded once more, without a page, and compare the bits."""
    from pointmass.viewer.live import replaying
    from pointmass.viewer.recording_file import load

    use_threads(threads)
    saved = load(Path(recording))
    with warnings_said(quiet), laws_said(quiet), progress("replaying", max(1, saved.steps), quiet) as tick:
        for live in replaying(_subject(saved), saved.recording, saved.steps, CHUNK):
            tick(live.steps)
    if live.digest() != saved.digest:
        raise InvalidInput(
            f"the bits are not those of {recording!r}, which pointmass {saved.version} has recorded: another version, "
            "another scene file or another kind of CPU"
        )
    if not quiet:
        click.echo(f"{live.name}: {live.steps} steps, t = {live.sim.t:.6g} s, the same bits as recorded")


def saved_from(source: str, options: RunOptions, live: Live) -> Saved:
    """What a run of `pointmass view` has recorded."""
    from pointmass.viewer.recording_file import Saved

    named = shipped(source) is not None
    given: dict[str, Any] = {name: value for name, value in vars(options).items() if value} if named else {}
    return Saved(
        scene=source if named else live.opened(),
        options={name: list(value) if isinstance(value, tuple) else value for name, value in given.items()},
        recording=live.recording,
        steps=live.steps,
        digest=live.digest(),
    )


def _subject(saved: Saved) -> Subject:
    from pointmass.scene import Scene
    from pointmass.viewer.subject import Subject

    if saved.scene.startswith("version"):
        return Subject.of_scene(Scene.from_toml(saved.scene))
    options = {**saved.options, "threads": None}
    try:
        return load_subject(saved.scene, RunOptions(**{**options, "settings": tuple(options.get("settings", ()))}))
    except TypeError:
        raise InvalidInput(f"options = {saved.options} of the recording are not those of pointmass view") from None
