"""The engine of a run: compiled kernels where there are some for what the system is made of, else the reference path.

Particles are grouped by the structure of their islands, and each group has the kernel of its layout. A kernel never
raises: where one says that something went wrong, the state is what it was before the span, and the caller goes through
it again on the reference path, which names what it was.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.impacts import NO_IMPACTS, Impacts
from pointmass.engine.binding import kinds
from pointmass.engine.dealt import fits
from pointmass.engine.energy import PairEnergy
from pointmass.engine.island import IslandKernel, Outcome, Span, everybody
from pointmass.engine.lanes import LanesKernel, topologies
from pointmass.engine.lattice import LatticeKernel, grid
from pointmass.engine.pairs import has_slopes
from pointmass.engine.phases import simple
from pointmass.engine.reference import ReferenceEngine
from pointmass.engine.singles import SingleMembers, SinglesKernel
from pointmass.engine.threads import LINE, heed_environment, spread
from pointmass.errors import Diverged, InvalidInput
from pointmass.laws import stencils
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.laws.force import Force
from pointmass.laws.pairs import PairForce
from pointmass.laws.stencils import Grid
from pointmass.laws.unary import UnaryForce
from pointmass.motions import NO_MOTIONS, Motions, stage_of
from pointmass.particles import Array
from pointmass.solvers.advance import Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.solvers.control import control_of
from pointmass.solvers.explicit import ExplicitRungeKutta
from pointmass.solvers.implicit import Implicit
from pointmass.solvers.splitting import Splitting
from pointmass.solvers.xpbd import XPBD
from pointmass.system import ParticleSystem

Rows = NDArray[np.intp]
GRAIN = 2**16  # rows that are worth a thread
SMALLEST_GRID = 64  # particles of an island that may be a grid
DEALT = 1024  # particles of a grid that is worth all threads where they need no turns
LARGE = 4096  # particles of an island that is worth all threads
MANY = 2000  # particles whose pairs take long in NumPy
LARGE_IN_PAIRS = 512  # the same, where pairs of them act
WORK = 1e9  # particle-steps between two returns to Python: so long Ctrl-C waits
LONGEST = 256  # steps of a span
ROOM = 16  # of that part of the present particles are births expected, when room is made


class Members(Protocol):
    """The particles of a group, with what their kernel needs to know of them."""

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, flat, and what the solver remembers, in place."""


@dataclass(frozen=True, eq=False)
class Group:
    """Particles that one kernel advances.

    Attributes
    ----------
    rows : of the particles, island by island, a slice where they follow each other; None = all, in order.
    """

    rows: Rows | slice | None
    members: Members


