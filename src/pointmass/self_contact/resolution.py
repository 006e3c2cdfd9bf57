"""Keeps surfaces from passing through themselves in a step: contacts, then collisions, then whole zones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.threads import spread
from pointmass.particles import Array
from pointmass.self_contact.pairs import GRAIN, Mesh, Pairs, Rows, find

REACH = 1.5  # thicknesses within which a contact is foreseen
MARGIN = 1.0  # thicknesses by which points may move until pairs are looked for again
RISE = 0.1  # of what two surfaces are too near: by how much they part in a step (Bridson et al. 2002, section 7.2)
RISE_TIME = 1 / 24  # [s]; and in a time: short steps would fling them apart
APART = 1e-2  # thicknesses that are left between two that met
TOUCHING = 1e-6  # thicknesses; who starts as near as this, as the two sides of a fresh tear do, is not judged
ENOUGH = 1e-5  # thicknesses: sweeps that move less have done
SLACK = 0.75  # of the gap at the start, that two keep who cannot be parted otherwise
ROUNDS = 4  # of collisions, each found and then parted along its normal
LATE_ROUNDS = 12  # and of those that keep both sides of a plane
ZONE_ROUNDS = 40  # of zones that grow
SWEEPS = 12  # over the contacts in a round
LATE_SWEEPS = 60

Obstacles = Callable[[Rows, Array], list[tuple[NDArray[np.intp], Array, Array]]]


@dataclass(eq=False)
class Problem:
    """Rows of `kernels_response.relax`."""

    corners: Rows = field(default_factory=lambda: np.zeros((0, 4), np.intp))
    weights: Array = field(default_factory=lambda: np.zeros((0, 4)))
    normals: Array = field(default_factory=lambda: np.zeros((0, 3)))
    targets: Array = field(default_factory=lambda: np.zeros(0))
    frictions: Array = field(default_factory=lambda: np.zeros(0))
    starts: Array = field(default_factory=lambda: np.zeros((0, 3)))
    pushed: Array = field(default_factory=lambda: np.zeros(0))
    dragged: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def add(self, corners: Rows, weights: Array, normals: Array, targets: Array, friction: float, x0: Array) -> None:
        """Append rows."""
        k = len(corners)
        starts = (weights[:, :, None] * x0[corners]).sum(axis=1)
        more = corners, weights, normals, targets, np.full(k, friction), starts, np.zeros(k), np.zeros((k, 3))
        for name, values in zip(self.__dict__, more, strict=True):
            setattr(self, name, np.concatenate([getattr(self, name), values]))

    def relax(self, x: Array, w: Array, sweeps: int, enough: float) -> None:
        """Move x."""
        from pointmass.self_contact.kernels_response import relax

        relax(*self.__dict__.values(), x, w, sweeps, enough)


class Resolution:
    """What keeps a mesh from passing through itself, step by step.

    Parameters
    ----------
    mesh : rows of particles.
    thickness : the distance that is kept between surfaces [m].
    friction : Coulomb's mu.

    Attributes
    ----------
    searches : how often pairs were looked for.
    zones : how many zones had to move as a whole.
    lost : whether the last step ended with surfaces that passed through each other: those led through by pins.
    """

    def __init__(self, mesh: Mesh, thickness: float, friction: float) -> None:
        self.mesh, self.thickness, self.friction = mesh, thickness, friction
        self.reach, self.margin = REACH * thickness, MARGIN * thickness
        self.searches = self.zones = 0
        self.lost = False
        self._pairs = Pairs(np.zeros((0, 4), np.intp), 0)
        self._found: tuple[Array, Array] | None = None  # where everybody was when they were looked for, and went then

    def resolve(self, x0: Array, x1: Array, w: Array, dt: float, obstacles: Obstacles | None = None) -> bool:
        """Change the end x1 of a step, so that nothing has met on the straight ways from x0; whether it has changed.

        Parameters
        ----------
        x0, x1 : positions, float64, shape (n, 3).
        w : inverse masses; 0 = pinned.
        obstacles : for rows and x1, those of them that are near something solid, the directions out of it, and how far
            outside they are [m].
        """
        self.lost = False
        if not len(self.mesh.points):
            return False
        self._renew(x0, x1, first=True)
        if not len(self._pairs):
            return False
        problem = Problem()
        gaps, meetings, stale = self._afresh(x0)
        self._contacts(problem, gaps, x0, dt)
        given = x1.copy()
        known = np.zeros(len(x0), bool)
        if len(problem.corners):
            self._obstruct(problem, problem.corners, x0, x1, obstacles, known)
            problem.relax(x1, w, SWEEPS, ENOUGH * self.thickness)
        for k in range(ROUNDS + LATE_ROUNDS):
            if self._renew(x0, x1):
                gaps, meetings, stale = self._afresh(x0)
            hit = self._sweep(gaps, meetings, stale, x0, x1)
            if not len(hit):
                break
            late = k >= ROUNDS
            corners = self._planes(problem, gaps, hit, x0) if late else self._part(problem, gaps, meetings, hit, x0, x1)
            self._obstruct(problem, corners, x0, x1, obstacles, known)
            before = x1.copy()
            problem.relax(x1, w, LATE_SWEEPS if late else SWEEPS, ENOUGH * self.thickness)
            stale = (x1 != before).any(axis=1)
        else:
            self._move_zones(x0, x1, given, w)
        return not np.array_equal(x1, given)

    def forget(self) -> None:
        """Look for pairs anew at the next step."""
        self._found = None

    # ------------------------------------------------------------------------------------------------ inside

    def _renew(self, x0: Array, x1: Array, first: bool = False) -> bool:
        """Look for pairs again, if somebody has moved so far that there may be others."""
        if self._found is not None and (self._still(x0, x1) or (not first and self._on_way(x1))):
            return False
        self._pairs = find(self.mesh, x0, x1, self.reach, self.margin)
        self._found = x0.copy(), x1.copy()
        self.searches += 1
        return True

    def _still(self, x0: Array, x1: Array) -> bool:
        """Whether nobody has moved by more than half of the margin, relative to all others."""
        from pointmass.self_contact.kernels_pairs import spread_of

        assert self._found is not None
        for x in (x0, x1):
            least, most, _ = spread_of(self.mesh.points, x, self._found[0])
            if not float(np.square(most - least).sum()) <= self.margin**2:
                return False
        return True

    def _on_way(self, x1: Array) -> bool:
        """Whether all are near where they went when pairs were looked for in this very step."""
        from pointmass.self_contact.kernels_pairs import spread_of

        assert self._found is not None
        return bool(spread_of(self.mesh.points, x1, self._found[1])[2] <= (0.5 * self.margin) ** 2)

    def _afresh(self, x0: Array) -> tuple[_Gaps, _Meetings, NDArray[np.bool_]]:
        """What lies between new pairs, that nothing is known of their meetings, and that all have to be looked at."""
        return self._look(x0), _Meetings(len(self._pairs)), np.ones(len(x0), bool)

    def _look(self, x0: Array) -> _Gaps:
        from pointmass.self_contact.kernels_response import look

        pairs, gaps = self._pairs, _Gaps(len(self._pairs))

        def work(first: int, last: int) -> None:
            look(pairs.corners, pairs.points, x0, gaps.size, gaps.normals, gaps.weights, gaps.inside, first, last)

        spread(work, len(pairs), GRAIN)
        return gaps

    def _contacts(self, problem: Problem, gaps: _Gaps, x0: Array, dt: float) -> None:
        """Rows for those who are near at the start: they come no nearer than the thickness, and part if they are."""
        near = np.flatnonzero(gaps.inside & (gaps.size <= self.reach) & (gaps.size > TOUCHING * self.thickness))
        rise = min(RISE, dt / RISE_TIME)
        size = gaps.size[near]
        targets = np.minimum(size + rise * (self.thickness - size), self.thickness)
        targets = np.where(size < self.thickness, targets, self.thickness)
        problem.add(self._pairs.corners[near], gaps.weights[near], gaps.normals[near], targets, self.friction, x0)

    def _sweep(self, gaps: _Gaps, meetings: _Meetings, stale: NDArray[np.bool_], x0: Array, x1: Array) -> Rows:
        """Which pairs meet."""
        from pointmass.self_contact.kernels_response import sweep

        pairs = self._pairs
        touching, tolerance = TOUCHING * self.thickness, APART * self.thickness

        def work(first: int, last: int) -> None:
            sweep(
                pairs.corners, pairs.points, x0, x1, gaps.size, gaps.normals, touching, tolerance, stale,
                meetings.times, meetings.weights, first, last,
            )  # fmt: skip

        spread(work, len(pairs), GRAIN)
        return np.flatnonzero(meetings.times <= 1.0)

    def _part(self, problem: Problem, gaps: _Gaps, meetings: _Meetings, hit: Rows, x0: Array, x1: Array) -> Rows:
        """Rows for those who meet, along the normal of where they do: they stay on the side they come from."""
        corners, weights = self._pairs.corners[hit], meetings.weights[hit]
        when = meetings.times[hit, None, None]
        now = x0[corners] + when * (x1[corners] - x0[corners])
        faces = np.cross(now[:, 2] - now[:, 1], now[:, 3] - now[:, 1])
        across = np.cross(now[:, 1] - now[:, 0], now[:, 3] - now[:, 2])
        normals = np.where((hit < self._pairs.points)[:, None], faces, across)
        size = np.sqrt(np.square(normals).sum(axis=1, keepdims=True))
        normals = normals / np.where(size > 0, size, 1)
        apart = ((weights[:, :, None] * x0[corners]).sum(axis=1) * normals).sum(axis=1)
        normals, apart = normals * np.where(apart < 0, -1.0, 1.0)[:, None], np.abs(apart)
        # Where they graze each other the normal is not sure: there it is that of the closest points at the start.
        unsure = apart < 0.5 * np.minimum(gaps.size[hit], self.thickness)
        weights = np.where(unsure[:, None], gaps.weights[hit], weights)
        normals = np.where(unsure[:, None], gaps.normals[hit], normals)
        apart = np.where(unsure, gaps.size[hit], apart)
        problem.add(corners, weights, normals, np.minimum(apart, self.thickness), self.friction, x0)
        return corners

    def _planes(self, problem: Problem, gaps: _Gaps, hit: Rows, x0: Array) -> Rows:
        """Rows that keep each two corners of those who meet on both sides of the plane that was between them.

        Nobody meets who keeps to them, and standing still keeps to all of them.
        """
        corners, normals = self._pairs.corners[hit], gaps.normals[hit]
        targets = np.minimum(SLACK * gaps.size[hit], self.thickness)
        weights = {False: ((1, -1, 0, 0), (1, 0, -1, 0), (1, 0, 0, -1))}
        weights[True] = ((1, 0, -1, 0), (1, 0, 0, -1), (0, 1, -1, 0), (0, 1, 0, -1))  # type: ignore[assignment]
        for edges, each in weights.items():
            some = (hit >= self._pairs.points) == edges
            many = int(some.sum()), len(each)
            problem.add(
                np.repeat(corners[some], many[1], axis=0),
                np.tile(np.array(each, float), (many[0], 1)),
                np.repeat(normals[some], many[1], axis=0),
                np.repeat(targets[some], many[1]),
                0.0,
                x0,
            )
        return corners

    def _obstruct(
        self,
        problem: Problem,
        corners: Rows,
        x0: Array,
        x1: Array,
        obstacles: Obstacles | None,
        known: NDArray[np.bool_],
    ) -> None:
        """Rows that keep those who are pushed about out of what is solid; `known` have them."""
        if obstacles is None:
            return
        pushed = np.zeros_like(known)
        pushed[corners] = True
        new = np.flatnonzero(pushed & ~known)
        known |= pushed
        for rows, normals, outside in obstacles(new, x1):
            four = np.repeat(rows[:, None], 4, axis=1)
            weights = np.tile((1.0, 0.0, 0.0, 0.0), (len(rows), 1))
            targets = (normals * x1[rows]).sum(axis=1) - outside
            problem.add(four, weights, normals, targets, 0.0, x0)

    def _move_zones(self, x0: Array, x1: Array, given: Array, w: Array) -> None:
        """Move all that still meet, with whom they touch, as rigid zones along with their mean way; zones may grow.

        Provot (1997), Bridson et al. (2002), section 7.5, without the turning. A zone with pins goes where these go.
        """
        way, zone = given - x0, np.full(len(x0), -1)  # the zone of each, named by one of it
        gaps, meetings, stale = self._afresh(x0)
        for _ in range(ZONE_ROUNDS):
            if self._renew(x0, x1):
                gaps, meetings, stale = self._afresh(x0)
            hit = self._sweep(gaps, meetings, stale, x0, x1)
            if not len(hit):
                break
            changed: set[int] = set()
            for corners in self._pairs.corners[hit].tolist():
                names = {int(zone[c]) for c in corners if zone[c] >= 0}
                name = min([*names, *corners])
                if len(names) == 1 and all(zone[c] >= 0 for c in corners):
                    continue
                members = np.isin(zone, sorted(names))
                members[corners] = True
                zone[members] = name
                changed = (changed - names) | {name}
            if not changed:
                self.lost = True  # a zone that meets itself has pins that go different ways
                break
            before = x1.copy()
            for name in sorted(changed):
                rows = np.flatnonzero(zone == name)
                pins = rows[w[rows] == 0]
                free = rows[w[rows] > 0]
                m = np.ones(len(pins)) if len(pins) else 1 / w[free]
                x1[free] = x0[free] + (m[:, None] * way[pins if len(pins) else free]).sum(axis=0) / m.sum()
            self.zones += len(changed)
            stale = (x1 != before).any(axis=1)
        else:
            self.lost = True


class _Gaps:
    """What lies between pairs at the start of a step, see `kernels_response.look`."""

    def __init__(self, count: int) -> None:
        self.size, self.inside = np.empty(count), np.empty(count, bool)
        self.normals, self.weights = np.empty((count, 3)), np.empty((count, 4))


class _Meetings:
    """When pairs meet and where, see `kernels_response.sweep`."""

    def __init__(self, count: int) -> None:
        self.times, self.weights = np.full(count, 2.0), np.zeros((count, 4))
