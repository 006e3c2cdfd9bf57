"""`pointmass new`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import click

from pointmass.errors import InvalidInput


@click.command("new")
@click.argument("name", default="scene.toml")
def command(name: str) -> None:
    """Write a scene file to begin with, with a comment to every table."""
    path = Path(name)
    if path.suffix != ".toml":
        raise InvalidInput(f"{name!r} is not allowed: the name of a scene file ends in .toml")
    text = files("pointmass.cli").joinpath("starter.toml").read_text(encoding="utf-8")
    begun = False
    try:
        with path.open("x", encoding="utf-8") as file:
            begun = True
            file.write(text)
    except FileExistsError:
        raise InvalidInput(f"{name!r} is there already: give another name") from None
    except OSError as error:
        if begun:  # a disk that is full
            path.unlink(missing_ok=True)
        raise InvalidInput(f"cannot write {name!r}: {error.strerror}") from None
    click.echo(f"pointmass: wrote {name}; look at it with: pointmass render {name}", err=True)
