"""Values on a regular grid of points, looked up between them: fields that come from measurements or other programs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import product
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.description import Described
from pointmass.errors import InvalidInput, finite_array, floats
from pointmass.tracing.program import Primitive

Outside = Literal["zero", "clamp", "wrap"]
Array = NDArray[np.floating[Any]]
Weights = list[tuple[NDArray[np.intp], Array]]  # for one axis: the points that count, each with its weight


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
    outside : what holds beyond the box of points: "zero"; "clamp": the value at the nearest place of the box; "wrap":
        the field repeats with the period n * spacing.
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
        one = isinstance(spacing, (int, float, np.ndarray)) and np.ndim(spacing) == 0
        self.spacing = finite_array("spacing of the grid", [spacing] * 3 if one else spacing, (3,))
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
        self._lookups: dict[tuple[int, tuple[int, ...]], GridLookup] = {}

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

    def lookup(self, component: int, orders: Sequence[int] = (0, 0, 0, 0)) -> GridLookup:
        """The primitive of (x, y, z, t) for one component, differentiated `orders` times along each of the four."""
        key = (component, tuple(orders))
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

    The interpolant is linear along each axis, so its derivative along an axis is the same sum over the corners of the
    cell with the weights -1/spacing and 1/spacing, and its second derivative along the same axis is 0. At a point of
    the grid it is the slope of the cell above.

    Parameters
    ----------
    grid : where the values are.
    component : which number of each point.
    orders : how often it is differentiated along x, y, z and t.
    """

    def __init__(self, grid: Grid, component: int, orders: tuple[int, ...]) -> None:
        self.grid = grid
        self.component = component
        self.orders = orders

    def columns(self, *arguments: Any) -> Any:
        """The value at places and times x, y, z, t: numbers, or arrays that broadcast."""
        dtype = np.result_type(*arguments, np.float32)
        x, y, z, t = (np.asarray(a, dtype) for a in np.broadcast_arrays(*arguments))
        table = self.grid.table(dtype)[..., self.component]
        with np.errstate(all="ignore"):  # places that are NaN or infinite show in the result
            axes = [self._in_time(t), *(self._along(axis, a) for axis, a in enumerate((x, y, z)))]
        total = np.zeros(x.shape, dtype)
        for corner in product(*axes):
            points, weights = zip(*corner, strict=True)
            total = total + reduce(np.multiply, weights) * table[points]
        return total[()]

    def derivative(self, argument: int) -> Primitive:
        orders = (order + (k == argument) for k, order in enumerate(self.orders))
        return self.grid.lookup(self.component, tuple(min(order, 2) for order in orders))

    def _along(self, axis: int, x: Array) -> Weights:
        """The neighbours along a space axis."""
        count, order = self.grid.shape[axis], self.orders[axis]
        if count == 1:
            return [(np.zeros(x.shape, np.intp), np.full(x.shape, x.dtype.type(order == 0)))]
        step = x.dtype.type(self.grid.spacing[axis])
        place = (x - x.dtype.type(self.grid.origin[axis])) / step
        last = count - 1
        match self.grid.outside:
            case "wrap":
                place = place - count * np.floor(place / count)
                last = count
                there = np.ones_like(x)
            case "clamp":
                there = ((place >= 0) & (place <= last)).astype(x.dtype) if order else np.ones_like(x)
                place = np.clip(place, 0, last)
            case "zero":
                there = (~((place < 0) | (place > last))).astype(x.dtype)  # NaN stays NaN
                place = np.clip(place, 0, last)
        below = np.clip(np.nan_to_num(np.floor(place)), 0, last - 1)
        low = below.astype(np.intp)
        return _pair(low, (low + 1) % count, place - below, there, step, order)

    def _in_time(self, t: Array) -> Weights:
        """The snapshots before and after."""
        times, order = self.grid.times.astype(t.dtype), self.orders[3]
        if len(times) == 1:
            return [(np.zeros(t.shape, np.intp), np.full(t.shape, t.dtype.type(order == 0)))]
        there = ((t >= times[0]) & (t <= times[-1])).astype(t.dtype) if order else np.ones_like(t)
        low = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        step = times[low + 1] - times[low]
        part = (np.clip(t, times[0], times[-1]) - times[low]) / step
        return _pair(low, low + 1, part, there, step, order)


def _pair(low: NDArray[np.intp], high: NDArray[np.intp], part: Array, there: Array, step: Any, order: int) -> Weights:
    """Two neighbours with the weights of the value, of its slope, or of its second derivative, which is 0."""
    if order == 0:
        return [(low, (1 - part) * there), (high, part * there)]
    slope = there / step if order == 1 else 0 * there
    return [(low, -slope), (high, slope)]


def _times(times: ArrayLike | None) -> NDArray[np.float64]:
    if times is None:
        return np.zeros(1)
    result = finite_array("times of the grid", times, (None,))
    if len(result) == 0 or (np.diff(result) <= 0).any():
        raise InvalidInput("times of the grid must be one or more, and each later than the one before [s]")
    return result


def _cells(values: ArrayLike, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values with a time axis."""
    array = floats(values)
    if array is None:
        raise InvalidInput("values of the grid must be real numbers, all rows of one length")
    if array.ndim == 4:
        array = array[None]
    if array.ndim != 5 or array.shape[4] not in (1, 3) or array.size == 0:
        raise InvalidInput(
            "values of the grid must have shape (nx, ny, nz, 3), or (nt, nx, ny, nz, 3) with times, "
            f"not {np.shape(values)}"
        )
    if len(array) != len(times):
        raise InvalidInput(f"the grid has {len(array)} snapshots for {len(times)} times: give one time for each")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        cell = tuple(int(k) for k in (bad[0][:4] if len(times) > 1 else bad[0][1:4]))
        raise InvalidInput(f"values of the grid must be finite, but cell {cell} is {array[tuple(bad[0])]}")
    return array
