"""A solid given by signed distances on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.collisions.collider import Array, Contact, Response
from pointmass.collisions.laws import along
from pointmass.collisions.looked_up import LookedUp
from pointmass.errors import InvalidInput, finite_array, reading
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, dot, floor, length, maximum, sqrt, where
from pointmass.tracing.trace import Traced, trace

DistanceSource = str | Path | ArrayLike
NUMBERS = ("FREE", "ORIGIN", "", "", "INVERSE", "", "", "COUNTS", "", "", "REACH", "", "")  # of the shape
SLOPES = (0.7, 1.4)  # of distances near the surface, at least and at most
CORNERS = tuple(product((0, 1), repeat=3))  # of a cell, z running fastest


def cell_law(p: Triple, inverse: Triple, counts: Triple) -> tuple[Number, ...]:
    """The cell around a point, or that which is nearest to it.

    Parameters
    ----------
    p : the point, relative to the first one of the grid.
    inverse : 1 / spacing.
    counts : points of the grid along each axis.

    Returns
    -------
    Number of the cell's first point along each axis, and where in the cell it is, from 0 to 1.
    """
    places = [a * b for a, b in zip(p, inverse, strict=True)]
    places = [where(u > 0.0, where(u < n - 1.0, u, n - 1.0), 0.0) for u, n in zip(places, counts, strict=True)]
    first = [where(floor(u) < n - 2.0, floor(u), n - 2.0) for u, n in zip(places, counts, strict=True)]
    return (*first, *(u - i for u, i in zip(places, first, strict=True)))


def distance_law(
    p: Triple, part: Triple, inverse: Triple, extent: Triple, side: Number, *values: Number
) -> tuple[Number, ...]:
    """Signed distance and its gradient: trilinear in the grid, and the solid ends where the grid ends.

    Beyond the grid, the squares of the way to it and of the distance there are added: the solid is at least as far.

    Parameters
    ----------
    p, part, inverse : as for `cell_law`, and what it returns.
    extent : of the grid [m].
    side : 1 if the free space is where the values are positive, else -1.
    values : at the corners of the cell [m].
    """
    weights = [(1.0 - u, u) for u in part]
    value: Number = 0.0
    slopes: list[Number] = [0.0, 0.0, 0.0]
    for corner, d in zip(CORNERS, values, strict=True):
        w = [weights[axis][end] for axis, end in enumerate(corner)]
        value = value + w[0] * w[1] * w[2] * d
        for axis, end in enumerate(corner):
            a, b = (w[k] for k in range(3) if k != axis)
            slopes[axis] = slopes[axis] + (a * b * d if end else -(a * b * d))
    slope = [s * i for s, i in zip(slopes, inverse, strict=True)]
    out = [where(u < 0.0, u, where(u > e, u - e, u * 0.0)) for u, e in zip(p, extent, strict=True)]
    beyond = dot(tuple(out), tuple(out))
    faces = [maximum(-u, u - e) for u, e in zip(p, extent, strict=True)]
    face = maximum(maximum(faces[0], faces[1]), faces[2])
    first, second = faces[0] >= face, faces[1] >= face
    chosen = (first, second & ~first, ~(first | second))
    flat = [where(c, where(u + u < e, -1.0, 1.0), 0.0) for c, u, e in zip(chosen, p, extent, strict=True)]
    ahead = maximum(value, 0.0)
    aside = [o + where(o == 0.0, ahead * s, 0.0) for o, s in zip(out, slope, strict=True)]
    cut, outside = face > value, beyond > 0.0
    raw = tuple(where(outside, a, where(cut, f, s)) for a, f, s in zip(aside, flat, slope, strict=True))
    distance = where(outside, sqrt(ahead * ahead + beyond), where(cut, face, value + beyond))
    return side * distance, *(side * n for n in along(raw, length(raw)))


@cache
def cell() -> Traced:
    """`cell_law` as a program."""
    return trace(cell_law, dict.fromkeys(("p", "inverse", "counts"), "vector"), 6)


@cache
def distance() -> Traced:
    """`distance_law` as a program."""
    vectors = dict.fromkeys(("p", "part", "inverse", "extent"), "vector")
    values = {f"d{i}{j}{k}": "scalar" for i, j, k in CORNERS}
    return trace(distance_law, vectors | {"side": "scalar"} | values, 4)


class DistanceGrid(LookedUp):
    """A solid whose signed distance is known at the points of a grid, linear between them in x, y and z.

    The solid ends where the grid ends: beyond it there is nothing.

    Parameters
    ----------
    distances : [m], below 0 in the solid, shape (nx, ny, nz), at least two along each axis. Or the path of an `.npz`
        file with the arrays `values` of that shape, `spacing` and `origin`.
    spacing : distance of neighbouring points [m], one number or one for each axis, above 0; not with a file.
    origin : place of the first point [m], by default that which puts the middle at 0; not with a file.
    inside : whether the free space is where the distances are below 0.
    shift : moves the whole solid [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.

    Raises
    ------
    InvalidInput
        Another shape, a distance that is not finite, distances that all have one sign or are none (their slope at the
        surface is far from 1), a file that is missing or damaged.

    Examples
    --------
    >>> x = np.stack(np.meshgrid(*[np.linspace(-1, 1, 33)] * 3, indexing="ij"))
    >>> ball = pm.DistanceGrid(np.sqrt((x**2).sum(axis=0)) - 0.7, spacing=2 / 32)
    """

    lookup: ClassVar[str] = "distances"
    smooth: ClassVar[bool] = True
    place: ClassVar[str] = "shift"

    def __init__(
        self,
        distances: DistanceSource,
        spacing: Any = None,
        origin: Any = None,
        *,
        inside: bool = False,
        shift: Vector = (0.0, 0.0, 0.0),
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        super().__init__(shift, restitution, friction, eps, contact, response)
        if isinstance(distances, (str, Path)):
            if spacing is not None or origin is not None:
                raise InvalidInput("spacing and origin of a grid of distances from a file stand in the file")
            distances, spacing, origin = _read(distances)
        self.values = finite_array("distances", distances, (None, None, None))
        if min(self.values.shape) < 2:
            raise InvalidInput(f"distances must be at least 2 x 2 x 2 numbers, not {self.values.shape}")
        low, high = float(self.values.min()), float(self.values.max())
        if not low < 0 < high:
            raise InvalidInput(
                f"distances must be below 0 in the solid and above 0 around it, not all from {low:g} to {high:g} [m]"
            )
        if spacing is None:
            raise InvalidInput("a grid of distances needs its spacing [m], one number or one for each axis")
        self.spacing = finite_array("spacing", [spacing] * 3 if np.ndim(spacing) == 0 else spacing, (3,))
        if (self.spacing <= 0).any():
            raise InvalidInput(f"spacing = {spacing} is not allowed: it must be greater than 0 [m] on every axis")
        _check_slope(self.values, self.spacing)
        self.extent = self.spacing * (np.array(self.values.shape) - 1)
        self.origin = -0.5 * self.extent if origin is None else finite_array("origin", origin, (3,))
        self.sign = -1.0 if inside else 1.0
        self.data = self.values.ravel()
        self.steepness = max(1.0, _steepest(self.values, self.spacing))

    @property
    def shape(self) -> tuple[float, ...]:
        """`NUMBERS`."""
        counts = self.values.shape
        return (self.sign, *self.origin.tolist(), *(1 / self.spacing).tolist(), *counts, *self.extent.tolist())

    @property
    def detail(self) -> float:
        """One spacing."""
        return float(self.spacing.min())

    def look(self, x: Array) -> tuple[Array, Array]:
        p = (x - self.origin).T
        inverse, counts = 1 / self.spacing, self.values.shape
        found = cell().columns(*p, *inverse, *map(float, counts))
        i, j, k = (f.astype(np.intp) for f in found[:3])
        values = [self.values[i + a, j + b, k + c] for a, b, c in CORNERS]
        result, *normal = distance().columns(*p, *found[3:], *inverse, *self.extent, self.sign, *values)
        return result, np.stack(normal, axis=1)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        """A corner in each cell that the surface passes, and a square around each of its edges that it crosses."""
        d = np.pad(self.values, 1, constant_values=float(np.abs(self.values).max()))
        inner = d < 0
        corners = np.stack([inner[a : a + d.shape[0] - 1, b : b + d.shape[1] - 1, c : c + d.shape[2] - 1]
                            for a, b, c in CORNERS])  # fmt: skip
        passed = corners.any(axis=0) & ~corners.all(axis=0)
        number = np.cumsum(passed).reshape(passed.shape) - 1
        total, count = np.zeros((passed.sum(), 3)), np.zeros((passed.sum(), 1))
        faces = []
        for axis in range(3):
            at = np.moveaxis(inner, axis, 0)
            crossed = np.moveaxis(at[:-1] != at[1:], 0, axis)
            edges = np.argwhere(crossed)
            step = np.eye(3, dtype=int)
            low, high = d[tuple(edges.T)], d[tuple((edges + step[axis]).T)]
            place = edges + (low / (low - high))[:, None] * step[axis]
            b, c = step[(axis + 1) % 3], step[(axis + 2) % 3]
            ring = [number[tuple((edges - o).T)] for o in (0 * b, b, b + c, c)]
            for cells in ring:
                np.add.at(total, cells, place)
                np.add.at(count, cells, 1)
            square = np.stack(ring, axis=1)
            square = np.where((low < 0)[:, None], square, square[:, ::-1])
            faces += [square[:, [0, 1, 2]], square[:, [0, 2, 3]]]
        places = (total / count - 1).clip(0, np.array(self.values.shape) - 1)
        return self.origin + self.spacing * places, np.concatenate(faces).astype(np.int32)


def _steepest(values: NDArray[np.float64], spacing: NDArray[np.float64]) -> float:
    """Bound of the slope between the points."""
    square: Any = 0.0
    for axis in range(3):
        along = np.abs(np.diff(values, axis=axis)) / spacing[axis]
        for other in {0, 1, 2} - {axis}:
            a, b = (
                np.take(along, range(along.shape[other] - 1), other),
                np.take(along, range(1, along.shape[other]), other),
            )
            along = np.maximum(a, b)
        square = square + along**2
    return float(np.sqrt(square.max()))


def _check_slope(values: NDArray[np.float64], spacing: NDArray[np.float64]) -> None:
    """Refuse what are no distances: near the surface those change by 1 m for each metre."""
    gradient: Any = np.gradient(values, *spacing.tolist())
    slopes = np.stack(gradient)
    near = np.abs(values) <= spacing.max()
    slope = float(np.median(np.linalg.norm(slopes[:, near], axis=0))) if near.any() else np.inf
    if not SLOPES[0] <= slope <= SLOPES[1]:
        raise InvalidInput(
            f"distances must change by about 1 m for each metre near the surface, not by {slope:.2g} m: give spacing "
            "and distances in metres, and make other fields distances first"
        )


def _read(path: str | Path) -> Sequence[Any]:
    """Values, spacing and origin from a file."""
    with reading("distance", path, [".npz"]) as file:
        with np.load(file, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        for name in ("values", "spacing", "origin"):
            if name not in arrays:
                raise InvalidInput(f"it has no array {name!r}; it has {', '.join(arrays) or 'none'}")
        return arrays["values"], arrays["spacing"], arrays["origin"]
