"""What the kernels read: rows of numbers for triangles, balls and capsules, in view coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput
from pointmass.frame import Drawable, Floats, Frame
from pointmass.render.camera import FARTHEST, View, turn

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Mask = NDArray[np.bool_]

OPAQUE = 0.999  # an alpha from here on hides what lies behind
BRIGHTEST = 1e4  # colours are held below this, so that no sum overflows


@dataclass(frozen=True, eq=False)
class Table:
    """Primitives of one kind.

    Attributes
    ----------
    rows : numbers of each primitive; the columns are named in the module that makes them.
    box : first and one past the last pixel, x0 x1 y0 y1, shape (k, 4).
    depth : by which primitives are sorted [m], shape (k,).
    solid : drawn with the z-buffer; the others are laid over or added, far ones first.
    adds : light that only adds, so its order does not matter.
    """

    rows: F32
    box: I32
    depth: F64
    solid: Mask
    adds: Mask

    def take(self, keep: Mask) -> Table:
        """The primitives where `keep` holds."""
        if bool(keep.all()):
            return self
        return Table(self.rows[keep], self.box[keep], self.depth[keep], self.solid[keep], self.adds[keep])


def join(tables: list[Table], empty: Table) -> Table:
    """One table of many."""
    tables = tables or [empty]
    if len(tables) == 1:
        return tables[0]
    return Table(
        np.concatenate([t.rows for t in tables]),
        np.concatenate([t.box for t in tables]),
        np.concatenate([t.depth for t in tables]),
        np.concatenate([t.solid for t in tables]),
        np.concatenate([t.adds for t in tables]),
    )


def corners(drawable: Drawable, frame: Frame) -> F64:
    """The corners that a drawable names, shape (n, 3)."""
    given = frame.positions if drawable.vertices is None else drawable.vertices
    rows: F64 = np.asarray(given, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InvalidInput(f"the corners of drawable {drawable.name!r} must have shape (n, 3), not {rows.shape}")
    return bounded(rows)


def bounded(rows: F64) -> F64:
    """The same numbers with NaN for what is not finite or so far away that its square would overflow."""
    return rows if np.abs(rows).max(initial=0.0) < FARTHEST else np.where(np.abs(rows) < FARTHEST, rows, np.nan)


def named(rows: F64, index: Any, name: str) -> F64:
    """`rows[index]`, or a sentence that says which drawable names a row that is not there."""
    index = np.asarray(index)
    if index.size and not 0 <= int(index.min()) <= int(index.max()) < len(rows):
        wrong = int(index.min()) if index.min() < 0 else int(index.max())
        raise InvalidInput(f"drawable {name!r} names corner {wrong}, but there are {len(rows)} (0 to {len(rows) - 1})")
    chosen: F64 = rows[index.astype(np.intp, copy=False)]
    return chosen


def turned(what: str, vectors: Floats | None, name: str, seen: F64, view: View) -> F64:
    """Vectors of the items at `seen` in view coordinates, shape (n, 3); 0 where none are given."""
    if vectors is None:
        return np.zeros_like(seen)
    given = np.asarray(vectors, dtype=np.float64)
    if given.shape != seen.shape:
        raise InvalidInput(f"drawable {name!r} has {len(seen)} items, but {what} of shape {given.shape}")
    return turn(bounded(given), view.axes)


def column(value: Floats | float, count: int, name: str) -> F64:
    """A number for each item, shape (count,)."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in ((), (1,), (count,)):
        raise InvalidInput(f"drawable {name!r} has {count} items, but radii or widths of shape {array.shape}")
    return np.broadcast_to(bounded(array), (count,))


def colors(value: Floats | tuple[float, ...], count: int, name: str) -> F64:
    """Linear RGBA for each item, shape (count, 4): not negative, alpha at most 1; NaN stays, to be dropped."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in ((4,), (count, 4)):
        raise InvalidInput(f"drawable {name!r} has {count} items, but colours of shape {array.shape}, not ({count}, 4)")
    return np.broadcast_to(np.clip(array, 0.0, (BRIGHTEST, BRIGHTEST, BRIGHTEST, 1.0)), (count, 4))


def pixel_box(low: F64, high: F64, width: int, height: int) -> I32:
    """Boxes x0 x1 y0 y1 of whole pixels around low and high corners, shape (k, 2) each, cut at the picture's edge."""
    size = np.array((width, height), dtype=np.float64)
    with np.errstate(invalid="ignore"):
        first = np.clip(np.nan_to_num(np.floor(low), nan=0.0), 0.0, size)
        last = np.clip(np.nan_to_num(np.ceil(high), nan=0.0), 0.0, size)
    box = np.empty((len(low), 4), dtype=np.int32)
    box[:, 0::2], box[:, 1::2] = first, last
    return box


def visible(box: I32) -> Mask:
    """Boxes that hold at least one pixel."""
    return (box[:, 0] < box[:, 1]) & (box[:, 2] < box[:, 3])
