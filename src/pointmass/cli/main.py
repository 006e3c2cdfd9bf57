"""The group of commands, and how every one of them ends.

Commands load what they need when they run: `pointmass --help` is there at once.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

import click

from pointmass import __version__
from pointmass.cli.memory import add_allow_large, limited, memory_sentence
from pointmass.errors import Diverged, PointmassError

DONE, BAD_INPUT, DIVERGED = 0, 2, 3
COMMANDS = {  # module by name of the command, in the order of the help
    "list": "listing",
    "run": "run",
    "why": "why",
    "render": "render",
    "view": "view",
    "replay": "replay",
    "check": "check",
    "export": "export",
    "new": "new",
    "kernels": "kernels",
}


class Interrupted(KeyboardInterrupt):
    """A Ctrl-C."""

    code, word = 130, "interrupted"


class Terminated(Interrupted):
    """A SIGTERM: a batch system or `kill` ends the command."""

    code, word = 143, "terminated"


def stopped(by: KeyboardInterrupt, left_behind: str) -> Interrupted:
    """The same interrupt with something to say about what it left behind."""
    kind = Terminated if isinstance(by, Terminated) else Interrupted
    return kind(f"{kind.word}: {left_behind}")


class Commands(click.Group):
    """Loads a command when it is called, and ends each with a sentence and an exit code instead of a traceback."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"pointmass.cli.{COMMANDS[cmd_name]}").command
        return add_allow_large(command)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # the reader, such as head, has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(DONE)
        except (PointmassError, KeyboardInterrupt, MemoryError, OSError) as error:
            raise Ended(*ending(error)) from error

    def main(self, args: Sequence[str] | None = None, *_: Any, **options: Any) -> NoReturn:
        try:
            with _sigterm_raises(), limited():
                code = super().main(args, "pointmass", standalone_mode=False)
        except click.ClickException as error:
            code = error.code if isinstance(error, Ended) else BAD_INPUT
            click.echo(f"pointmass: {' '.join(error.format_message().split())}", err=True)
        sys.exit(code if isinstance(code, int) else DONE)


class Ended(click.ClickException):
    """The end of a command that did not do all that was asked of it."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    """SIGTERM raises `Terminated`, unless somebody else has a use for it."""
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def handle(number: int, frame: object) -> NoReturn:
        raise Terminated

    signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def ending(error: BaseException) -> tuple[int, str]:
    """Exit code and sentence for what stopped a command."""
    if isinstance(error, Diverged):
        return DIVERGED, str(error)
    if isinstance(error, KeyboardInterrupt):
        error = error if isinstance(error, Interrupted) else Interrupted()
        return error.code, str(error) or error.word
    if isinstance(error, MemoryError):
        return BAD_INPUT, memory_sentence(error)
    return BAD_INPUT, str(error)


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="pointmass")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Particle systems: from a scene file to a film.

    SCENE is the name of a scene that ships with pointmass, see `pointmass list`, or a TOML file, see `pointmass new`.

    Exit codes: 0 done, 2 bad input, 3 the simulation diverged, 130 interrupted, 143 terminated.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
