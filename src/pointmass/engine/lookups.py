"""Prints the search in the data of surfaces that have any: for each kind of data, `NAME_look` and `NAME_bound`.

`NAME_look` does what `look` of the surface does to one point: it returns the signed distance and the normal. It may
remember, in the scratch array C from m on, what saves time at the next point and changes nothing; at first that is 0.
`NAME_bound(P, k, x, y, z)` returns a lower bound of the distance, at once; and `NAME_apart` one that is above 0 only
for places beyond all data, by arithmetic alone, so that a loop over lanes is one of vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pointmass.collisions import distance_grid, triangles, triangulated
from pointmass.engine.printing import function, statements
from pointmass.tracing.columns import expanded
from pointmass.tracing.trace import Traced, vector_names

MOST_LISTED = 8  # triangles that a search remembers: those around a corner, and some more
RESERVE = 0.1  # of a triangle's edge: how much farther than the nearest the others are that a search remembers
LIST = {"SEARCHED": 3, "OTHERS": 1, "LISTED": 1, "LIST": MOST_LISTED, "LEAST": MOST_LISTED}  # its memory, with sizes
MARK = "# --- printed from here on\n"


def body_of(name: str) -> str:
    """The part of a file of text that is printed."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8").split(MARK)[1].strip("\n") + "\n\n\n"


def _triangles(shape: int) -> str:
    """The text for meshes; `shape` is the column of a surface's row where the numbers of its shape begin."""
    numbers = {name: shape + j for j, name in enumerate(triangulated.NUMBERS) if name}
    numbers |= {"TRIANGLE": len(_entries()), "FEATURES": triangles.FEATURES, "LONG": list(_entries()).index("a")}
    numbers |= dict(zip(LIST, np.cumsum([0, *LIST.values()]).tolist(), strict=False))
    numbers |= {"MOST_LISTED": MOST_LISTED}
    constants = "".join(f"{name} = {value}\n" for name, value in numbers.items())
    constants += f"SLACK = {triangles.SLACK!r}\nRESERVE = {RESERVE!r}\n\n\n"
    point = dict(zip(vector_names("p"), "xyz", strict=True))
    entries = dict(list(_entries().items())[3:])
    found = _law("triangle_of", "P, at, x, y, z", triangles.triangle(), point | entries)
    own = {"half": "P[row + HALF]", "side": "P[row + SIDE]", "small": "P[row + SMALL]"}
    looked = ["qx", "qy", "qz", "square", "feature", "nx", "ny", "nz"]
    names = dict(zip([*vector_names("q"), "square", "feature", *vector_names("n")], looked, strict=True))
    result = _law("outcome_of", f"P, row, {', '.join(looked)}", triangles.outcome(), names | own)
    return constants + found + result + body_of("triangles_text.py")


def _distances(shape: int) -> str:
    """The text for grids of distances."""
    numbers = {name: shape + j for j, name in enumerate(distance_grid.NUMBERS) if name}
    constants = "".join(f"{name} = {value}\n" for name, value in numbers.items()) + "\n\n"
    point = dict(zip(vector_names("p"), "xyz", strict=True))
    own = {n: f"P[row + {name} + {j}]" for v, name in VECTORS.items() for j, n in enumerate(vector_names(v))}
    found = _law("cell_of", "P, row, x, y, z", distance_grid.cell(), point | own)
    part = dict(zip(vector_names("part"), "uvw", strict=True)) | {"side": "P[row + FREE]"}
    part |= {f"d{i}{j}{k}": f"P[at + {i} * across + {j} * along + {k}]" for i, j, k in distance_grid.CORNERS}
    arguments = "P, row, at, across, along, x, y, z, u, v, w"
    return (
        constants
        + found
        + _law("distance_of", arguments, distance_grid.distance(), point | own | part)
        + body_of("distances_text.py")
    )


VECTORS = {"inverse": "INVERSE", "counts": "COUNTS", "extent": "REACH"}  # of a grid of distances


@dataclass(frozen=True)
class Lookup:
    """A kind of data.

    Attributes
    ----------
    text : the functions; it takes the column of a surface's row where the numbers of its shape begin.
    call : of `NAME_look`.
    memory : how many numbers it remembers.
    """

    text: Callable[[int], str]
    call: str
    memory: int = 0


LOOKUPS: Mapping[str, Lookup] = {
    "triangles": Lookup(_triangles, "triangles_look(P, C, m, k, x, y, z)", sum(LIST.values())),
    "distances": Lookup(_distances, "distances_look(P, k, x, y, z)"),
}


def _entries() -> dict[str, str]:
    """The numbers of a triangle in the data, in their order: see `TriangleTree.numbers`."""
    vectors = [n for v in ("corner", "e1", "e2", "n") for n in vector_names(v)]
    return {n: f"P[at + {j}]" for j, n in enumerate([*vectors, "a", "b", "c", "inverse", "third"])}


def _law(name: str, arguments: str, law: Traced, names: Mapping[str, str]) -> str:
    lines, outputs = statements(expanded(law.program, inline=True), names, "r", "float64")
    return function(name, arguments, "**FLAGS", [*lines, f"return {', '.join(outputs)}"])
