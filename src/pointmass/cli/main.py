"""The group of commands, and how every one of them ends.

Commands load what they need when they run: `pointmass --help` is there at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

import click

from pointmass import __version__
from pointmass.errors import Diverged, PointmassError

DONE, BAD_INPUT, DIVERGED, INTERRUPTED = 0, 2, 3, 130
COMMANDS = {  # module by name of the command, in the order of the help
    "list": "listing",
    "run": "run",
    "render": "render",
    "check": "check",
    "export": "export",
    "new": "new",
}


class Interrupted(KeyboardInterrupt):
    """A Ctrl-C with something to say about what it left behind."""


class Commands(click.Group):
    """Loads a command when it is called, and ends each with a sentence and an exit code instead of a traceback."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"pointmass.cli.{COMMANDS[cmd_name]}").command
        return command

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


def ending(error: BaseException) -> tuple[int, str]:
    """Exit code and sentence for what stopped a command."""
    if isinstance(error, Diverged):
        return DIVERGED, str(error)
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, str(error) or "interrupted"
    if isinstance(error, MemoryError):
        return BAD_INPUT, f"there is not enough memory: {error or 'take fewer particles or a smaller picture'}"
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

    Exit codes: 0 done, 2 bad input, 3 the simulation diverged, 130 interrupted.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
