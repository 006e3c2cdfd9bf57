"""`pointmass why`."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from pointmass.cli.options import RunOptions, as_json, load_scene, run_options
from pointmass.cli.report import counted
from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.cache import Cache, Plan


@click.command("why")
@click.argument("cache")
@click.argument("scene", required=False)
@run_options
@as_json
def command(cache: str, scene: str | None, as_json: bool, **values: Any) -> None:
    """Say what has changed since CACHE was made.

    Compared is what the frames follow from, scene, files that it names, and version, with SCENE and the options as they
    are now: by default those of the command that made it.
    """
    from pointmass.cache import Cache, plan

    opened = Cache.open(cache)
    options = RunOptions(**values)
    if scene is None:
        scene, told = _source(opened)
        options = replace(told, allow_outside=options.allow_outside)  # a cache of others does not decide that
    now = load_scene(scene, options)
    found = plan(cache, now.simulation(), now, now.fps)
    if as_json:
        click.echo(json.dumps(_plain(found, opened, now.frames)))
        return
    for change in found.changes:
        click.echo(change)
    click.echo(_verdict(found, opened, now.frames))


def _source(cache: Cache) -> tuple[str, RunOptions]:
    source = cache.attributes.get("source")
    if not isinstance(source, dict):
        raise InvalidInput(f"the cache {str(cache.path)!r} does not say which command made it: name the scene, too")
    options = dict(source["options"])
    return source["scene"], RunOptions(**options | {"settings": tuple(options.get("settings", ()))})


def _verdict(found: Plan, cache: Cache, frames: int) -> str:
    """What a run would do, in a sentence."""
    there = counted(len(cache))
    if not found.known:
        return f"nobody can know what the {there} follow from: the scene holds laws written in Python"
    if found.same and len(cache) >= frames:
        return f"nothing has changed: {there}"
    if found.same:
        return f"nothing has changed: {there} of {frames}; a run goes on from there"
    return f"a run keeps {counted(found.kept)} of {len(cache)}, and makes the rest again"


def _plain(found: Plan, cache: Cache, frames: int) -> dict[str, Any]:
    changes = [{"path": ".".join(map(str, c.path)), "old": c.old, "new": c.new} for c in found.changes]
    return {
        "command": "why",
        "cache": str(cache.path),
        "made_by": cache.attributes.get("made_by"),
        "frames": len(cache),
        "wanted": frames,
        "kept": found.kept,
        "known": found.known,
        "changes": changes,
    }
