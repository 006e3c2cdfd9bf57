"""Values on a regular grid of points, looked up between them: fields that come from measurements or other programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.description import Described
from pointmass.errors import InvalidInput, finite_array
from pointmass.laws.program import Primitive

Outside = Literal["zero", "clamp", "wrap"]
Array = NDArray[np.floating[Any]]
Weights = tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]  # two points, and their weights


class Grid(Described):
    """Values at the points of a regular grid, linear between them in x, y, z and t.

    An axis with a single point is constant: a plane field has shape (nx, ny, 1, 3). Before the first and after the last
    of `times` the field stands still.

    Parameters
    ----------
    values : shape (nx, ny, nz, c), or (nt, nx, ny, nz, c) with `times`; c = 3 for a vector, 1 for a number.
    origin : place of the first point [m], three numbers.
    spacing : distance of neighbouring points [m], one number or one for each axis, above 0.
    times : of the nt snapshots [s], increasing.
    outside : what holds beyond the box of points: "zero"; "clamp": the value at the nearest place of the box; "wrap": the field
        repeats with the period n * spacing.
    path : file that the values came from, where there is one.
    variables : names of the components in that file.

    Raises
    ------
    InvalidInput
        A shape that does not fit, a spacing that is not positive, times that do not increase, a cell that is NaN.

    Examples
    --------
    >>> wind = pm.Grid(np.load("wind.npy"), origin=(-1, 0, -1), spacing=0.1, outside="clamp")
    >>> system = pm.ParticleSystem(dust, forces=[pm.Flow(grid=wind)])
    """

    def __init__(
        self,
        values: ArrayLike,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        spacing: float | Sequence[float] = 1.0,
        times: ArrayLike | None = None,
        outside: Outside = "zero",
        *,
        path: str | None = None,
        variables: Sequence[str] | None = None,
    ) -> None:
        self.origin = finite_array("origin of the grid", origin, (3,))
        self.spacing = finite_array("spacing of the grid", [spacing] * 3 if np.ndim(spacing) == 0 else spacing, (3,))
        if (self.spacing <= 0).any():
            raise InvalidInput(f"spacing of the grid = {spacing} is not allowed: it must be above 0 [m] on every axis")
        if outside not in get_args(Outside):
            raise InvalidInput(f"outside = {outside!r} is not allowed: it must be 'zero', 'clamp' or 'wrap'")
        self.outside: Outside = outside
        self.path = path
        self.variables = None if variables is None else tuple(variables)
        self.times = _times(times)
        self.values = _cells(values, self.times)
        self._tables: dict[np.dtype[Any], Array] = {}
        self._lookups: dict[tuple[int, tuple[bool, ...]], GridLookup] = {}

    def __repr__(self) -> str:
        source = f" from {self.path}" if self.path else ""
        return f"<Grid: {' x '.join(map(str, self.shape))} points, {len(self.values)} times{source}>"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Points along x, y and z."""
        return self.values.shape[1:4]

    @property
    def components(self) -> int:
        """Numbers at each point."""
        return int(self.values.shape[4])

    def lookup(self, component: int, slopes: Sequence[bool] = (False,) * 4) -> GridLookup:
        """The primitive of (x, y, z, t) for one component, or its derivative along the axes marked in `slopes`."""
        key = (component, tuple(slopes))
        if key not in self._lookups:
            self._lookups[key] = GridLookup(self, *key)
        return self._lookups[key]

    def table(self, dtype: np.dtype[Any]) -> Array:
        """The values in a precision, shape (nt, nx, ny, nz, c)."""
        if dtype not in self._tables:
            self._tables[dtype] = self.values.astype(dtype)
        return self._tables[dtype]


class GridLookup(Primitive):
    """One component of a grid at (x, y, z, t), or a derivative of it.

    The interpolant is linear along each axis, so its derivative along an axis is the same sum with the weights
    -1/spacing and +1/spacing, and its second derivative along the same axis is 0. At a point of the grid it is the
    slope of the cell above.

    Parameters
    ----------
    grid : where the values are.
    component : which number of each point.
    slopes : for x, y, z and t, whether the derivative is taken.
    """

    def __init__(self, grid: Grid, component: int, slopes: tuple[bool, ...]) -> None:
        self.grid = grid
        self.component = component
        self.slopes = slopes

    def columns(self, *arguments: Any) -> Any:
        """The value at places and times, arrays or numbers that broadcast."""
        *place, t = np.broadcast_arrays(*arguments)
        dtype = np.result_type(place[0], np.float32)
        table = self.grid.table(dtype)[..., self.component]
        axes = [self._in_time(np.asarray(t, dtype))]
        inside: Any = True
        for axis, coordinate in enumerate(place):
            weights, within = self._along(axis, np.asarray(coordinate, dtype))
            axes.append(weights)
            inside = inside & within
        value = self._sum(table, axes)
        return value if inside is True else np.where(inside, value, dtype.type(0))[()]

    def derivative(self, argument: int) -> Primitive:
        if self.slopes[argument]:
            return ZERO
        return self.grid.lookup(self.component, tuple(s or k == argument for k, s in enumerate(self.slopes)))

    def _sum(self, table: Array, axes: list[Weights]) -> Any:
        """Sum over the corners of the cell, t outermost."""
        total: Any = 0
        for corner in np.ndindex(2, 2, 2, 2):
            if any(c and len(low) == 1 for c, low in zip(corner, (np.empty(n) for n in table.shape), strict=True)):
                continue  # an axis with one point has no second one
            index = tuple(axis[c] for c, axis in zip(corner, axes, strict=True))
            w = axes[0][2 + corner[0]]
            for c, axis in zip(corner[1:], axes[1:], strict=True):
                w = w * axis[2 + c]
            total = total + w * table[index]
        return total
