"""Parameters of laws: a number, a column, a formula of particle attributes and time, or a function of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array, floats, number, shown, whole_number
from pointmass.laws.formula import Formula
from pointmass.particles import Particles, read_only
from pointmass.tracing.program import flatten
from pointmass.tracing.trace import Traced, trace

Scalar = float | str | Callable[[Any], Any] | Sequence[float] | NDArray[np.floating[Any]]
Vector = Sequence[Any] | Callable[[Any], Any] | NDArray[np.floating[Any]]
Rows = NDArray[np.intp]


class Component:
    """One number of a parameter: a constant, a column, or a program of t and particle attributes."""

    def __init__(self, name: str, value: Any, bounds: dict[str, float], unit: str) -> None:
        self.name, self.unit = name, unit
        self.bounds: dict[str, float] | None = bounds  # None: any number, even one that is not finite
        self.value: float | NDArray[np.float64] | Traced
        self.needs: tuple[str, ...] = ()
        self.formula: Formula | None = None
        if isinstance(value, str):
            self.formula = formula = Formula(value, what=name)
            self.needs = tuple(sorted(formula.names - {"t"}))
            names = ("t", *self.needs)
            arguments = dict.fromkeys(names, "scalar")
            if formula.names:
                self.value = trace(lambda *v: formula(dict(zip(names, v, strict=True))), arguments, 1, name)
            else:
                self.value = number(name, formula({}), unit=unit, **bounds)
        elif callable(value):
            self.value = trace(value, {"t": "scalar"}, 1, name)
        elif _ndim(value) == 1:
            self.value = read_only(finite_array(name, value, (None,)).copy())  # kernels need not look for changes
            self._check(self.value)
        else:
            self.value = number(name, value, unit=unit, **bounds)

    def of(self, particles: Particles, t: Any, rows: Rows) -> Any:
        """The number, or one for each of `rows`."""
        if isinstance(self.value, np.ndarray):
            return self.value[rows].astype(particles.dtype)
        return self.at(t, *(particles.column(n)[rows] for n in self.needs))

    def at(self, t: Any, *columns: Any) -> Any:
        """The number at time t, for the attributes that it needs.

        Raises
        ------
        InvalidInput
            It is not allowed, though at other times it may have been.
        """
        if not isinstance(self.value, Traced):
            return self.value
        value = self.value.columns(t, *columns)[0]
        try:
            self._check(value)
        except InvalidInput:
            for now, each in np.broadcast(t, value):  # whose it is, and when
                try:
                    self._check(each)
                except InvalidInput as error:
                    raise InvalidInput(f"at t = {now:.6g} s, {error}") from None
        return value

    def _check(self, value: Any) -> None:
        """Refuse a number, or one of several, that is not finite or out of bounds."""
        if self.bounds is not None and np.size(value):
            for extreme in (np.min(value), np.max(value)):
                number(self.name, extreme, unit=self.unit, **self.bounds)

    def rate(self) -> Component:
        """d/dt of the component."""
        result = Component(f"d {self.name}/dt", 0.0, {}, "")
        result.bounds = None
        if isinstance(self.value, Traced):
            result.value, result.needs, result.formula = self.value.jacobian("t"), self.needs, self.formula
        return result


class Parameter:
    """A named input of a law.

    Parameters
    ----------
    name : as in the law's signature.
    value : scalar: a number, a column, a formula such as "0.1*radius" or "1 + sin(t)", or a function of t;
        vector: three of these, a column of shape (n, 3), or a function of t that returns three numbers.
    vector : whether the law takes it as a tuple of three.
    unit : for messages.
    bounds : `above`, `at_least`, `at_most`, as for `errors.number`.
    """

    def __init__(self, name: str, value: Any, *, vector: bool = False, unit: str = "", **bounds: float) -> None:
        self.name = name
        self.vector = vector
        self.unit = unit
        self.components = [
            Component(f"{name}.{axis}" if vector else name, part, bounds, unit)
            for axis, part in zip("xyz" if vector else " ", self._parts(value), strict=True)
        ]

    def of(self, particles: Particles, t: Any, rows: Rows) -> tuple[Any, ...]:
        """The numbers of the parameter, each a float or one value for each of `rows`."""
        return tuple(c.of(particles, t, rows) for c in self.components)

    def at(self, t: Any) -> tuple[Any, ...]:
        """The numbers at time t, for a parameter that knows no particles."""
        return tuple(c.at(t) for c in self.components)

    def rate(self) -> Parameter:
        """The parameter's rate of change, exact, from the program of its formula."""
        result = Parameter.__new__(Parameter)
        result.name, result.vector, result.unit = f"d {self.name}/dt", self.vector, f"{self.unit}/s"
        result.components = [c.rate() for c in self.components]
        return result

    @property
    def constant(self) -> bool:
        """Whether it is the same at all times and for all particles."""
        return all(isinstance(c.value, float) for c in self.components)

    @property
    def steady(self) -> bool:
        """Whether it is the same at all times."""
        return not any(isinstance(c.value, Traced) and "t" in c.value.depends_on for c in self.components)

    @property
    def common(self) -> bool:
        """Whether it is the same for all particles (a number or a function of t)."""
        return all(isinstance(c.value, float) or (isinstance(c.value, Traced) and not c.needs) for c in self.components)

    @property
    def attributes(self) -> set[str]:
        """Particle attributes that it reads."""
        return {n for c in self.components for n in c.needs}

    def check(self, particles: Particles, count: int, what: str) -> None:
        """Refuse a column of another length, and attributes that the particles do not have."""
        for c in self.components:
            if isinstance(c.value, np.ndarray) and len(c.value) != count:
                raise InvalidInput(
                    f"{c.name} has {len(c.value)} values for {count} {what}: give one number, one for each, "
                    "or the name of a particle attribute"
                )
            if c.formula is not None:
                c.formula.restrict(["t", *particles.columns])

    def put(self, values: Any, rows: NDArray[np.bool_] | Rows | None = None) -> None:
        """Have other numbers, which are checked like those before: one, or one for each thing that has one.

        Parameters
        ----------
        rows : of the things whose numbers change, where each has its own; None = all.

        Raises
        ------
        InvalidInput
            A number that is not allowed, another count than before, a parameter that is a function of t or a vector, or
            that is one number where only some should change.
        """
        if not self.may_be_put:
            raise InvalidInput(f"{self.name} cannot be controlled: it is a vector or a function of t")
        (component,) = self.components
        old, array, part = component.value, np.asarray(values, np.float64), slice(None) if rows is None else rows
        if rows is not None and not isinstance(old, np.ndarray):
            raise InvalidInput(f"{self.name} is one number for all: give each its own, if only some should change")
        shape = old[part].shape if isinstance(old, np.ndarray) else ()
        if array.ndim > 1 or (isinstance(old, np.ndarray) and array.ndim and array.shape != shape):
            raise InvalidInput(f"{self.name} takes one number or {shape}, not an array of shape {array.shape}")
        component._check(array)
        if isinstance(old, np.ndarray):
            whole = old.copy()
            whole[part] = array
            component.value = read_only(whole)
        else:
            component.value = read_only(array.copy()) if array.ndim else float(array)

    @property
    def may_be_put(self) -> bool:
        """Whether `put` can change it: one number, or a column of them."""
        return len(self.components) == 1 and not isinstance(self.components[0].value, Traced)

    def numbers(self) -> NDArray[np.float64]:
        """The number or numbers of one that `may_be_put`, shape () or (rows,)."""
        return np.asarray(self.components[0].value, np.float64)

    def joins(self, other: Parameter) -> bool:
        """Whether a column can hold the numbers of both: functions of t must be the same."""
        return self.vector == other.vector and all(map(_alike, self.components, other.components))

    def take_in(self, other: Parameter, count: int, more: int) -> None:
        """Have the numbers of another one, for `more` things, after one's own `count`; one that both share stays."""
        for mine, its in zip(self.components, other.components, strict=True):
            a, b = mine.value, its.value
            if not isinstance(a, Traced) and not isinstance(b, Traced) and (np.ndim(a) or np.ndim(b) or a != b):
                mine.value = read_only(np.concatenate([np.broadcast_to(a, count), np.broadcast_to(b, more)]))

    def twin(self) -> Parameter:
        """The same parameter once more, whose columns can follow other particles."""
        result = copy(self)
        result.components = [copy(c) for c in self.components]
        return result

    def keep(self, rows: NDArray[np.bool_] | Rows) -> None:
        """Keep some rows of columns of numbers: those of a mask, or in any order, some of them more than once."""
        for c in self.components:
            if isinstance(c.value, np.ndarray):
                c.value = read_only(c.value[rows])

    def each(self, count: int, what: str) -> None:
        """Have a number of its own for each of `count` things, though it may be the same for all so far.

        Raises
        ------
        InvalidInput
            It is a function of t.
        """
        for c in self.components:
            if isinstance(c.value, Traced):
                raise InvalidInput(f"{c.name} of {what} is not allowed to be a function of t: use numbers")
            if not isinstance(c.value, np.ndarray):
                c.value = read_only(np.full(count, c.value))

    def scale(self, factors: NDArray[np.floating[Any]]) -> None:
        """Multiply columns of numbers by factors, shape (rows,)."""
        for c in self.components:
            if isinstance(c.value, np.ndarray):
                c.value = read_only(c.value * factors)

    def _parts(self, value: Any) -> list[Any]:
        if not self.vector:
            return [value]
        if callable(value):
            return [lambda t, k=k: self._part(value(t), k) for k in range(3)]
        if not isinstance(value, str) and _ndim(value) == 2:
            return list(finite_array(self.name, value, (None, 3)).T)
        if isinstance(value, str) or not hasattr(value, "__len__") or len(value) not in (2, 3):
            given = shown(value)
            raise InvalidInput(f"{self.name} must be three numbers or formulas, such as (0, -9.81, 0), not {given}")
        return [*value, 0.0][:3]

    def _part(self, vector: Any, axis: int) -> Any:
        parts = list(flatten(vector))
        if len(parts) not in (2, 3):
            raise InvalidInput(f"{self.name} must be a function of t that returns three numbers, not {len(parts)}")
        return [*parts, 0.0][axis]


def _alike(a: Component, b: Component) -> bool:
    """Whether both are numbers, or both the same function."""
    if not isinstance(a.value, Traced) or not isinstance(b.value, Traced):
        return not isinstance(a.value, Traced) and not isinstance(b.value, Traced)
    return a.needs == b.needs and a.value.program.text == b.value.program.text


def _ndim(value: Any) -> int:
    """Dimensions of an array of numbers; 0 for anything else."""
    array = floats(value)
    return 0 if array is None else array.ndim


def seed_parameter(seed: int) -> Parameter:
    """The parameter "seed" of a random law: a whole number, of which the 24 bits count that float32 holds.

    Raises
    ------
    InvalidInput
        It is not a whole number, or below 0.
    """
    return Parameter("seed", float(whole_number("seed", seed, at_least=0) % 2**24))
