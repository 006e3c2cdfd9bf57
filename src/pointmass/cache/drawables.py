"""Drawables as groups: stored once for each name and version."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from pointmass.cache.checks import check_fields
from pointmass.cache.groups import SMALL, Array, Damaged, packed, read_group, unpacked, write_group
from pointmass.frame import DRAWABLES, Drawable


def folder_of(root: Path, name: str, version: int) -> Path:
    """Where a drawable is; any name gives a folder that is allowed."""
    safe = quote(name, safe=" ").replace(".", "%2E").replace("_", "%5F")
    return root / "drawables" / (safe or "%") / str(version)


def write_drawable(root: Path, drawable: Drawable) -> None:
    """Store a drawable, unless its version is there already."""
    folder = folder_of(root, drawable.name, drawable.version)
    if folder.is_dir():
        return
    if not folder.parent.is_dir():
        write_group(folder.parent, {"name": drawable.name}, {})
    attributes: dict[str, Any] = {"kind": drawable.kind}
    arrays: dict[str, Array] = {}
    for f in fields(drawable):
        value = getattr(drawable, f.name)
        if isinstance(value, np.ndarray) and value.size >= SMALL:
            arrays[f.name] = value
        else:
            attributes[f.name] = packed(value)
    write_group(folder, attributes, arrays)


def read_drawable(root: Path, name: str, version: int) -> Drawable:
    """The drawable as it was.

    Raises
    ------
    Damaged
        It is missing or damaged.
    """
    if not isinstance(name, str) or not isinstance(version, int):
        raise Damaged("its drawables have no names")
    attributes, arrays = read_group(folder_of(root, name, version))
    try:
        kind = DRAWABLES[attributes.pop("kind")]
        values: dict[str, Any] = {key: unpacked(value) for key, value in attributes.items()} | arrays
        drawable = kind(**values)
    except (KeyError, TypeError, ValueError) as error:
        raise Damaged(f"drawable {name!r} is damaged ({type(error).__name__})") from None
    check_fields(drawable)
    if (drawable.name, drawable.version) != (name, version):
        raise Damaged(f"drawable {name!r} is another one")
    return drawable
