"""Particles: position, velocity, mass and a force accumulator each (lecture, "Particle structure")."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from keyword import iskeyword
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from pointmass.errors import InvalidInput, finite_array, floats, shown, unknown
from pointmass.skin import Skin
from pointmass.tracing.noise import mixed

Array = NDArray[np.floating[Any]]
Selection = str | slice | ArrayLike | None  # a group's name, a mask, rows; None = all
FIRST_FOREIGN_ID = 2**40  # ids from here on are made by emitters, and leave no mark on the count
NOT_ATTRIBUTES = ("t", "y", "z", "vx", "vy", "vz", "e", "pi", "dtype", "self")  # these mean something else
FIELDS = ("x", "v", "f", "m", "w", "age", "lifetime", "radius", "chance", "id", "pinned")
SPARE = 16  # room for a 16th more particles, so that births seldom move those who are there
PLAIN = ("m", "radius", "age", "lifetime")  # columns of one number that all particles have
BUILT_IN = (*PLAIN, "chance")  # and the one that follows from their ids


class Column:
    """A column of particles. Assigning to it copies numbers of the right shape into the array that is there."""

    def __init__(self, checked: Callable[[str, Any, int], Array]) -> None:
        self._checked = checked

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, particles: None, owner: type | None = None) -> Column: ...
    @overload
    def __get__(self, particles: Particles, owner: type | None = None) -> Array: ...
    def __get__(self, particles: Particles | None, owner: type | None = None) -> Column | Array:
        return self if particles is None else particles._arrays[self.name]

    def __set__(self, particles: Particles, value: ArrayLike) -> None:
        new = self._checked(self.name, value, len(particles))
        particles._arrays[self.name][...] = particles._cast(self.name, new)


def _points(name: str, value: ArrayLike, n: int | None = None) -> Array:
    array = floats(value)
    if array is None:
        return finite_array(name, value, (n, 3))  # says what is wrong
    if array.size == 0:
        return finite_array(name, np.zeros((0, 3)), (n, 3))
    array = np.atleast_2d(array)
    if array.ndim == 2 and array.shape[1] == 2:
        array = np.column_stack([array, np.zeros(len(array))])
    if n is not None and array.shape == (1, 3):
        array = np.repeat(array, n, axis=0)
    return finite_array(name, array, (n, 3))


def _column(name: str, value: ArrayLike, n: int) -> Array:
    array = floats(value)
    if array is not None and array.ndim == 0:
        return np.full(n, finite_array(name, array, ()))
    return finite_array(name, value, (n,))


def _masses(name: str, value: ArrayLike, n: int) -> Array:
    m = _column(name, value, n)
    if (m <= 0).any():
        worst = int(np.argmax(m <= 0))
        raise InvalidInput(
            f"m = {m[worst]} of particle {worst} is not allowed: a mass is positive; to hold a particle, pin it"
        )
    return m


def _lengths(name: str, value: ArrayLike, n: int) -> Array:
    radius = _column(name, value, n)
    if (radius < 0).any():
        raise InvalidInput(f"radius = {radius.min()} is not allowed: it must be at least 0 [m]")
    return radius


def _lifetimes(name: str, value: ArrayLike, n: int) -> Array:
    array = floats(value)
    if array is None:
        return _column(name, value, n)  # says what is wrong
    endless = array == np.inf
    lifetime = _column(name, np.where(endless, 1.0, array), n)
    if (lifetime <= 0).any():
        raise InvalidInput(
            f"lifetime = {lifetime.min()} is not allowed: it must be greater than 0 [s], or inf for no end"
        )
    return np.where(endless, np.inf, lifetime)


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles between particles: what one sees of a cloth, and what the wind blows on.

    Attributes
    ----------
    triangles : ids of the corners, shape (k, 3).
    uv : place of each corner on the flat pattern, from 0 to 1 along both of its sides, shape (k, 3, 2).
    areas : of the triangles as they were at the start [m^2], shape (k,).
    inside : ids of particles of the solid that it bounds, which one does not see, shape (j,).
    skin : what is drawn in place of the triangles; None = they.
    """

    triangles: NDArray[np.int64]
    uv: NDArray[np.float64]
    areas: NDArray[np.float64]
    inside: NDArray[np.int64]
    skin: Skin | None = None


