"""`pointmass view`."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pointmass.cli.main import Terminated
from pointmass.cli.options import RunOptions, load_subject, run_options
from pointmass.engine.threads import use_threads
from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.viewer.player import Player


@click.command("view")
@click.argument("source", metavar="SCENE|CACHE")
@click.option("--port", type=int, default=0, help="Port of the page; by default any that is free.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address at which to listen.")
@click.option("--expose", is_flag=True, help="Allow a host that other machines can reach.")
@click.option(
    "--origin",
    "origins",
    multiple=True,
    metavar="URL",
    help="Address of a proxy that hands the page on, such as https://hub.example.org: its pages are let in.",
)
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@click.option("--record", "recording", metavar="FILE", help="Write what is done to the run, for pointmass replay.")
@click.option("--duel", metavar="SOLVER[@DT],...", help="Up to four solvers beside each other, such as euler,rk4@0.01.")
@run_options
def command(
    source: str,
    port: int,
    host: str,
    expose: bool,
    origins: tuple[str, ...],
    no_browser: bool,
    recording: str | None,
    duel: str | None,
    **values: Any,
) -> None:
    """Open the live page of a scene, or of a cache: turn its knobs, grab its particles. Ctrl-C ends it.

    The page is for this machine only, and its address has a token. From another one, use
    ssh -L PORT:127.0.0.1:PORT, with --port.
    """
    from pointmass.viewer.page import page_folder, server_type
    from pointmass.viewer.session import Session

    serve, page = server_type(), page_folder()
    options = RunOptions(**values)
    player = _player(source, options, duel)
    if recording is not None:
        _check_recording(player, Path(recording))
    session = Session(player)
    server = serve(session, page, host=host, port=port, expose=expose, proxied=bool(origins), origins=origins)
    session.start()
    server.start()
    click.echo(server.address)
    if not no_browser:
        webbrowser.open(server.address)
    try:
        _wait()
    except Terminated:
        raise
    except KeyboardInterrupt:  # how one leaves
        pass
    finally:
        server.stop()
        session.stop()
        if recording is not None:
            _save(player, source, options, Path(recording))


def _check_recording(player: Player, path: Path) -> None:
    from pointmass.viewer.live import Live

    if not isinstance(player, Live):
        raise InvalidInput("--record is about what is done to a scene, and neither a cache nor a duel can be replayed")
    if not path.absolute().parent.is_dir():
        raise InvalidInput(f"cannot write the recording {str(path)!r}: there is no such folder")


def _save(player: Player, source: str, options: RunOptions, path: Path) -> None:
    from pointmass.cli.replay import saved_from
    from pointmass.viewer.live import Live
    from pointmass.viewer.recording_file import save

    assert isinstance(player, Live)
    save(saved_from(source, options, player), path)
    click.echo(f"recorded in {str(path)!r}", err=True)


def _wait() -> None:
    """Until the user, or the system, ends the command."""
    threading.Event().wait()


def _player(source: str, options: RunOptions, duel: str | None) -> Player:
    if options.frames is not None:
        raise InvalidInput("--frames belongs to run and render: a live page has no end")
    if Path(source).is_dir():
        from pointmass.cache import Cache
        from pointmass.viewer.playback import Playback

        if duel is not None:
            raise InvalidInput(f"--duel needs a scene, and {source!r} is a cache: give the scene instead")
        if options.given():
            raise InvalidInput(f"{options.given()[0]} cannot change the cache {source!r}: view the scene instead")
        use_threads(options.threads)
        return Playback(Cache.open(source))
    subject = load_subject(source, options)
    if duel is not None:
        from pointmass.viewer.duel import Duel, entries

        return Duel(subject, entries(duel))
    from pointmass.viewer.live import Live

    return Live(subject)
