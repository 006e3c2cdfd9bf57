"""Forces between particles of a selection: all pairs, or the pairs within a cut-off."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, ClassVar, overload

import numpy as np

from pointmass.errors import InvalidInput, finite_array
from pointmass.laws.force import Array, Blocks, Force, Rows, clock, inputs_for, matrix
from pointmass.laws.neighbours import nearest, pairs_within
from pointmass.laws.parameter import Parameter
from pointmass.laws.unary import law_name, law_parameters, origin, parameters_from
from pointmass.particles import Particles, Selection
from pointmass.tracing.trace import Traced, trace, vector_names

PAIRS_AT_ONCE = 2**18  # a block of columns of this many pairs stays in the cache
LARGEST_JACOBIAN = 1500  # particles of all pairs; a dense Jacobian has 18 n^2 numbers
STATE = ("x1", "v1", "m1", "x2", "v2", "m2", "t")

Box = tuple[float, float, float]


class PairForce(Force):
    """A law between every two particles of a selection, or every two that are nearer than a cut-off.

    A law names those of the force's parameters that it reads.

    Attributes
    ----------
    law : (x1, v1, m1, x2, v2, m2, t, *parameters) -> what particle 2 adds to the sums of particle 1: its force, three
        numbers, or any numbers that `finish` makes a force of.
    finish : (sums, x, v, m, t, *parameters) -> the force on a particle whose sums are complete; None = the sums are it.
    potential : the energy of a pair, of the arguments of the law, where there is one.
    per_particle : parameters that each particle has its own of; the law gets them as pairs (p1, p2).
    box : sides of a periodic box [m], or None. Each pair is taken at its nearest images: x2 is moved by whole sides
        before the law sees it. Positions themselves are not wrapped.
    by : particles that act on those of `on`: particle 2 of each pair; None = those of `on`. What acts one way only
        has no energy.

    Notes
    -----
    A parameter `cutoff` [m], one number, makes the law act on pairs nearer than it only.
    """

    internal: ClassVar[bool] = True
    law: ClassVar[Callable[..., Any]]
    finish: ClassVar[Callable[..., Any] | None] = None
    potential: ClassVar[Callable[..., Any] | None] = None
    per_particle: ClassVar[tuple[str, ...]] = ()
    selections: ClassVar[tuple[str, ...]] = ("on", "by")

    def __init__(
        self,
        parameters: Sequence[Parameter],
        on: Selection = None,
        enabled: bool = True,
        box: Box | None = None,
        by: Selection = None,
    ) -> None:
        super().__init__(parameters, on, enabled)
        self.by = by
        self.box = None if box is None else tuple(float(side) for side in finite_array("box", box, (3,)))
        if self.box is not None and min(self.box) <= 0:
            raise InvalidInput(f"box = {box} is not allowed: its sides must be greater than 0 [m]")

    @cached_property
    def traced(self) -> Traced:
        """The law as a program; its outputs are the sums."""
        return trace(self._paired(self.law), self._signature(), None if self.finish else 3, self.name)

    @cached_property
    def traced_finish(self) -> Traced | None:
        """What makes a force of the sums, as a program of sum0, sum1, ... and a particle's own quantities."""
        if self.finish is None:
            return None
        count = len(self.traced.program.outputs)
        state = {"x": "vector", "v": "vector", "m": "scalar", "t": "scalar"} | dict.fromkeys(self.parameters, "scalar")
        wanted = _names(self.finish)

        def call(*arguments: Any) -> Any:
            own = dict(zip(self.parameters, arguments[count + 4 :], strict=True))
            named = {n: value for n, value in own.items() if n in wanted}
            return self.finish(arguments[:count], *arguments[count : count + 4], **named)  # type: ignore[misc]

        return trace(call, {f"sum{k}": "scalar" for k in range(count)} | state, 3, f"{self.name} finish")

    @cached_property
    def traced_potential(self) -> Traced | None:
        """The potential energy of a pair as a program."""
        if self.potential is None or self.by is not None:
            return None
        return trace(self._paired(self.potential), self._signature(), 1, f"{self.name} potential")

    @cached_property
    def traced_slopes(self) -> Traced:
        """Slopes of the sums by x1, v1, x2 and v2, as a program."""
        return self.traced.jacobian(*(n for a in "12" for q in "xv" for n in vector_names(f"{q}{a}")))

    @property
    def velocity_dependent(self) -> bool:
        finish = self.traced_finish
        return bool({"v1", "v2"} & self.traced.depends_on) or (finish is not None and "v" in finish.depends_on)

    def reach(self, particles: Particles) -> float | None:
        """The cut-off [m]; None = all pairs."""
        return float(self.parameters["cutoff"].components[0].value) if "cutoff" in self.parameters else None  # type: ignore[arg-type]

    @property
    def laws(self) -> Sequence[Traced]:
        return (self.traced,) if self.traced_finish is None else (self.traced, self.traced_finish)

    def bind(self, particles: Particles) -> None:
        super().bind(particles)
        for p in self.parameters.values():
            p.check(particles, len(particles), "particles")
            if p.vector or (p.name not in self.per_particle and not p.common):
                raise InvalidInput(f"{p.name} of {self.name} must be one number or a function of t")
            if p.name == "cutoff" and not p.constant:
                raise InvalidInput(f"cutoff of {self.name} must be one number")
        reach = self.reach(particles)
        if self.box is not None and (reach is None or 2 * reach > min(self.box)):
            given = "no cut-off" if reach is None else f"a cut-off of {reach:g} m"
            raise InvalidInput(
                f"{self.name} has {given} in a periodic box: give one of at most half the smallest side, "
                f"{0.5 * min(self.box):g} m"
            )
        _ = self.traced, self.traced_finish

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows, others = self.ends(particles)
        sums = np.zeros((len(rows), len(self.traced.program.outputs)), x.dtype)
        for i, j in self._pairs(particles, x):
            for k, part in enumerate(self._values(self.traced, particles, t, x, v, rows[i], others[j])):
                if part.ndim == 2:
                    sums[i[:, 0], k] = part.sum(axis=1)
                else:
                    np.add.at(sums[:, k], i, part)
        if self.traced_finish is None:
            f[rows] += sums
        else:
            f[rows] += self._finished(self.traced_finish, particles, t, x, v, rows, sums)

    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        rows, others = self.ends(particles)
        coupled = max(len(rows), len(others))
        if self.reach(particles) is None and coupled > LARGEST_JACOBIAN:
            raise InvalidInput(
                f"{self.name} couples {coupled} particles, and implicit solvers take at most {LARGEST_JACOBIAN}: "
                "use leapfrog or dopri5"
            )
        count = len(self.traced.program.outputs)
        found = [(np.ravel(a), np.ravel(b)) for i, j in self._pairs(particles, x) for a, b in [_both(i, j)]]
        i, j = (np.concatenate([pair[k] for pair in found]) if found else rows[:0] for k in (0, 1))
        parts = self._values(self.traced_slopes, particles, t, x, v, rows[i], others[j])
        values = matrix(parts, len(i), x.dtype).reshape(-1, count, 2, 2, 3)  # sum, node, x|v, axis
        if self.finish is not None:
            sums = np.zeros((len(rows), count), x.dtype)
            for k, part in enumerate(self._values(self.traced, particles, t, x, v, rows[i], others[j])):
                np.add.at(sums[:, k], i, part)
            slopes = self._finished(self._finish_jacobian, particles, t, x, v, rows, sums)
            slopes = slopes.reshape(len(rows), 3, count + 6)
            own = slopes[:, :, count:].reshape(-1, 3, 2, 3)
            blocks.add(rows, rows, own[:, :, 0], own[:, :, 1])
            values = np.einsum("pas,psnqb->panqb", slopes[i, :, :count], values)
        blocks.add(rows[i], rows[i], values[:, :, 0, 0], values[:, :, 0, 1])
        blocks.add(rows[i], others[j], values[:, :, 1, 0], values[:, :, 1, 1])

    def energy(self, particles: Particles, t: float, x: Array, v: Array) -> float | None:
        if self.traced_potential is None:
            return None
        rows = particles.select(self.on)
        total = 0.0
        for i, j in self._pairs(particles, x):
            (part,) = self._values(self.traced_potential, particles, t, x, v, rows[i], rows[j])
            total += float(part.sum(dtype=np.float64))
        return 0.5 * total

    def links(self, particles: Particles) -> Rows:
        rows = np.union1d(*self.ends(particles))
        return np.stack([rows[:-1], rows[1:]], axis=1)

    def ends(self, particles: Particles) -> tuple[Rows, Rows]:
        """Rows that the force acts on, and those that act on them."""
        rows = particles.select(self.on)
        return rows, rows if self.by is None else particles.select(self.by)

    def partners(self, particles: Particles, row: int) -> list[int]:
        _, others = self.ends(particles)
        same = (particles.x[others] == particles.x[row]).all(axis=1)
        return [int(r) for r in others[same] if r != row]

    def keep(self, particles: Particles, mask: Any) -> None:
        super().keep(particles, mask)
        for p in self.parameters.values():
            p.keep(mask)

    def grow(self, particles: Particles, count: int) -> None:
        super().grow(particles, count)
        self.bind(particles)

    @cached_property
    def _finish_jacobian(self) -> Traced:
        assert self.traced_finish is not None
        sums = [f"sum{k}" for k in range(len(self.traced.program.outputs))]
        return self.traced_finish.jacobian(*sums, *vector_names("x"), *vector_names("v"))

    def _inputs_of(self, name: str) -> tuple[str, ...]:
        return (f"{name}1", f"{name}2") if name in self.per_particle else (name,)

    def _signature(self) -> dict[str, str]:
        state = {name: "vector" if name[0] in "xv" else "scalar" for name in STATE}
        return state | {n: "scalar" for p in self.parameters for n in self._inputs_of(p)}

    def _paired(self, law: Callable[..., Any]) -> Callable[..., Any]:
        """The law, called with one number for each input: those of each particle are put together as (p1, p2)."""
        wanted = _names(law)

        def call(*arguments: Any) -> Any:
            rest = iter(arguments[len(STATE) :])
            own = {p: tuple(next(rest) for _ in self._inputs_of(p)) for p in self.parameters}
            named = {n: value if n in self.per_particle else value[0] for n, value in own.items() if n in wanted}
            return law(*arguments[: len(STATE)], **named)

        return call

    def _pairs(self, particles: Particles, x: Array) -> Iterator[tuple[Rows, Rows]]:
        """Ordered pairs of places in `ends`, block by block: i of shape (k, 1) with all j (1, n), or (k,) each."""
        reach = self.reach(particles)
        rows, others = self.ends(particles)
        if reach is None:
            size = max(1, PAIRS_AT_ONCE // max(1, len(others)))
            for start in range(0, len(rows), size):
                yield np.arange(start, min(start + size, len(rows)))[:, None], np.arange(len(others))[None, :]
        elif reach > 0:
            i, j = pairs_within(x[rows], reach, self.box, None if self.by is None else x[others])
            for start in range(0, len(i), PAIRS_AT_ONCE):
                yield i[start : start + PAIRS_AT_ONCE], j[start : start + PAIRS_AT_ONCE]

    def _values(
        self, law: Traced, particles: Particles, t: Any, x: Array, v: Array, first: Rows, second: Rows
    ) -> list[Array]:
        """Outputs of a law for pairs of rows, two arrays that are broadcast; 0 where both are the same row."""
        shape = np.broadcast_shapes(first.shape, second.shape)
        place = {"1": x[first], "2": nearest(x[first], x[second], self.box)}
        columns: dict[str, Any] = {}
        for node, rows in (("2", second), ("1", first)):
            now = clock(t, rows)
            columns |= {"t": now, f"m{node}": particles.m[rows]}  # t, and what all share, are those of particle 1
            for name, (value,) in self.settings(particles, now, rows).items():
                columns[f"{name}{node}" if name in self.per_particle else name] = value
            for q, array in (("x", place[node]), ("v", v[rows])):
                columns |= {n: array[..., axis] for axis, n in enumerate(vector_names(f"{q}{node}"))}
        outputs = law.columns(*inputs_for(law, {}, columns, {}))
        itself = first == second
        return [np.where(itself, x.dtype.type(0), np.broadcast_to(o, shape)) for o in outputs]

    def _finished(
        self, law: Traced, particles: Particles, t: Any, x: Array, v: Array, rows: Rows, sums: Array
    ) -> Array:
        """Outputs of a program of the sums, shape (len(rows), outputs)."""
        now = clock(t, rows)
        scalars = {"m": particles.m[rows], "t": now} | {f"sum{k}": column for k, column in enumerate(sums.T)}
        inputs = inputs_for(law, {"x": x[rows], "v": v[rows]}, scalars, self.settings(particles, now, rows))
        return matrix(law.columns(*inputs), len(rows), x.dtype)


@overload
def pair_force(law: Callable[..., Any], /) -> type[PairForce]: ...
@overload
def pair_force(
    *,
    cutoff: float | None = None,
    per_particle: Sequence[str] = (),
    finish: Callable[..., Any] | None = None,
    potential: Callable[..., Any] | None = None,
) -> Callable[[Callable[..., Any]], type[PairForce]]: ...
def pair_force(
    law: Callable[..., Any] | None = None,
    /,
    *,
    cutoff: float | None = None,
    per_particle: Sequence[str] = (),
    finish: Callable[..., Any] | None = None,
    potential: Callable[..., Any] | None = None,
) -> Any:
    """Make a force between all particles, or those within a cut-off, from a law of two.

    Parameters
    ----------
    law : `law(x1, v1, m1, x2, v2, m2, t, *parameters) -> fx, fy, fz`, what particle 2 does to particle 1 [N]; it is
        called once, on symbols. Every particle adds up what all others do to it.
    cutoff : the law acts within this distance only [m]; None = at all distances. A law that has a parameter `cutoff`
        reads it.
    per_particle : parameters that each particle has its own of (a column, the name of a particle attribute); the law
        gets them as pairs (p1, p2).
    finish : `finish(sums, x, v, m, t, *parameters) -> fx, fy, fz`: the law then returns any numbers, they are summed
        over all others, and this makes the force of the sums.
    potential : energy of a pair [J], of the arguments of the law.

    Returns
    -------
    type
        A class of forces; its constructor takes the law's parameters by name, `cutoff`, `box` (sides of a periodic
        box), `on`, `by` (particles that act on those of `on`; None = those of `on`) and `enabled`.

    Examples
    --------
    >>> @pm.pair_force(per_particle=["charge"])
    ... def coulomb(x1, v1, m1, x2, v2, m2, t, k=1.0, charge="charge"):
    ...     d = x1 - x2
    ...     return k * charge[0] * charge[1] * pm.inverse(pm.length(d) ** 3) * d
    >>> system = pm.ParticleSystem(particles, forces=[coulomb(k=2.0)])
    """
    if law is None:
        return lambda function: _class_of(function, cutoff, tuple(per_particle), finish, potential)
    return _class_of(law, cutoff, tuple(per_particle), finish, potential)


def _class_of(
    law: Callable[..., Any],
    cutoff: float | None,
    per_particle: tuple[str, ...],
    finish: Callable[..., Any] | None,
    potential: Callable[..., Any] | None,
) -> type[PairForce]:
    own = law_parameters(law, STATE)
    if "cutoff" in own:
        inside = own.pop("cutoff")
        cutoff = inside if cutoff is None and inside is not inspect.Parameter.empty else cutoff
    more = [] if finish is None else [*law_parameters(finish, ("sums", "x", "v", "m", "t"))]
    more += [] if potential is None else [*law_parameters(potential, STATE)]
    for name in [*more, *per_particle]:
        if name not in own and name != "cutoff":
            raise InvalidInput(f"law {law_name(law)!r} has no parameter {name!r}: its parameters are {', '.join(own)}")

    def __init__(
        self: Any,
        *,
        cutoff: float | None = cutoff,
        box: Box | None = None,
        on: Selection = None,
        by: Selection = None,
        enabled: bool = True,
        **given: Any,
    ) -> None:
        parameters = parameters_from(law, own, given)
        if cutoff is not None:
            parameters.append(cut_off(cutoff))
        elif "cutoff" in _names(law):
            raise InvalidInput(f"law {law_name(law)!r} needs a cutoff [m]")
        PairForce.__init__(self, parameters, on, enabled, box, by)

    body = {"__init__": __init__, "law": staticmethod(law), "per_particle": per_particle, "internal": False}
    body |= {n: staticmethod(f) for n, f in (("finish", finish), ("potential", potential)) if f is not None}
    return type(law_name(law), (PairForce,), {**body, **origin(law)})


def cut_off(value: float) -> Parameter:
    """The parameter that makes a law act within a distance only."""
    return Parameter("cutoff", value, unit="m", above=0)


def _names(function: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(function).parameters)


def _both(i: Rows, j: Rows) -> tuple[Rows, Rows]:
    """Two arrays of rows, broadcast against each other."""
    i, j = np.broadcast_arrays(i, j)
    return i, j
