"""Springs that break, and surfaces that tear."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.collisions.collider import lengths
from pointmass.constraints.constraint import Constraint, Step
from pointmass.constraints.families import Families, families_of, of_families
from pointmass.constraints.surgery import Ids, cut, snapped, star
from pointmass.errors import InvalidInput, number, shown, whole_number
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.particles import Array, Particles
from pointmass.system import ParticleSystem

Mask = NDArray[np.bool_]


class Tear(Constraint):
    """Springs break that are stretched too far, and a cloth rips along its edges.

    After each step the springs whose strain is above their strength are looked at, those that are worst off first. One
    off all surfaces, as in a net, is taken away for good. One along an edge of a surface tears the surface at one of
    its ends: all triangles on the far side of a cut across the spring get a vertex of their own, and with them their
    part of its mass and the springs that belong to them. Springs on the cut become two with a part of the stiffness
    each; those across it, such as diagonals, springs over two steps and hinges, are gone. So no triangle is lost, the
    rip opens between triangles, and mass, momentum and, where nothing spans the cut, energy are what they were.

    The end that is cut is one at a border if there is one, so that rips grow at their tips, and else the one that is
    pulled more; never one that is pinned. What is freshly torn cannot tear again before it has slackened.

    Parameters
    ----------
    strain : at which a spring breaks, greater than 0: 0.3 is three tenths of its rest.
    families : of springs, a name or a list of them, such as "stretch"; None = all that are edges of triangles or off
        all surfaces. Others on a surface break with what they span, and not by themselves.
    on : name of the body or group in which springs break; None = all.
    spread : how uneven the strengths are, from 0 to 1: each is strain (1 +- spread).
    most : how many break in one step, at least 1. They come one by one, so that a rip runs instead of all shattering
        at once; at a step dt it runs no faster than most edges / dt.
    seed : another one gives other strengths.

    Attributes
    ----------
    breaks : how many have broken so far.

    Notes
    -----
    The cut across the most stretched edge is that of Müller, Heidelberger, Hennix and Ratcliff, Position Based
    Dynamics, J. Vis. Commun. Image R. 18 (2007), section 4.5. Stiffness and mass are shared out here, so that a cut by
    itself moves nothing; the parts of a vertex are lighter than it was, and an explicit step needs some room.

    Examples
    --------
    >>> sheet = pm.cloth(40, 40, pinned="top edge")
    >>> system = pm.ParticleSystem(sheet.particles, [pm.Gravity((0, -300, 0)), *sheet.forces])
    >>> sim = pm.Simulation(system, dt=1 / 5000, constraints=[pm.Tear(0.3, "stretch", spread=0.1)])
    """

    breaks_up = True

    def __init__(
        self,
        strain: float = 0.3,
        families: Families | None = None,
        on: str | None = None,
        *,
        spread: float = 0.0,
        most: int = 2,
        seed: int = 0,
    ) -> None:
        self.strain = number("strain", strain, above=0)
        self.families = families_of(families)
        if on is not None and not isinstance(on, str):
            raise InvalidInput(f"on = {shown(on)} is not allowed: it must be the name of a body or group")
        self.on = on
        self.spread = number("spread", spread, at_least=0, at_most=1)
        self.most = whole_number("most", most, at_least=1)
        self.seed = whole_number("seed", seed, at_least=0)
        self.breaks = 0
        self._springs: list[ConstraintForce] = []
        self._strengths: dict[ConstraintForce, tuple[NDArray[np.intp], Array]] = {}  # for the rows of the springs
        self._fresh = np.zeros(0, np.int64)  # ids of vertices that were torn and are still tight

    def bind(self, system: ParticleSystem) -> None:
        p = system.particles
        p.select(self.on)
        self._springs = of_families(system, self.families)
        if not any(np.isfinite(self._strength(force, p)).any() for force in self._springs):
            raise InvalidInput(
                f"families = {shown(self.families)} has no spring that could break: on a surface, those break that are "
                "edges of its triangles, such as 'stretch'"
            )
        for force in system.forces:
            if isinstance(force, ElementForce):
                for name in force.divided if p.surfaces else ():
                    force.parameters[name].each(len(force.ids), f"{force.name} of what may tear")
            elif any(isinstance(c.value, np.ndarray) for q in force.parameters.values() for c in q.components):
                raise InvalidInput(
                    f"{force.called} has a number for each particle, and there are more when something tears: make it "
                    "an attribute of the particles and give its name"
                )

    def state(self) -> dict[str, NDArray[Any]]:
        return {"breaks": np.array([self.breaks]), "fresh": self._fresh}

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        self.breaks, self._fresh = int(state["breaks"][0]), np.array(state["fresh"], np.int64)

    def enforce(self, system: ParticleSystem, step: Step) -> None:
        p = system.particles
        springs = [force for force in self._springs if force.enabled and len(force.ids)]
        loads = [self._load(force, p, step.t1) for force in springs]
        load = np.concatenate([np.zeros(0), *loads])
        if not (load > 1).any():
            self._fresh = self._fresh[:0]
            return
        pairs = np.concatenate([force.ids for force in springs])
        whose = np.repeat(np.arange(len(springs)), [len(each) for each in loads])
        self._fresh = np.intersect1d(self._fresh, pairs[load > 1])
        broken = np.flatnonzero((load > 1) & ~np.isin(pairs, self._fresh).any(axis=1))
        torn, count = self._fresh, 0
        for one in broken[np.argsort(-load[broken], kind="stable")]:
            if np.isin(pairs[one], torn).any():
                continue  # the last break has changed what pulls here
            found = self._break(system, springs[whose[one]], pairs[one], pairs, load)
            torn, count = np.append(torn, found), count + (len(found) > 0)
            if count == self.most:
                break
        self.breaks += count
        self._fresh = np.unique(torn)

    def _load(self, force: ConstraintForce, p: Particles, t: float) -> Array:
        """Strain of each spring in units of its strength, shape (e,)."""
        ends = p.x[force.rows(p)].astype(np.float64)
        rest = force.rests(p, t).astype(np.float64)
        long = rest > 0
        strain = lengths(ends[:, 0] - ends[:, 1]) / np.where(long, rest, 1) - 1
        return np.asarray(np.where(long, strain, 0) / self._strength(force, p))

    def _strength(self, force: ConstraintForce, p: Particles) -> Array:
        """The strain at which each spring breaks, shape (e,); inf for those that do not by themselves."""
        rows = force.rows(p)
        known = self._strengths.get(force)
        if known is None or known[0] is not rows:
            low, high = np.sort(force.ids, axis=1).T
            draw = random.spread(self.seed, "tear", low, "strength", 0.0, 0.5)
            draw += random.spread(self.seed, "tear", high, "strength of the other end", 0.0, 0.5)
            strength = self.strain * (1 + self.spread * draw)
            mine = np.zeros(len(p), bool)
            mine[p.select(self.on)] = True
            known = rows, np.where(_breaks(p, rows) & mine[rows].all(axis=1), strength, np.inf)
            self._strengths[force] = known
        return known[1]

    def _break(self, system: ParticleSystem, force: ConstraintForce, pair: Ids, pairs: Ids, load: Array) -> Ids:
        """Break a spring; returns ids of the vertices that are torn apart, or of its ends; none if it cannot be."""
        p = system.particles
        rows = p.rows(pair)
        if not _edges(p, rows[None]).any():
            snapped(force, pair)
            p.version += 1
            return pair
        direction = (p.x[rows[1]] - p.x[rows[0]]).astype(np.float64)
        ends = [int(end) for end, pinned in zip(pair, p.pinned[rows], strict=True) if not pinned]
        pull = {end: float(np.maximum(load, 0)[(pairs == end).any(axis=1)].sum()) for end in ends}
        for end in sorted(ends, key=lambda end: (not star(p, end).open, -pull[end], end)):
            found = cut(system, end, direction)
            if len(found):
                return found
        return np.zeros(0, np.int64)


def _breaks(p: Particles, rows: NDArray[np.intp]) -> Mask:
    """Which springs break by themselves: edges of triangles, and those that are not within one surface; shape (e,)."""
    surface = np.full(len(p), -1)
    for k, name in enumerate(p.surfaces):
        surface[p.corners(name)] = k
    first, second = surface[rows].T
    return np.asarray(_edges(p, rows) | (first != second) | (first < 0))


def _edges(p: Particles, rows: NDArray[np.intp]) -> Mask:
    """Which pairs are edges of triangles, shape (e,)."""
    corners = np.concatenate([np.zeros((0, 3), np.intp), *(p.corners(name) for name in p.surfaces)])
    sides = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    pairs = np.sort(rows, axis=1)
    return np.isin(pairs @ [len(p), 1], sides @ [len(p), 1])
