"""Two colours on a mesh: its triangles are cut along the lines of a pattern, so that every field has sharp edges."""

from __future__ import annotations

import numpy as np

from pointmass.errors import InvalidInput, unknown
from pointmass.frame import PATTERNS, Triangles
from pointmass.render.tables import BRIGHTEST, F64

ON_LINE = 1e-6  # of the pattern's side: a corner this near to a line is on it


def patterned(full: F64, uv: F64, color: slice, drawable: Triangles) -> F64:
    """The triangles cut along the lines of the pattern, and their colours changed in every other field.

    Parameters
    ----------
    full : numbers of the corners, shape (k, 3, c); all of them are linear along an edge.
    uv : place of the corners on the pattern, shape (k, 3, 2).
    color : which of the numbers are linear RGB.

    Raises
    ------
    InvalidInput
        A pattern that does not exist, a count below 1.
    """
    if drawable.pattern not in PATTERNS:
        raise unknown(f"pattern of drawable {drawable.name!r}:", drawable.pattern, PATTERNS)
    count = int(drawable.pattern_count)
    if count < 1:
        raise InvalidInput(f"drawable {drawable.name!r} has pattern_count = {count}: it must be at least 1")
    axes = {"stripes": [0], "bands": [1]}.get(drawable.pattern, [0, 1])
    pieces = np.concatenate([full, uv], axis=2)
    width = full.shape[2]
    for axis in axes:
        for line in range(1, count):
            pieces = _cut(pieces, pieces[:, :, width + axis] - line / count)
    middle = pieces[:, :, width:].mean(axis=1)
    other = np.floor(count * middle[:, axes]).sum(axis=1) % 2 == 1
    pieces[other, :, color] = np.clip(np.asarray(drawable.pattern_color, np.float64), 0.0, BRIGHTEST)
    return pieces[:, :, :width]


def _cut(full: F64, level: F64) -> F64:
    """Triangles in pieces on either side of the line where `level`, shape (k, 3), is 0; those across it come last."""
    level = np.where(np.abs(level) < ON_LINE, 0.0, level)
    across = (level.min(axis=1) < 0.0) & (level.max(axis=1) > 0.0)
    if not across.any():
        return full
    some, side = full[across], level[across]
    # Turn each triangle until the corner that is alone on its side comes first.
    above = side > 0.0
    alone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmax(side < 0.0, axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    rows = np.arange(len(some))[:, None]
    (p, q, r), (a, b, c) = some[rows, turn].transpose(1, 0, 2), side[rows, turn].T
    pq, pr = p + (a / (a - b))[:, None] * (q - p), p + (a / (a - c))[:, None] * (r - p)
    near, far, last = (np.stack(corners, axis=1) for corners in ((p, pq, pr), (pq, q, r), (pq, r, pr)))
    return np.concatenate([full[~across], near, far[b != 0.0], last[c != 0.0]])  # a corner on the line leaves two
