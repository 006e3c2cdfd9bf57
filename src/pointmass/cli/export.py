"""`pointmass export`."""

from __future__ import annotations

import click

from pointmass.cli.options import quiet
from pointmass.cli.progress import progress


@click.command("export")
@click.argument("cache")
@click.option("-o", "--output", required=True, help="The file; .npz holds NumPy arrays.")
@quiet
def command(cache: str, output: str, quiet: bool) -> None:
    """Write the frames of CACHE for other programs."""
    from pointmass.cache import Cache
    from pointmass.export import check_export, export

    check_export(output)
    frames = Cache.open(cache)
    with progress("exporting", len(frames), quiet) as tick:
        export(frames, output, tick)
