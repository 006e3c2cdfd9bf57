"""Whether what a cache gives is a frame: of another program's, or of one that was tampered with, nothing is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pointmass.cache.groups import Damaged
from pointmass.frame import PATTERNS, Arrows, Curves, Drawable, Frame, Points, Segments, Triangles

Shape = tuple[int | None, ...]  # None = any length


def _array(kinds: str, *shapes: Shape) -> Callable[[Any], bool]:
    """Whether a value has one of these kinds of number, as NumPy names them, and one of these shapes."""

    def check(value: Any) -> bool:
        array = np.asarray(value)
        return array.dtype.kind in kinds and any(_fits(array.shape, shape) for shape in shapes)

    return check


def _fits(found: tuple[int, ...], wanted: Shape) -> bool:
    return len(found) == len(wanted) and all(want in (None, got) for got, want in zip(found, wanted, strict=True))


NUMBER, FLAG, TEXT = _array("fiu", ()), _array("b", ()), _array("U", ())
EACH = _array("fiu", (), (None,))
PLACES = _array("f", (None, 3))
ROWS = _array("iu", (None,))

FIELDS: dict[str, Callable[[Any], bool]] = {  # of drawables
    "name": TEXT,
    "version": _array("iu", ()),
    "vertices": PLACES,
    "index": ROWS,
    "offsets": ROWS,
    "pairs": _array("iu", (None, 2)),
    "faces": _array("iu", (None, 3)),
    "vectors": PLACES,
    "motion": PLACES,
    "normals": PLACES,
    "uv": _array("f", (None, 3, 2)),
    "radius": EACH,
    "width": EACH,
    "color": _array("fiu", (4,), (None, 4)),
    "glow": FLAG,
    "soft": FLAG,
    "smooth": FLAG,
    "daylight": NUMBER,
    "pattern": lambda value: value in PATTERNS,
    "pattern_count": _array("iu", ()),
    "pattern_color": _array("fiu", (3,)),
}
OPTIONAL = ("vertices", "index", "motion", "normals", "uv")


def check_frame(frame: Frame) -> None:
    """Refuse what is no frame.

    Raises
    ------
    Damaged
        A number, an array or a drawable is not what it must be.
    """
    n = len(frame.ids) if ROWS(frame.ids) else -1
    each = _array("f", (n, 3))
    _require("ids", n >= 0)
    _require("number", isinstance(frame.number, int))
    _require("time", isinstance(frame.time, (int, float)))
    _require("positions", each(frame.positions))
    _require("velocities", each(frame.velocities))
    _require("quantities", all(isinstance(value, (int, float, np.number)) for value in frame.quantities.values()))
    for drawable in frame.drawables:
        _check_rows(drawable, n)


def check_fields(drawable: Drawable) -> None:
    """Refuse a drawable whose fields are not of their kind.

    Raises
    ------
    Damaged
        One is not.
    """
    for name, value in vars(drawable).items():
        _require(name, (value is None and name in OPTIONAL) or FIELDS[name](value))


def _check_rows(drawable: Drawable, particles: int) -> None:
    """Refuse a drawable with corners that are not there, or with more or fewer values than items."""
    vertices = drawable.vertices
    corners = particles if vertices is None else len(vertices)
    rows: Any = None
    each: tuple[str, ...]
    match drawable:
        case Points():
            rows, each = drawable.index, ("radius", "color", "motion", "normals")
            count = corners if rows is None else len(rows)
        case Segments():
            rows, each = drawable.pairs, ("width", "color")
            count = len(rows)
        case Curves():
            rows, each, offsets = drawable.index, ("width", "color"), drawable.offsets
            count = len(rows)
            _require("offsets", len(offsets) > 0 and offsets[0] == 0 and offsets[-1] == count)
            _require("offsets", bool((np.diff(offsets) >= 0).all()))
        case Triangles():
            rows, each, count = drawable.faces, ("color",), corners
            _require("uv", drawable.uv is None or len(drawable.uv) == len(rows))
        case Arrows():
            each, count = ("vectors", "width", "color"), corners
    if rows is not None and rows.size:
        _require("rows", bool(rows.min() >= 0 and rows.max() < corners))
    for name in each:
        value = getattr(drawable, name)
        _require(name, value is None or np.ndim(value) == int(name == "color") or len(value) == count)


def _require(name: str, holds: bool) -> None:
    if not holds:
        raise Damaged(f"its {name} cannot be")
