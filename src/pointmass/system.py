"""The particle system: particles, forces, colliders, and the four verbs by which a solver knows them."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Collider
from pointmass.errors import InvalidInput, about
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.laws.force import Blocks, Force, block_matrix
from pointmass.laws.relaxation import colours, relax
from pointmass.particles import Array, Particles, Selection
from pointmass.solvers.base import Solver
from pointmass.solvers.registry import as_solver
from pointmass.stability import Stability, stability


class Filter(Protocol):
    """What stands between calculate and gather: resting contact takes away the load that a surface bears."""

    def forces(self, t: Any, x: Array, v: Array, m: Array, f: Array) -> None:
        """Change the accumulators `f` in place."""

    def projection(self, n: int) -> Array:
        """Directions in which contacts leave each particle free, shape (n, 3, 3)."""

    def drag(self, n: int) -> Array:
        """What friction adds to -df/dv in those directions [N s/m], shape (n,)."""


@dataclass(frozen=True)
class Energy:
    """Energies of a system [J]. `potential` leaves out forces that have none, which `without` names."""

    kinetic: float
    potential: float
    by_force: dict[str, float]
    without: tuple[str, ...]

    @property
    def total(self) -> float:
        """Kinetic plus potential [J]."""
        return self.kinetic + self.potential


class ParticleSystem:
    """Point masses, the forces on them, and what they bounce off.

    A solver sees `dim`, `get_state`, `set_state` and `deriv_eval`. The state is `y = [x.ravel(), v.ravel()]`, of length
    6n (the lecture's slide interleaves x1 v1 x2 v2 ...; the numbers are the same). A system whose forces are velocity
    fields (`Flow`, `Vortex`) has order 1: x' = g(x, t), y = x.ravel(), of length 3n.

    Parameters
    ----------
    particles : they belong to the system from now on.
    forces : add into the accumulators in this order.
    colliders : surfaces to bounce off.

    Raises
    ------
    InvalidInput
        Forces of order 1 and 2 together; a force that names particles, groups or attributes that are not there.

    Examples
    --------
    >>> ball = pm.Particles([[0, 1, 0]])
    >>> system = pm.ParticleSystem(ball, forces=[pm.Gravity()])
    >>> scipy.integrate.solve_ivp(system.deriv_eval, (0, 1), system.get_state())
    """

    def __init__(
        self,
        particles: Particles,
        forces: Iterable[Force] | Force = (),
        colliders: Iterable[Collider] | Collider = (),
    ) -> None:
        if not isinstance(particles, Particles):
            raise InvalidInput(f"particles must be Particles, such as a body's .particles, not {particles!r:.60}")
        self.particles = particles
        self.forces = [forces] if isinstance(forces, Force) else list(forces)
        self.colliders = [colliders] if isinstance(colliders, Collider) else list(colliders)
        self.filter: Filter | None = None
        self.t = 0.0
        self._islands: tuple[Any, NDArray[np.intp]] | None = None
        self._colours: tuple[list[Any], dict[Force, NDArray[np.intp]]] | None = None
        self._numbers = np.arange(0)  # 0, 1, 2, ...: the islands where nobody is linked
        for force in self.forces:
            if not isinstance(force, Force):
                raise InvalidInput(f"forces must be forces, such as pm.Gravity(), not {force!r}")
        for collider in self.colliders:
            if not isinstance(collider, Collider):
                raise InvalidInput(f"colliders must be colliders, such as pm.Plane(), not {collider!r}")
        self.order = self._common_order()
        for force in self.forces:
            with about(force.called):
                force.bind(particles)

    # ---------------------------------------------------------------------------------------- the four verbs

    @property
    def dim(self) -> int:
        """How many numbers the state has: 6n, or 3n for a flow."""
        return 3 * self.order * len(self.particles)

    def get_state(self) -> Array:
        """Gather the particles' state into one vector, shape (dim,)."""
        p = self.particles
        return np.concatenate([p.x.ravel(), p.v.ravel()]) if self.order == 2 else p.x.ravel().copy()

    def set_state(self, y: Array, t: float | None = None) -> None:
        """Scatter a state vector back to the particles, and set the clock."""
        self.particles.x[:], v = self.split(self._checked(y))
        if self.order == 2:
            self.particles.v[:] = np.where(self.particles.pinned[:, None], 0, v)
        if t is not None:
            self.t = float(t)

    def deriv_eval(self, t: Any = None, y: Array | None = None) -> Array:
        """dy/dt at time `t` and state `y` (by default the present ones), shape (dim,).

        It is a pure function of (t, y): the particles stay as they are, only their accumulators f are used. `t` may be
        an array of shape (dim,): islands with clocks of their own.
        """
        y = self.get_state() if y is None else self._checked(y)
        t = self._particle_time(self.t if t is None else t)
        x, v = self.split(y)
        self.clear_forces()
        self.calculate_forces(t, x, v)
        return self.gather(v)

    # ---------------------------------------------------------------------------------------- derivEval's three loops

    def clear_forces(self) -> None:
        """1. Loop over particles, zero the force accumulators."""
        self.particles.f[:] = 0

    def calculate_forces(self, t: Any = None, x: Array | None = None, v: Array | None = None) -> None:
        """2. Sum all forces into the accumulators, by default those of now; a surface bears what rests on it."""
        t = self.t if t is None else t
        x, v = self.particles.x if x is None else x, self.particles.v if v is None else v
        for force in self.forces:
            if force.enabled:
                force.add_forces(self.particles, t, x, v, self.particles.f)
        if self.filter is not None:
            self.filter.forces(t, x, v, self.particles.m, self.particles.f)

    def gather(self, v: Array | None = None) -> Array:
        """3. Loop over particles, copying v and f/m into the result. Pinned particles have v = 0 and 1/m = 0."""
        p = self.particles
        v = p.v if v is None else v
        if self.order == 1:
            return np.where(p.pinned[:, None], 0, p.f).ravel()
        free = ~p.pinned[:, None]
        acceleration = np.where(free, p.f * p.w[:, None], 0)
        return np.concatenate([np.where(free, v, 0).ravel(), acceleration.ravel()])

    # ---------------------------------------------------------------------------------------- more that solvers may ask

    def split(self, y: Array) -> tuple[Array, Array]:
        """Positions and velocities of a state vector, each of shape (n, 3)."""
        n = len(self.particles)
        x = y[: 3 * n].reshape(n, 3)
        return x, (y[3 * n :].reshape(n, 3) if self.order == 2 else np.zeros_like(x))

    @property
    def velocity_dependent(self) -> bool:
        """Whether accelerations depend on velocities."""
        return any(force.velocity_dependent for force in self.forces if force.enabled) or self.filter is not None

    @property
    def inertia(self) -> Array:
        """Mass of each velocity component [kg], shape (3n,); infinite for pinned particles."""
        p = self.particles
        return np.repeat(np.where(p.pinned, np.inf, p.m), 3)

    @property
    def islands(self) -> NDArray[np.intp]:
        """Island of each entry of the state, shape (dim,)."""
        return np.tile(np.repeat(self.island_of_particle, 3), self.order)

    @property
    def island_of_particle(self) -> NDArray[np.intp]:
        """Connected component of each particle in the graph of forces, shape (n,)."""
        key = (self.particles.version, tuple((id(f), f.enabled, len(getattr(f, "ids", ()))) for f in self.forces))
        if self._islands is None or self._islands[0] != key:
            self._islands = (key, self._components())
        return self._islands[1]

    def jacobian(self, t: Any, y: Array, share: Array | None = None) -> Any:
        """d(deriv_eval)/dy as a scipy.sparse CSR array of shape (dim, dim), exact, from the traced laws.

        Parameters
        ----------
        share : of what may make the matrix of an implicit step indefinite, that is counted (see `Springs.softened`),
            shape (dim,); None = all of it, the exact Jacobian.
        """
        from scipy.sparse import block_array, csr_array, diags_array

        p, n = self.particles, len(self.particles)
        x, v = self.split(self._checked(y))
        blocks = Blocks()
        for force in self.forces:
            if force.enabled and share is not None and isinstance(force, ElementForce):
                force.add_jacobian(p, self._particle_time(t), x, v, blocks, share[: 3 * n : 3])
            elif force.enabled:
                force.add_jacobian(p, self._particle_time(t), x, v, blocks)
        rows, columns, dx, dv = blocks.entries(n)
        if self.order == 1:
            return block_matrix(rows, columns, dx * ~p.pinned[rows][:, None, None], n)
        if self.filter is not None:
            project = self.filter.projection(n)
            dx, dv = (_times(_times(project[rows], d), project[columns]) for d in (dx, dv))
            dv[:n] -= self.filter.drag(n)[:, None, None] * project  # the first are those of the particles' own forces
        weight = p.w[rows][:, None, None]
        pull, damp = (block_matrix(rows, columns, weight * d, n) for d in (dx, dv))
        moves = diags_array(np.repeat(np.where(p.pinned, 0.0, 1.0), 3))
        return csr_array(block_array([[None, moves], [pull, damp]]))

    def external(self, t: Any, y: Array) -> Array:
        """dy/dt without the elements that `relaxed` stands for: springs, angles and the like."""
        with self.slack():
            return self.deriv_eval(t, y)

    @contextmanager
    def slack(self) -> Iterator[None]:
        """Inside, elements that `relaxed` stands for pull nobody."""
        elastic = self._elastic()
        for force in elastic:
            force.enabled = False
        try:
            yield
        finally:
            for force in elastic:
                force.enabled = True

    def relaxed(self, t: Any, h: Array, x: Array, rise: Array, sweeps: int) -> Array:
        """How far positions come in a step with elastic elements that are relaxed one by one.

        Parameters
        ----------
        t, h : end and length of the step [s], numbers or shape (dim,).
        x : positions at its start [m], shape (3n,).
        rise : how far they come without the elements [m], shape (3n,).
        sweeps : times that every element is looked at.
        """
        elastic, n = self._elastic(), len(self.particles)
        if not elastic or not n:
            return rise
        project = None if self.filter is None else self.filter.projection(n).astype(self.particles.dtype)
        length = np.broadcast_to(h, self.dim)[: 3 * n : 3]
        result = rise.reshape(n, 3).copy()
        now, orders = self._particle_time(t), [self.colours[force] for force in elastic]
        relax(elastic, orders, self.particles, now, length, x.reshape(n, 3), result, sweeps, project)
        return result.ravel()

    @property
    def colours(self) -> dict[Force, NDArray[np.intp]]:
        """Colours of the elements that `relaxed` goes through: one after the other, and all of one together."""
        elastic = [force for force in self.forces if isinstance(force, ConstraintForce)]
        made_of = [self.island_of_particle, *(force.rows(self.particles) for force in elastic)]
        known = [] if self._colours is None else self._colours[0]
        if self._colours is None or len(known) != len(made_of) or any(map(operator.is_not, known, made_of)):
            found = colours(elastic, self.particles, self.island_of_particle)
            self._colours = made_of, dict(zip(elastic, found, strict=True))
        return self._colours[1]

    # ---------------------------------------------------------------------------------------- what users ask

    def energy(self, known: Mapping[Force, float] | None = None) -> Energy:
        """Kinetic and potential energy now [J].

        Parameters
        ----------
        known : potential energies of forces that somebody else has computed [J].
        """
        p = self.particles
        speed2 = np.einsum("ij,ij->i", p.v.astype(np.float64), p.v.astype(np.float64))
        parts: dict[str, float] = {}
        without = []
        for force in self.forces:
            if known is not None and force in known:
                value: float | None = known[force]
            else:
                value = force.energy(p, self.t, p.x, p.v) if force.enabled else 0.0
            if value is None:
                without.append(force.name)
            else:
                parts[force.name] = parts.get(force.name, 0.0) + value
        with np.errstate(over="ignore"):
            kinetic = float(0.5 * np.sum(p.m[~p.pinned] * speed2[~p.pinned]))
        return Energy(kinetic, sum(parts.values()), parts, tuple(without))

    def momentum(self) -> Array:
        """Total momentum [kg m/s], shape (3,)."""
        return np.asarray(np.einsum("i,ij->j", self.particles.m, self.particles.v))

    def angular_momentum(self) -> Array:
        """Total angular momentum about the origin [kg m^2/s], shape (3,)."""
        p = self.particles
        return np.asarray(np.einsum("i,ij->j", p.m, np.cross(p.x, p.v)))

    def stretch(self) -> float:
        """Largest relative change of a spring's length; 0 without springs."""
        worst = 0.0
        for force in self.forces:
            if isinstance(force, ConstraintForce) and force.nodes == 2 and len(force.ids):
                rest = force.rests(self.particles, self.t)
                length = force.values(self.particles, self.particles.x)
                with np.errstate(over="ignore"):
                    relative = np.abs(length - rest)[rest > 0] / rest[rest > 0]
                worst = max(worst, float(relative.max(initial=0.0)))
        return worst

    def stability(self, solver: Solver | str) -> Stability:
        """How large a step of a solver may be, from the eigenvalues of the forces as they are now."""
        return stability(self, as_solver(solver))

    def add(self, x: Any, v: Any = None, **columns: Any) -> NDArray[np.int64]:
        """Add particles (see `Particles.add`); every force without a selection acts on them too. Returns their ids."""
        before = len(self.particles)
        ids = self.particles.add(x, v, **columns)
        for k, force in enumerate(self.forces):
            try:
                with about(force.called):
                    force.grow(self.particles, len(ids))
            except InvalidInput:
                old = np.arange(len(self.particles)) < before
                for grown in self.forces[:k]:
                    grown.keep(self.particles, old)
                self.particles.keep(old)
                raise
        return ids

    def divide(self, row: int, shares: Array) -> NDArray[np.int64]:
        """Make several particles of one, at its place and as fast; each has a share of its mass.

        They are in the groups where it is, and under the forces that act on it; who is joined to whom is another
        matter. Momentum and kinetic energy stay the same.

        Parameters
        ----------
        shares : one for each, that sum to 1; the first one is that of the particle itself.

        Returns
        -------
        NDArray
            Ids of the new ones, in the order of their shares.

        Raises
        ------
        InvalidInput
            A force has numbers for each particle, which a new one would lack.
        """
        p, count = self.particles, len(shares) - 1
        mass = p.m[row] * np.asarray(shares[1:], p.dtype)
        columns = {name: np.repeat(column[row], count) for name, column in p.attributes.items()}
        x, v, lifetime, radius = (np.repeat(a[row : row + 1], count, axis=0) for a in (p.x, p.v, p.lifetime, p.radius))
        ids = self.add(x, v, m=mass, radius=radius, lifetime=lifetime, **columns)
        p.m[row] -= mass.sum()
        p.age[-count:] = p.age[row]
        for marks in [*p.groups.values(), *(marks for force in self.forces for _, marks in force.marks())]:
            marks[-count:] = marks[row]
        if p.pinned[row]:
            p.pin(np.arange(len(p) - count, len(p)))
        p.version += 1
        return ids

    def remove(self, which: Selection) -> None:
        """Take particles away, and the springs that end at them."""
        mask = np.ones(len(self.particles), bool)
        mask[self.particles.select(which)] = False
        for force in self.forces:
            force.keep(self.particles, mask)
        self.particles.keep(mask)

    def fits(self, state: Mapping[str, NDArray[Any]]) -> bool:
        """Whether a state can be one of this system: the same columns and groups, who stays in the same order."""
        p, ids = self.particles, state["id"]
        stay = p.id[np.isin(p.id, ids)]
        alike = state.keys() == p.state().keys() and len(state["groups"]) == len(p.groups)
        return alike and np.array_equal(stay, ids[: len(stay)])

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Have the particles of a state that `fits`, see `Particles.state`: some go, and some are new."""
        p, ids = self.particles, state["id"]
        gone = ~np.isin(p.id, ids)
        if gone.any():
            self.remove(gone)
        old = len(p)
        if len(ids) > old:
            columns = {name: state[name][old:] for name in ("m", "radius", "lifetime", "id")}
            self.add(state["x"][old:], state["v"][old:], **columns)
        p.put_state(state)

    def part(self, rows: NDArray[np.intp]) -> ParticleSystem:
        """A system of some of the particles under the same laws; this one stays as it is."""
        mask = np.zeros(len(self.particles), bool)
        mask[rows] = True
        result = copy(self)
        result.particles, result.forces = self.particles.part(mask), [force.twin() for force in self.forces]
        result.filter = result._islands = result._colours = None
        for force in result.forces:
            force.keep(self.particles, mask)
        return result

    # ---------------------------------------------------------------------------------------- inside

    def _elastic(self) -> list[ConstraintForce]:
        """Forces whose elements can be relaxed one by one."""
        return [f for f in self.forces if f.enabled and isinstance(f, ConstraintForce)]

    def _common_order(self) -> int:
        orders = {force.order for force in self.forces}
        if len(orders) > 1:
            flows = [f.name for f in self.forces if f.order == 1]
            raise InvalidInput(
                f"{', '.join(flows)} is a velocity field (x' = g) and cannot be added to forces (m x'' = f): "
                "let particles be dragged along by it with Wind(velocity=...)"
            )
        return orders.pop() if orders else 2

    def _checked(self, y: Array) -> Array:
        y = np.asarray(y, self.particles.dtype)
        if y.shape != (self.dim,):
            raise InvalidInput(f"the state must have shape ({self.dim},), not {y.shape}")
        return y

    def _particle_time(self, t: Any) -> Any:
        return t[: 3 * len(self.particles) : 3] if isinstance(t, np.ndarray) and t.ndim else float(t)

    def _components(self) -> NDArray[np.intp]:
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = len(self.particles)
        links = _stack([f.links(self.particles) for f in self.forces if f.enabled])
        if not len(links):
            if len(self._numbers) < n:
                self._numbers = np.arange(2 * n)
            return self._numbers[:n]
        graph = coo_array((np.ones(len(links), np.int8), (links[:, 0], links[:, 1])), shape=(n, n))
        _, label = connected_components(graph, directed=False)
        _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[inverse]  # numbered by their first particle


def _stack(parts: Sequence[NDArray[np.intp]]) -> NDArray[np.intp]:
    return np.concatenate(parts) if parts else np.zeros((0, 2), np.intp)


def _times(a: Array, b: Array) -> Array:
    """Products of 3x3 matrices, shape (k, 3, 3), added up from left to right as compiled kernels do."""
    first, second, third = (a[:, :, k, None] * b[:, k, None, :] for k in range(3))
    return first + second + third
