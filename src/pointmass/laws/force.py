"""What every force is, whatever it couples: it adds to accumulators and never overwrites them."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pointmass.description import Described
from pointmass.errors import InvalidInput, about, unknown
from pointmass.laws.parameter import Parameter
from pointmass.particles import Particles, Selection
from pointmass.tracing.trace import Traced, vector_names

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]


@dataclass
class Blocks:
    """A sparse Jacobian under construction: 3x3 blocks at (row particle, column particle).

    Attributes
    ----------
    own : rows, df/dx and df/dv of forces that depend on the particle itself; they are added up in listed order, so
        that a particle without partners has the same bits as in a compiled kernel.
    """

    rows: list[Rows] = field(default_factory=list)
    columns: list[Rows] = field(default_factory=list)
    dx: list[Array] = field(default_factory=list)
    dv: list[Array] = field(default_factory=list)
    own: list[tuple[Rows, Array, Array]] = field(default_factory=list)

    def add(self, rows: Rows, columns: Rows, dx: Array, dv: Array) -> None:
        """Add blocks df/dx and df/dv, each of shape (k, 3, 3)."""
        self.rows.append(rows)
        self.columns.append(columns)
        self.dx.append(dx)
        self.dv.append(dv)

    def add_own(self, rows: Rows, dx: Array, dv: Array) -> None:
        """Add blocks on the diagonal; no particle is in `rows` twice."""
        self.own.append((rows, dx, dv))

    def entries(self, n: int) -> tuple[Rows, Rows, Array, Array]:
        """Row, column, df/dx and df/dv of all blocks; those of a pair of particles may come in parts."""
        own = np.zeros((2, n, 3, 3), np.result_type(np.float32, *(dx for _, dx, _ in self.own), *self.dx))
        for rows, dx, dv in self.own:
            own[0, rows] += dx
            own[1, rows] += dv
        diagonal = np.arange(n)
        return (
            np.concatenate([diagonal, *self.rows]),
            np.concatenate([diagonal, *self.columns]),
            np.concatenate([own[0], *self.dx]),
            np.concatenate([own[1], *self.dv]),
        )

    def matrices(self, n: int) -> tuple[Any, Any]:
        """df/dx and df/dv as scipy.sparse CSR arrays of shape (3n, 3n)."""
        rows, columns, dx, dv = self.entries(n)
        return block_matrix(rows, columns, dx, n), block_matrix(rows, columns, dv, n)


def block_matrix(rows: Rows, columns: Rows, blocks: Array, n: int) -> Any:
    """A scipy.sparse CSR array of shape (3n, 3n) from 3x3 blocks; those at the same place are added up."""
    from scipy.sparse import csr_array

    axis = np.arange(3)
    i = (3 * rows[:, None, None] + axis[:, None] + 0 * axis).ravel()
    j = (3 * columns[:, None, None] + 0 * axis[:, None] + axis).ravel()
    return csr_array((blocks.ravel(), (i, j)), shape=(3 * n, 3 * n))


class Force(Described, ABC):
    """A law with its parameters, acting on a selection of particles.

    `force.set(k=0.3)` changes parameters of a force that is in use; `force.enabled = False` switches it off.

    Attributes
    ----------
    order : 2: adds forces [N] to particles with mass; 1: adds velocities [m/s] in a flow.
    internal : whether the forces of the law sum to zero (action and reaction).
    parameters : by name; `set` changes them.
    arguments : what the force was made with, or set to since, by name.
    on : particles that it acts on; None = all.
    selections : names of its attributes that select particles.
    enabled : whether it acts at all.
    label : its place in a scene, such as "forces.1 (drag)", for errors.
    """

    order: ClassVar[int] = 2
    internal: ClassVar[bool] = False
    selections: ClassVar[tuple[str, ...]] = ("on",)

    def __init__(self, parameters: Sequence[Parameter] = (), on: Selection = None, enabled: bool = True) -> None:
        self.parameters = {p.name: p for p in parameters}
        self.on = on
        self.enabled = bool(enabled)
        self.label = ""
        self._bound: Particles | None = None

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        return (), self.arguments  # copies and pickles are made like the force itself

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if not isinstance(getattr(type(self), k, None), cached_property)}

    def twin(self) -> Self:
        """The same force once more, for other particles: what was traced is shared, columns of numbers are not."""
        result = object.__new__(type(self))
        result.__dict__ |= self.__dict__
        result.parameters = {name: parameter.twin() for name, parameter in self.parameters.items()}
        return result

    @property
    def name(self) -> str:
        """Name for messages, scene files and reports: quadratic_drag for QuadraticDrag."""
        return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(self).__name__).lower()

    @property
    def called(self) -> str:
        """What errors call it."""
        return self.label or f"force {self.name}"

    def settings(self, particles: Particles, t: Any, rows: Rows) -> dict[str, tuple[Any, ...]]:
        """The numbers of each parameter at time t, floats or one for each of `rows` (see `Parameter.of`).

        Raises
        ------
        InvalidInput
            A parameter has a value at time t that is not allowed.
        """
        with about(self.called):
            return {p.name: p.of(particles, t, rows) for p in self.parameters.values()}

    def set(self, **values: Any) -> None:
        """Replace parameters; the values are checked like those of the constructor, and nothing is traced again.

        Raises
        ------
        InvalidInput
            A parameter that the force does not have or that cannot change, a value that is not allowed. The force
            keeps what it had.

        Examples
        --------
        >>> drag.set(k=0.3)
        >>> wind.set(velocity=("3*sin(t)", 0, 0))
        """
        fresh = type(self)(**self._arguments_with(values))
        for name in values:
            old, new = self.parameters.get(name), fresh.parameters.get(name)
            if old is None or new is None or old.vector != new.vector:
                known = ", ".join(self.parameters) or "none"
                raise InvalidInput(
                    f"{name} of {self.name} cannot be set to another kind of value: {known} can be set; "
                    "for the rest make a new force"
                )
        before = {name: list(self.parameters[name].components) for name in values}
        for name in values:
            self.parameters[name].components[:] = fresh.parameters[name].components
        try:
            if self._bound is not None:
                self.bind(self._bound)
        except InvalidInput:
            for name, components in before.items():
                self.parameters[name].components[:] = components
            raise
        self.arguments = fresh.arguments

    def put(self, rows: Rows | None = None, **values: Any) -> None:
        """Set numbers of parameters quickly, as controllers do between steps: they are checked, and not described.

        Parameters
        ----------
        rows : of the elements or particles whose numbers change, where each has its own; None = all.
        values : one number, or one for each, by name of the parameter.

        Raises
        ------
        InvalidInput
            A parameter that the force does not have, a number that is not allowed, another count of numbers.
        """
        for name, value in values.items():
            if name not in self.parameters:
                raise unknown(f"parameter of {self.called}", name, self.parameters)
            with about(self.called):
                self.parameters[name].put(value, rows)

    @property
    @abstractmethod
    def velocity_dependent(self) -> bool:
        """Whether the law depends on velocities."""

    @property
    def laws(self) -> Sequence[Traced]:
        """The programs that make up the force; none where it is not traced."""
        return ()

    @property
    def steady(self) -> bool:
        """Whether it is the same at all times, as far as anybody can know."""
        timeless = all("t" not in law.depends_on for law in self.laws)
        return bool(self.laws) and timeless and all(p.steady for p in self.parameters.values())

    def bind(self, particles: Particles) -> None:
        """Check the force against the particles that it will act on.

        Raises
        ------
        InvalidInput
            A particle, attribute or group that does not exist, a column of another length.
        """
        for name in self.selections:
            which = getattr(self, name)
            if which is not None:
                rows = particles.select(which)
                if not isinstance(which, str):
                    mask = np.zeros(len(particles), bool)
                    mask[rows] = True
                    setattr(self, name, mask)
        self._bound = particles

    @abstractmethod
    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        """Add the force at (t, x, v) to the accumulators `f`, shape (n, 3); `t` is a number or one per particle."""

    @abstractmethod
    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        """Add df/dx and df/dv at (t, x, v)."""

    def energy(self, particles: Particles, t: float, x: Array, v: Array) -> float | None:
        """Potential energy [J], or None for a law that has none."""
        return None

    def links(self, particles: Particles) -> Rows:
        """Pairs of rows that the force couples, shape (k, 2): what makes islands."""
        return np.zeros((0, 2), np.intp)

    def partners(self, particles: Particles, row: int) -> list[int]:
        """Rows that act on the particle in `row` through this force, for messages."""
        return []

    def keep(self, particles: Particles, mask: NDArray[np.bool_]) -> None:
        """Follow the removal of particles; called before it happens."""
        for name, marks in self.marks():
            setattr(self, name, marks[mask])

    def grow(self, particles: Particles, count: int) -> None:
        """Follow the birth of `count` particles, already added at the end."""
        for name, marks in self.marks():
            setattr(self, name, np.concatenate([marks, np.zeros(count, bool)]))

    def marks(self) -> list[tuple[str, NDArray[np.bool_]]]:
        """Its selections that are masks, with their names; others are names of groups."""
        chosen = [(name, getattr(self, name)) for name in self.selections]
        return [(name, which) for name, which in chosen if isinstance(which, np.ndarray)]

    def _arguments_with(self, values: dict[str, Any]) -> dict[str, Any]:
        """The constructor's arguments with other values of parameters."""
        return self.arguments | values


def inputs_for(
    traced: Traced, vectors: dict[str, Array], scalars: dict[str, Any], parameters: dict[str, tuple[Any, ...]]
) -> list[Any]:
    """The columns that a traced law takes, in its order."""
    values = dict(scalars)
    for name, array in vectors.items():
        values |= zip(vector_names(name), array.T, strict=True)
    for name, parts in parameters.items():
        values |= zip(vector_names(name) if len(parts) == 3 else (name,), parts, strict=True)
    return [values[i] for i in traced.inputs]


def clock(t: Any, rows: Any) -> Any:
    """The time of each of `rows`, in float64: t itself, or its entries where each particle has a clock of its own."""
    return t[rows] if isinstance(t, np.ndarray) else float(t)


def matrix(values: Sequence[Any], count: int, dtype: Any) -> Array:
    """Outputs of a Jacobian as an array of shape (count, len(values))."""
    result = np.empty((count, len(values)), dtype)
    for k, column in enumerate(values):
        result[:, k] = column
    return result
