"""`pointmass export`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from pointmass.cli.options import quiet
from pointmass.cli.progress import progress
from pointmass.errors import InvalidInput
from pointmass.frame import Frame


@click.command("export")
@click.argument("cache")
@click.option(
    "-o",
    "--output",
    required=True,
    help="A file: .npz for all frames as NumPy arrays; .obj, .ply or .glb for the surfaces of the last frame, or of "
    "each one for a name such as x_%04d.obj; .html for a page that plays them anywhere.",
)
@click.option("--frame", type=int, help="The number of one frame, counted from 0.")
@quiet
def command(cache: str, output: str, frame: int | None, quiet: bool) -> None:
    """Write the frames of CACHE for other programs."""
    from pointmass.cache import Cache
    from pointmass.export import check_export, export

    page = Path(output).suffix.lower() == ".html"
    if not page:
        check_export(output)
    opened = Cache.open(cache)
    frames: Sequence[Frame] = opened
    if frame is not None:
        if not 0 <= frame < len(frames):
            raise InvalidInput(f"--frame {frame} is not allowed: the cache has the frames 0 to {len(frames) - 1}")
        frames = [frames[frame]]
    with progress("exporting", len(frames), quiet) as tick:
        if page:
            from pointmass.viewer.film import to_html

            to_html(
                frames, output, fps=opened.fps, name=opened.attributes.get("name"), camera=opened.camera, progress=tick
            )
        else:
            export(frames, output, tick)
