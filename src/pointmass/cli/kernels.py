"""`pointmass kernels`."""

from __future__ import annotations

import json

import click

from pointmass.cli.options import as_json


@click.command("kernels")
@click.option("--clear", is_flag=True, help="Delete them all; they are compiled again when they are needed.")
@as_json
def command(clear: bool, as_json: bool) -> None:
    """Show where compiled laws are kept on this machine, or clear them away.

    What a scene is made of is compiled once, into a folder that every later run reads. Each kernel is a file of Python
    that anybody may read.
    """
    from pointmass.engine import store

    if clear:
        count, size = store.clear()
    else:
        files = list(store.kept())
        count, size = sum(f.suffix == ".py" for f in files), sum(f.stat().st_size for f in files)
    if as_json:
        click.echo(json.dumps({"folder": str(store.folder()), "kernels": count, "bytes": size, "cleared": clear}))
        return
    what = f"{count} kernel{'s' * (count != 1)}, {size / 1e6:.1f} MB"
    click.echo(f"deleted {what} in {store.folder()}" if clear else f"{what} in {store.folder()}")