class Particles:
    """Point masses as columns.

    Attributes
    ----------
    x, v : positions [m] and velocities [m/s], shape (n, 3).
    f : force accumulators [N] (order 1: velocity accumulators [m/s]), shape (n, 3).
    m : masses [kg], shape (n,), positive.
    w : inverse masses [1/kg], shape (n,); 0 = pinned. Follows from m and the pins, so it is only read.
    pinned : which particles are held where they are, shape (n,); see `pin`.
    radius : [m], shape (n,); a particle touches a collider at this distance.
    age : [s], shape (n,).
    lifetime : age at which a particle dies [s], shape (n,); inf = never. Forces may ask for ``age / lifetime``. A
        simulation notes it when the run starts, and when an emitter gives birth.
    chance : a random number in [0, 1) of each particle, by its id, shape (n,); it is only read.
    id : shape (n,), int64; never used again once a particle is gone.
    groups : masks of particles by name; see `tag`.
    surfaces : triangles between particles by name; see `cover`. A triangle goes when one of its corners is removed.
    version : counts changes of the structure (add, remove, pin, groups), so that what is derived from it can be kept.

    Parameters
    ----------
    x : shape (n, 3), or (n, 2) for a plane (z = 0), or one point.
    v : like `x`, or one vector for all; at rest by default.
    m, radius, lifetime : numbers or shape (n,).
    dtype : float64 or float32.
    attributes : further columns by name, numbers or shape (n,): charge, temperature, ...

    Raises
    ------
    InvalidInput
        A shape that does not fit, a number that is not finite, a mass that is not positive; also when a column is
        assigned, as in ``p.v = (0, 0, 1)``.
    """

    x, v, f = Column(_points), Column(_points), Column(_points)
    m, radius, age, lifetime = Column(_masses), Column(_lengths), Column(_column), Column(_lifetimes)

    def __init__(
        self,
        x: ArrayLike,
        v: ArrayLike | None = None,
        m: ArrayLike = 1.0,
        radius: ArrayLike = 0.0,
        *,
        lifetime: ArrayLike = np.inf,
        dtype: DTypeLike = np.float64,
        **attributes: ArrayLike,
    ) -> None:
        self.dtype = _dtype(dtype)
        self.attributes: dict[str, Array] = {}
        self.groups: dict[str, NDArray[np.bool_]] = {}
        self.surfaces: dict[str, Surface] = {}
        self._corners: dict[str, tuple[int, NDArray[np.intp]]] = {}  # version and rows of those of a surface
        self.version = 0
        self._next_id = 0
        self._chance = -1, np.zeros(0)
        self._pins = -1, False
        self._rooms: dict[str, tuple[NDArray[Any], int]] = {}  # memory of the columns, and up to where it is taken
        self._arrays = {name: np.zeros((0, 3), self.dtype) for name in "xvf"}
        self._arrays |= {name: np.zeros(0, self.dtype) for name in PLAIN}
        self._held = np.zeros(0, bool)
        self.id = np.zeros(0, np.int64)
        for name in attributes:
            self.attributes[attribute_name(name)] = np.zeros(0, self.dtype)
        self.add(x, v, m, radius, lifetime=lifetime, **attributes)

    def __len__(self) -> int:
        return len(self.id)

    def __repr__(self) -> str:
        return f"<Particles: {len(self)}, {int(self.pinned.sum())} pinned, {self.dtype}>"

    @property
    def pinned(self) -> NDArray[np.bool_]:
        return read_only(self._held.copy())

    @property
    def next_id(self) -> int:
        """The id of the particle that is added next."""
        return self._next_id

    @property
    def has_pins(self) -> bool:
        """Whether anybody is pinned."""
        if self._pins[0] != self.version:
            self._pins = self.version, bool(self._held.any())
        return self._pins[1]

    @property
    def w(self) -> Array:
        w: Array = 1 / self.m
        w[self._held] = 0
        return read_only(w)

    @property
    def chance(self) -> Array:
        if self._chance[0] != self.version:
            low, high = self.id.astype(np.uint64), self.id.astype(np.uint64) >> np.uint64(32)
            bits = mixed(low ^ mixed(high)) >> np.uint64(8)
            self._chance = self.version, read_only((bits * 2.0**-24).astype(self.dtype))
        return self._chance[1]

    def add(
        self,
        x: ArrayLike,
        v: ArrayLike | None = None,
        m: ArrayLike = 1.0,
        radius: ArrayLike = 0.0,
        *,
        lifetime: ArrayLike = np.inf,
        id: ArrayLike | None = None,
        **attributes: ArrayLike,
    ) -> NDArray[np.int64]:
        """Append particles; returns their ids. Attributes that are not given are 0.

        Raises
        ------
        InvalidInput
            As for the constructor, and an attribute that the other particles do not have.
        """
        x = _points("x", x)
        n = len(x)
        v = np.zeros((n, 3)) if v is None else _points("v", v, n)
        m, radius, lifetime = _masses("m", m, n), _lengths("radius", radius, n), _lifetimes("lifetime", lifetime, n)
        with np.errstate(over="ignore"):
            if not np.isfinite((1 / m).astype(self.dtype)).all():
                raise InvalidInput(f"m = {m.min()} is not allowed: 1/m is too large for {self.dtype}")
        for name in attributes:
            if name not in self.attributes:
                raise unknown("particle attribute", name, self.attributes)
        columns = {name: _column(name, attributes.get(name, 0.0), n) for name in self.attributes}
        ids = self._new_ids(n, id)
        new = {"x": x, "v": v, "f": np.zeros((n, 3)), "m": m, "radius": radius}
        new |= {"age": np.zeros(n), "lifetime": lifetime}
        new, columns = ({name: self._cast(name, part) for name, part in d.items()} for d in (new, columns))
        self._next_id = max(self._next_id, int(ids[ids < FIRST_FOREIGN_ID].max(initial=-1)) + 1)
        for name, values in new.items():
            self._arrays[name] = self._longer(name, self._arrays[name], values)
        for name, values in columns.items():
            self.attributes[name] = self._longer(name, self.attributes[name], values)
        for name, mask in self.groups.items():
            self.groups[name] = np.concatenate([mask, np.zeros(n, bool)])
        self.id = self._longer("id", self.id, ids)
        self._held = self._longer("pinned", self._held, np.zeros(n, bool))
        self.version += 1
        return ids

    def declare(self, *names: str) -> None:
        """Have these further columns, of zeros where they are new."""
        for name in names:
            if name not in self.attributes:
                self.attributes[attribute_name(name)] = np.zeros(len(self), self.dtype)
                self.version += 1

    def remove(self, which: Selection) -> None:
        """Take particles away; the others keep their order, ids and bits."""
        gone = np.zeros(len(self), bool)
        gone[self.select(which)] = True
        self.keep(~gone)

    def keep(self, mask: NDArray[np.bool_]) -> None:
        """Keep the particles of a mask, in order."""
        first = int(mask.argmax()) if len(mask) else 0
        youngest = bool(mask[first:].all())  # the oldest die, the usual case: nothing needs to move
        self._take((lambda values: values[first:]) if youngest else lambda values: _some(values, mask))

    def part(self, mask: NDArray[np.bool_]) -> Particles:
        """A copy of the particles of a mask, in order; these stay as they are."""
        result = copy(self)
        result._rooms, result._corners = {}, {}
        result._take(lambda values: _some(values, mask))
        return result

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything that may change while a run goes on, by name: see `Simulation.state`."""
        columns = {name: self._arrays[name].copy() for name in ("x", "v", *PLAIN)}
        columns |= {"id": self.id.copy(), "pinned": self._held.copy(), "version": np.array([self.version])}
        columns["next_id"] = np.array([self._next_id])
        columns |= {f"attribute.{name}": values.copy() for name, values in self.attributes.items()}
        groups = list(self.groups.values())
        return columns | {"groups": np.array(groups, bool).reshape(len(groups), len(self))}

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Be as in a `state` of the same particles."""
        for name in ("x", "v", *PLAIN):
            self._arrays[name][...] = state[name]
        for name, values in self.attributes.items():
            values[...] = state[f"attribute.{name}"]
        self._held[:] = state["pinned"]
        for mask, stored in zip(self.groups.values(), state["groups"], strict=True):
            mask[:] = stored
        self.version, self._next_id = int(state["version"][0]), int(state["next_id"][0])

    def select(self, which: Selection) -> NDArray[np.intp]:
        """Rows of a selection, ascending.

        Parameters
        ----------
        which : a group's name, a mask of shape (n,), rows counted from 0, a slice of them, or None for all.

        Raises
        ------
        InvalidInput
            No such group, a mask of another length, a row that does not exist.
        """
        n = len(self)
        if which is None:
            return np.arange(n)
        if isinstance(which, str):
            if which not in self.groups:
                raise unknown("group of particles", which, self.groups)
            return np.flatnonzero(self.groups[which])
        try:
            rows = np.arange(n)[which] if isinstance(which, slice) else np.atleast_1d(np.asarray(which))
        except (TypeError, ValueError):
            rows = np.full(1, np.nan)
        if rows.dtype == bool:
            if rows.shape != (n,):
                raise InvalidInput(f"a mask of particles must have shape ({n},), not {rows.shape}")
            return np.flatnonzero(rows)
        if rows.size == 0:
            return np.zeros(0, np.intp)
        if rows.ndim > 1 or rows.dtype.kind not in "iu" or rows.min() < 0 or rows.max() >= n:
            raise InvalidInput(f"rows of particles must be whole numbers below {n}, counted from 0, not {shown(which)}")
        return np.unique(rows.astype(np.intp))

    def tag(self, name: str, which: Selection) -> None:
        """Give a selection a name, to be used wherever particles are selected."""
        mask = np.zeros(len(self), bool)
        mask[self.select(which)] = True
        self.groups[name] = mask
        self.version += 1

    def cover(
        self,
        name: str,
        triangles: ArrayLike,
        uv: ArrayLike | None = None,
        inside: ArrayLike | None = None,
        skin: Skin | None = None,
    ) -> None:
        """Give triangles between particles a name: they are drawn as a smooth surface, and wind may blow on them.

        Parameters
        ----------
        triangles : ids of the corners, shape (k, 3).
        uv : place of each corner on the flat pattern, shape (k, 3, 2); 0 by default.
        inside : ids of particles of the solid that it bounds, which it hides, shape (j,); none by default.
        skin : a smoother mesh, drawn in place of the triangles.

        Raises
        ------
        InvalidInput
            A corner that is no particle, another shape.
        """
        corners = np.asarray(triangles)
        if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
            raise InvalidInput(f"triangles of a surface must be ids of shape (k, 3), not {shown(triangles)}")
        gone = self.rows(corners) < 0
        if gone.any():
            raise InvalidInput(
                f"a triangle of surface {name!r} has the corner {corners[gone][0]}, which does not exist"
            )
        places = np.zeros((*corners.shape, 2)) if uv is None else finite_array("uv", uv, (len(corners), 3, 2))
        a, b, c = self.x[self.rows(corners).T].astype(np.float64)
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        hidden = np.zeros(0, np.int64) if inside is None else np.asarray(inside)
        if hidden.ndim != 1 or hidden.dtype.kind not in "iu" or (self.rows(hidden) < 0).any():
            raise InvalidInput(f"inside of surface {name!r} must be ids of particles, not {shown(inside)}")
        self.surfaces[name] = Surface(corners.astype(np.int64), places, areas, hidden.astype(np.int64), skin)
        self.version += 1

    def pin(self, which: Selection) -> None:
        """Hold particles where they are: inverse mass 0 (never a large mass), velocity 0."""
        rows = self.select(which)
        self._held[rows] = True
        self.v[rows] = 0
        self.version += 1

    def unpin(self, which: Selection) -> None:
        """Let particles go."""
        self._held[self.select(which)] = False
        self.version += 1

    def rows(self, ids: ArrayLike) -> NDArray[np.intp]:
        """Row of each id; -1 where that particle is gone."""
        ids = np.asarray(ids)
        asked, which = np.unique(ids, return_inverse=True)
        if not len(asked):
            return np.full(ids.shape, -1)
        near = np.flatnonzero((self.id >= asked[0]) & (self.id <= asked[-1]))  # of many particles few are asked for
        place = np.searchsorted(asked, self.id[near])
        here = asked[place] == self.id[near]
        rows = np.full(len(asked), -1)
        rows[place[here]] = near[here]
        return rows[which].reshape(ids.shape)

    def column(self, name: str) -> Array:
        """A column of numbers by name: m, radius, age, lifetime, chance or a further attribute, shape (n,)."""
        if name in BUILT_IN:
            return getattr(self, name)  # type: ignore[no-any-return]
        if name not in self.attributes:
            raise unknown("particle attribute", name, self.columns)
        return self.attributes[name]

    @property
    def columns(self) -> list[str]:
        """Names that `column` knows."""
        return [*BUILT_IN, *self.attributes]

    def _new_ids(self, n: int, ids: ArrayLike | None) -> NDArray[np.int64]:
        if ids is None:
            ids = np.arange(self._next_id, self._next_id + n)
        given = np.asarray(ids)
        if given.size and given.dtype.kind not in "iu":
            given = np.zeros(0)
        result = given.astype(np.int64)
        # Later than all others, as most births are: that takes no search.
        later = bool(len(self) and result.size and result.min() > self.id.max())
        if (
            result.shape != (n,)
            or not ((result[1:] > result[:-1]).all() or len(np.unique(result)) == n)
            or not (later or (self.rows(result) < 0).all())
        ):
            raise InvalidInput(f"id must be {n} whole numbers that no other particle has")
        return result

    def _take(self, some: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
        """Replace every column by some of its rows."""
        self._arrays = {name: some(values) for name, values in self._arrays.items()}
        self.id, self._held = some(self.id), some(self._held)
        self.attributes = {name: some(values) for name, values in self.attributes.items()}
        self.groups = {name: some(values) for name, values in self.groups.items()}
        self.surfaces = {name: self._whole(surface) for name, surface in self.surfaces.items()}
        self.version += 1

    def corners(self, name: str) -> NDArray[np.intp]:
        """Rows of the corners of a surface, shape (k, 3)."""
        known = self._corners.get(name)
        if known is None or known[0] != self.version:
            known = self._corners[name] = self.version, self.rows(self.surfaces[name].triangles)
        return known[1]

    def _whole(self, surface: Surface) -> Surface:
        """The triangles of which all corners are there, and who is still inside."""
        here = (self.rows(surface.triangles) >= 0).all(axis=1)
        inside = surface.inside[self.rows(surface.inside) >= 0]
        skin = surface.skin and surface.skin.kept(self.rows(surface.skin.nodes) >= 0)
        return Surface(surface.triangles[here], surface.uv[here], surface.areas[here], inside, skin)

    def _longer(self, name: str, column: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
        """A column with more rows, written into the room behind it if there is some left that nobody has written to."""
        room, end = self._rooms.get(name, (None, 0))
        more = end + len(values)
        if room is None or column.base is not room or _end(column) != _end(room[:end]) or more > len(room):
            end, more = len(column), len(column) + len(values)
            room = np.empty((more + more // SPARE, *column.shape[1:]), column.dtype)
            room[:end] = column
        room[end:more] = values
        self._rooms[name] = room, more
        return room[end - len(column) : more]

    def _cast(self, name: str, values: Array) -> Array:
        with np.errstate(over="ignore"):
            result = values.astype(self.dtype)
        if (np.isinf(result) & ~np.isinf(values)).any():
            raise InvalidInput(f"{name} has a number that is too large for {self.dtype}")
        return result


def _some(values: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[Any]:
    """Rows of a mask; a row of three numbers is moved as one item, ten times as fast as number by number."""
    if values.ndim == 1:
        return values[mask]
    row = np.dtype((np.void, values.shape[1] * values.itemsize))
    return values.view(row)[:, 0][mask].view(values.dtype).reshape(-1, values.shape[1])


def _end(values: NDArray[Any]) -> int:
    """Where in memory an array ends."""
    return int(values.__array_interface__["data"][0]) + values.nbytes


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """The array, which nobody can write from now on."""
    array.flags.writeable = False
    return array


def attribute_name(name: object) -> str:
    """The name of a further column, if it is one that formulas can say and that means nothing else.

    Raises
    ------
    InvalidInput
        The name of a column that all particles have, or no word at all.
    """
    taken = (*FIELDS, *NOT_ATTRIBUTES)
    if not isinstance(name, str) or not name.isidentifier() or iskeyword(name) or name in taken:
        raise InvalidInput(f"particle attribute {name!r} is not allowed: use a word that is not {', '.join(taken)}")
    return name


def _dtype(dtype: DTypeLike) -> np.dtype[Any]:
    try:
        result = np.dtype(dtype)
    except TypeError:
        result = np.dtype(object)
    if result not in (np.float64, np.float32):
        raise InvalidInput(f"dtype = {dtype} is not allowed: it must be float64 or float32")
    return result