@dataclass(eq=False)
class Engine:
    """Advances a system over spans of steps.

    Attributes
    ----------
    wanted : whether kernels are wanted.
    reference : the engine that does everything, in NumPy.
    fastest, farthest : largest |v| [m/s] and |x| [m] of any component after the last span.
    died : rows of the particles that a surface killed in the last span, ascending; they are to be taken away.
    watched : whether steps made `ahead` tell of impacts.
    lasting : whether who is joined to whom stays so, so that kernels for it are worth their time.
    motions : of pinned particles.
    impacts : of the last such step.
    """

    system: ParticleSystem
    solver: Solver
    wanted: bool
    watched: bool = False
    lasting: bool = True
    motions: Motions = NO_MOTIONS
    reference: ReferenceEngine = field(init=False)
    fastest: float = 0.0
    farthest: float = 0.0
    died: Rows = field(default_factory=lambda: np.zeros(0, np.intp))
    impacts: Impacts = NO_IMPACTS
    _hit: Rows = field(default_factory=lambda: np.zeros(0, np.intp))  # who has hit a surface in the last span
    _before: tuple[Array, Array] | None = None
    _space: Array = field(default_factory=lambda: np.empty((2, 0, 3)))  # that `_before` is in
    _looked: bool = False  # whether the last step can no longer be looked into
    _last: Any = None  # span, births and ids, and what the reference path knew before it
    _kernels: tuple[Any, dict[Any, Any]] = (None, {})
    _groups: tuple[Any, list[Group]] = (None, [])
    _energies: dict[Force, tuple[Any, PairEnergy]] = field(default_factory=dict)
    _structure: Rows | None = None  # islands that the groups are made of

    def __post_init__(self) -> None:
        if self.wanted:
            heed_environment()
        self.reference = ReferenceEngine(self.system, self.solver, watched=self.watched, motions=self.motions)

    @property
    def stats(self) -> Stats:
        """Work done so far."""
        return self.reference.stats

    @property
    def compiled(self) -> bool:
        """Whether kernels exist for all that the system is made of now."""
        # A solver that does not fit says so itself.
        fits = self.system.order == 2 or not isinstance(self.solver, (Splitting, XPBD))
        return self.wanted and fits and len(self.system.particles) > 0 and not self.missing()

    def missing(self) -> list[str]:
        """What of the system has no kernel, and what would have: a sentence each."""
        found = []
        for force in self.system.forces:
            if (
                isinstance(force, PairForce)
                and isinstance(self.solver, Implicit)
                and not has_slopes(force, self.system)
            ):
                found.append(f"pairs such as {force.called} have no kernel under {self.solver.name}: use leapfrog")
            elif not isinstance(force, (UnaryForce, ElementForce, PairForce)):
                found.append(
                    f"{force.called} is a NumPy function: use a law, such as pm.unary_force or pm.spring_force"
                )
        if not _has_step(self.solver):
            found.append(f"{self.solver.name} has no kernel: use a solver of pointmass")
        return found

    def start(self) -> Array:
        """dy/dt now, where it may be without pairs of many particles: those take long in NumPy.

        Raises
        ------
        InvalidInput
            A parameter that is a function of time is not allowed now.
        """
        system, p = self.system, self.system.particles
        many = [f for f in self._pairs_of_many() if f.enabled]
        for force in many:
            force.settings(p, system.t, p.select(force.on))
        try:
            for force in many:
                force.enabled = False
            with np.errstate(all="ignore"):
                return system.deriv_eval()
        finally:
            for force in many:
                force.enabled = True

    def pair_energies(self) -> dict[Force, float]:
        """Potential energies of the pairs of many particles [J], by kernels."""
        system = self.system
        found: dict[Force, float] = {}
        for force in self._pairs_of_many():
            if force.enabled and force.traced_potential is not None:
                key = (system.particles.version, kinds([force]))
                if force not in self._energies or self._energies[force][0] != key:
                    self._energies[force] = key, PairEnergy(force, system.particles)
                found[force] = self._energies[force][1](system.t)
        return found

    def _pairs_of_many(self) -> list[PairForce]:
        p = self.system.particles
        pairs = [f for f in self.system.forces if isinstance(f, PairForce)] if self.compiled else []
        return [force for force in pairs if max(map(len, force.ends(p))) > MANY]

    def longest(self) -> int:
        """How many steps a span may have."""
        if any("age" in p.attributes for force in self.system.forces for p in force.parameters.values()):
            return 1  # ages grow between spans
        return int(np.clip(WORK / max(1, len(self.system.particles)), 1, LONGEST))

    def prepare(self) -> None:
        """Compile what the system needs, and change nothing.

        Kernels are shared by all systems of the same make, so another thread may prepare a copy of a system while this
        one runs.
        """
        p, memory = self.system.particles, self.reference.recall()
        nothing = Span(self.system.t, 1.0, 0, 0)
        for group in self._grouped(None) if self.compiled else []:
            x, v = (_taken(array, group.rows).copy() for array in (p.x, p.v))
            group.members.run(x, v, None, nothing, memory)

    def of(self, system: ParticleSystem, solver: Solver) -> Engine:
        """An engine for another system or solver, with nothing done yet."""
        motions = replace(self.motions, stage=stage_of(solver))
        return Engine(system, solver, self.wanted, watched=self.watched, lasting=self.lasting, motions=motions)

    @property
    def coupled(self) -> bool:
        """Whether particles act on each other, or will once there are some: births and deaths then end a span."""
        islands = self.system.island_of_particle
        return self._pairs or (len(islands) > 0 and not _apart(islands))

    @property
    def deadly(self) -> bool:
        """Whether a surface kills."""
        return any(collider.response == "kill" for collider in self.system.colliders)

    def run(self, span: Span, births: Array | None, look_inside: bool) -> bool:
        """Take the system over a span by its kernels; False if something went wrong: then `restore` it.

        Parameters
        ----------
        births : clock at which each particle begins [s], shape (n,); None = all at the start of the span.
        look_inside : whether `state_at` will be asked for a time within the last step.
        """
        p = self.system.particles
        self.died, self._hit = self.died[:0], self._hit[:0]
        self._last = span, births, p.id, self.reference.left()
        before = self._room()
        groups = [] if look_inside else self._grouped(births)
        kernels = [g.members for g in groups if g.rows is None]
        if len(kernels) == 1 and isinstance(kernels[0], SingleMembers):
            kernels[0].before = before  # in one go with the steps
        else:
            self._keep()
        self._looked = not look_inside
        if look_inside and span.count > 1:
            whole = self._launch(replace(span, count=span.count - 1), births)
            return whole and self._seen(replace(span, first=span.first + span.count - 1, count=1), births)
        return self._seen(span, births) if look_inside else self._launch(span, births, groups)

    def _seen(self, span: Span, births: Array | None) -> bool:
        """Make one step, and make it again on the reference path for all that a look inside it asks for."""
        system = self.system
        before, earlier = system.get_state(), self.reference.memory
        if not self._launch(span, births):
            return False
        after, memory, stats = system.get_state(), self.reference.memory, self.stats
        system.set_state(before, span.start)
        self.reference.memory = earlier
        self.reference.step(span.start, span.end, None if births is None else np.maximum(births, span.start))
        system.set_state(after, span.end)
        self._lead(span.end)
        self.reference.stats = stats
        self.reference.remember(memory, Stats())  # also that nobody has moved anything by hand
        return True

    def _launch(self, span: Span, births: Array | None, groups: Sequence[Group] | None = None) -> bool:
        p = self.system.particles
        memory = self.reference.recall()
        outcomes = []
        for group in self._grouped(births) if groups is None else groups:
            x, v = _taken(p.x, group.rows), _taken(p.v, group.rows)
            clock = births if births is None or group.rows is None else births[group.rows]
            try:
                outcome = group.members.run(x, v, clock, span, memory)
                while outcome.again:
                    x, v = self._again(group)
                    outcome = group.members.run(x, v, clock, span, memory)
            except InvalidInput:
                if not self.motions:
                    raise
                return False  # a motion is not finite in one of the steps: the reference path says in which
            outcomes.append(outcome)
            if not outcome.good:
                return False
            if isinstance(group.rows, np.ndarray):
                p.x[group.rows], p.v[group.rows] = x.reshape(-1, 3), v.reshape(-1, 3)
        self.farthest, self.fastest = np.max([o.reach for o in outcomes], axis=0).tolist()
        self.died = np.unique(np.concatenate([self.died, *(o.died for o in outcomes)]))
        self._hit = np.unique(np.concatenate([self._hit, *(o.hit for o in outcomes)]))
        works = [o.stats for o in outcomes]
        work = sum(works, Stats())
        work.steps, work.evaluations = max(w.steps for w in works), max(w.evaluations for w in works)
        self.system.t = span.end
        self._lead(span.end)
        self.reference.remember(memory, work)
        return True

    def _lead(self, t: float) -> None:
        """Put pins that move where they are at time t."""
        p = self.system.particles
        self.motions.put(p, p.x, p.v, t)

    def _room(self) -> tuple[Array, Array]:
        """Room for the positions and velocities before a span."""
        p = self.system.particles
        n = len(p)
        if self._space.shape[1] < n or self._space.dtype != p.dtype:
            self._space = _lines(n + n // ROOM, p.dtype)  # so that births seldom need more
        self._before = self._space[0, :n], self._space[1, :n]
        return self._before

    def _keep(self) -> None:
        """Keep positions and velocities as they are before a span."""
        p = self.system.particles
        for kept, array in zip(self._room(), (p.x, p.v), strict=True):
            _copied(kept, array)

    def _again(self, group: Group) -> tuple[Array, Array]:
        """Positions and velocities of a group as they were before the span."""
        assert self._before is not None
        p = self.system.particles
        rows = slice(None) if group.rows is None else group.rows
        p.x[rows], p.v[rows] = self._before[0][rows], self._before[1][rows]
        return _taken(p.x, group.rows), _taken(p.v, group.rows)

    @contextmanager
    def rehearsal(self) -> Iterator[None]:
        """What happens inside leaves no trace: who is there, state, clock and the solver's memory are put back."""
        system, p, left = self.system, self.system.particles, self.reference.left()
        x, v, t = p.x.copy(), p.v.copy(), system.t
        try:
            yield
        finally:
            if len(p) > len(x):
                system.remove(np.arange(len(x), len(p)))
            p.x[:], p.v[:], system.t = x, v, t
            self.reference.leave(left)

    def alone(self, rows: Rows) -> NDArray[np.bool_]:
        """Which of some particles nobody acts on."""
        islands = self.system.island_of_particle
        result: NDArray[np.bool_] = np.bincount(islands)[islands[rows]] == 1
        return result

    def ahead(self, rows: Rows, step: Span, births: Array, compiled: bool) -> None:
        """Take some particles over one step; all of them, if some are joined to each other. For a `rehearsal`.

        `died` and `impacts` tell then what became of them.

        Parameters
        ----------
        births : clock at which each particle begins [s], shape (n,).
        compiled : whether by kernels.

        Raises
        ------
        Diverged
            Something goes wrong on the way.
        """
        self.died, self._hit = self.died[:0], self._hit[:0]
        apart = bool(self.alone(rows).all())
        if not compiled:
            waits = np.full(len(births), apart)
            waits[rows] = False
            self.reference.step(step.start, step.end, np.where(waits, step.end, births))
            self.died, self.impacts = self.reference.died, self.reference.impacts
            return
        if apart:
            kind, how = (SinglesKernel, True) if _by_lanes(self.solver) else (IslandKernel, False)
            groups = [self._made(kind, rows, self.system.island_of_particle, how)]
        else:
            groups = self._grouped(births)
        self._keep()
        left = self.reference.left()
        if not self._launch(step, births, groups):
            raise Diverged("a particle that others follow goes astray")
        self.impacts = self._impacts_of(self._hit, step, births, left) if self.watched else NO_IMPACTS

    def _impacts_of(self, rows: Rows, step: Span, births: Array, left: Any) -> Impacts:
        """What happened to those who have hit something in a step: it is made again for them on the reference path."""
        if not len(rows):
            return NO_IMPACTS
        assert self._before is not None
        islands = self.system.island_of_particle
        rows = np.flatnonzero(np.isin(islands, islands[rows])) if self.coupled else np.sort(rows)
        part = self.system.part(rows)
        part.particles.x[:], part.particles.v[:] = self._before[0][rows], self._before[1][rows]
        again = ReferenceEngine(part, self.solver, watched=True, motions=self.motions)
        again.leave(left)
        again.step(step.start, step.end, births[rows])
        return replace(again.impacts, rows=rows[again.impacts.rows])

    def state_at(self, t: float) -> Array:
        """State of the present particles at a time within the last step, shape (dim,); nothing is changed.

        Raises
        ------
        InvalidInput
            The last step was not made for a look inside, and cannot be made again: something has changed since.
        """
        if self._looked and t < self.system.t and not self._again_for_a_look():
            raise InvalidInput(f"t = {t} s is within a step after which something was changed: use frames()")
        return self.reference.state_at(t)

    def _again_for_a_look(self) -> bool:
        """Make the last span once more, so that its last step can be looked into; False if that leads elsewhere now."""
        p = self.system.particles
        span, births, ids, earlier = self._last
        if ids is not p.id:
            return False
        now, left = (p.x.copy(), p.v.copy()), self.reference.left()
        assert self._before is not None
        p.x[:], p.v[:] = self._before
        self.system.t = span.start
        self.reference.leave(earlier)
        same = self.run(span, births, look_inside=True) and np.array_equal(p.x, now[0]) and np.array_equal(p.v, now[1])
        p.x[:], p.v[:] = now
        self.system.t = span.end
        self.reference.leave(left)
        self._looked = not same
        return bool(same)

    def restore(self) -> None:
        """Put the state back that was there before the last `run`."""
        assert self._before is not None
        p = self.system.particles
        p.x[:], p.v[:] = self._before

    def step(self, span: Span, births: Array | None = None) -> None:
        """One step on the reference path: see `ReferenceEngine.step`."""
        p = self.system.particles
        self.reference.step(span.start, span.end, births)
        self.died = self.reference.died
        self._looked = False
        self.farthest = float(np.abs(p.x).max(initial=0.0))
        self.fastest = float(np.abs(p.v).max(initial=0.0))

    # ------------------------------------------------------------------------------------------------ groups

    def _grouped(self, births: Array | None) -> list[Group]:
        system = self.system
        islands = system.island_of_particle
        key = (system.particles.version, self._kinds(), births is None)
        if self._structure is not islands or self._groups[0] != key or births is not None:
            self._structure, self._groups = islands, (key, self._made_groups(islands, births is not None))
        return self._groups[1]

    def _made_groups(self, islands: Rows, births: bool) -> list[Group]:
        """Particles by the layout of their islands: lanes where there are many alike, rows of a grid, all threads on
        one that is large."""
        if _by_lanes(self.solver) and _apart(islands):
            return [Group(None, self._kernel(SinglesKernel, births).members(islands, islands))]
        size = np.bincount(islands)[islands]
        alone = (size == 1) & _by_lanes(self.solver)
        groups = [self._made(SinglesKernel, np.flatnonzero(alone), islands, births)] if alone.any() else []
        left = np.flatnonzero(~alone)
        left = left[np.argsort(islands[left], kind="stable")]
        if len(left) and self.lasting and not births:
            for rows, members in self._side_by_side(left, islands[left]):
                groups.append(self._group(rows, members))
                left = left[~np.isin(left, rows)]
        for found in self._relaxed_grids(left, islands[left]):
            kernel = IslandKernel(self.system, self.solver, True, self.watched, self.motions, found)
            groups.append(self._group(found.members, kernel.members(found.members, islands[found.members])))
            left = left[~np.isin(left, found.members)]
        large = size[left] >= (LARGE_IN_PAIRS if self._pairs else LARGE)
        for island in np.unique(islands[left[large]]):
            groups.append(self._made(IslandKernel, left[islands[left] == island], islands, True))
        if not large.all():
            groups.append(self._made(IslandKernel, left[~large], islands, False))
        return groups

    def _side_by_side(self, rows: Rows, labels: Rows) -> Iterator[tuple[Rows, Members]]:
        """Islands that have a vector layout, each with its particles in the order of its kernel."""
        system, solver = self.system, self.solver
        if not simple(system, solver):
            return
        single = np.ones(len(rows), bool)
        for topology in topologies(system, rows, labels):
            yield topology.rows.ravel(), LanesKernel(system, solver, topology, self.motions).members(topology)
            single &= ~np.isin(rows, topology.rows)
        names, counts = np.unique(labels[single], return_counts=True)
        for island in names[counts >= SMALLEST_GRID]:
            found = grid(system, rows[labels == island])
            if found is not None:
                yield found.members, LatticeKernel(system, solver, found, self.motions).members(found)

    def _relaxed_grids(self, rows: Rows, labels: Rows) -> Iterator[Grid]:
        """Islands that are grids, for a solver that relaxes their elements."""
        if isinstance(self.solver, XPBD) and self.lasting:
            forces = [f for f in self.system.forces if isinstance(f, ConstraintForce) and f.enabled]
            names, counts = np.unique(labels, return_counts=True)
            for island in names[counts >= DEALT]:
                found = stencils.grid(forces, self.system.particles, rows[labels == island])
                if found is not None and fits(found):
                    yield found

    @property
    def _pairs(self) -> bool:
        return any(isinstance(force, PairForce) and force.enabled for force in self.system.forces)

    def _made(self, kind: Any, rows: Rows, islands: Rows, *how: bool) -> Group:
        return self._group(rows, self._kernel(kind, *how).members(rows, islands[rows]))

    def _group(self, rows: Rows, members: Members) -> Group:
        if everybody(rows, len(self.system.particles)):
            return Group(None, members)
        in_order = len(rows) > 0 and bool((np.diff(rows) == 1).all())
        return Group(slice(int(rows[0]), int(rows[-1]) + 1) if in_order else rows, members)

    def _kernel(self, kind: Any, *how: bool) -> Any:
        """The kernel of a kind for the system as it is, printed once."""
        made_of = self._kinds()
        if self._kernels[0] != made_of:
            self._kernels = (made_of, {})
        known = self._kernels[1]
        if (kind, *how) not in known:
            more = {"motions": self.motions} if kind is IslandKernel else {}
            known[kind, *how] = kind(self.system, self.solver, *how, watched=self.watched, **more)
        return known[kind, *how]

    def _kinds(self) -> tuple[Any, ...]:
        """All that is compiled, and not data."""
        forces = self.system.forces
        return (
            kinds(forces),
            tuple((c, c.contact, c.response) for c in self.system.colliders),
            self.system.particles.has_pins,
            all(f.enabled for f in forces),
        )


def compiled_by_default() -> bool:
    """Whether runs are compiled if nobody says otherwise: $POINTMASS_ENGINE, "compiled" or "reference"."""
    named = os.environ.get("POINTMASS_ENGINE", "compiled")
    if named not in ("compiled", "reference"):
        raise InvalidInput(f"POINTMASS_ENGINE = {named!r} is not allowed: it must be 'compiled' or 'reference'")
    return named == "compiled"


def _taken(array: Array, rows: Rows | slice | None) -> Array:
    """Some rows of an array of shape (n, 3), flat: the array itself, or a part of it, if they follow each other."""
    return array.reshape(-1) if rows is None else array[rows].reshape(-1)


def _lines(rows: int, dtype: np.dtype[Any]) -> Array:
    """Room for two arrays of so many rows or some more, each from the beginning of a line of memory on."""
    rows = -(-rows // LINE) * LINE
    size = 2 * rows * 3 * dtype.itemsize
    space = np.empty(size + LINE, np.uint8)
    begin = -space.ctypes.data % LINE
    return space[begin : begin + size].view(dtype).reshape(2, rows, 3)


def _copied(target: Array, source: Array) -> None:
    """Copy rows by several threads."""

    def copy(lo: int, hi: int) -> None:
        target[lo:hi] = source[lo:hi]

    spread(copy, len(source), GRAIN)


def _apart(islands: Rows) -> bool:
    """Whether all particles are islands of their own, whose numbers are then the rows: first particles count them."""
    return int(islands[-1]) + 1 == len(islands)


def _has_step(solver: Solver) -> bool:
    return isinstance(solver, (ExplicitRungeKutta, Splitting, Implicit, XPBD))


def _by_lanes(solver: Solver) -> bool:
    """Whether all take the same steps, so that they can be taken side by side."""
    return _has_step(solver) and control_of(solver) is None and not solver.implicit
