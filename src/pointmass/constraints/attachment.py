"""Particles that are tied to something else: to a surface, to other particles, to a collider."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import lengths, rows_dot
from pointmass.collisions.triangles import triangle, triangle_numbers
from pointmass.constraints.constraint import Constraint, Step, carried_over
from pointmass.constraints.kernels_strain import limit_lengths
from pointmass.errors import InvalidInput, shown, unknown, whole_number
from pointmass.particles import Array, Particles, Selection
from pointmass.system import ParticleSystem

Ids = NDArray[np.int64]
SWEEPS = 50  # at most


class Attachment(Constraint):
    """Particles keep their place at something else, where they were at the start.

    Each particle of `on` is tied to what is nearest to it. On a body with a surface that is a triangle: the particle
    keeps its place over it, however the triangle moves and turns. On other particles it is the nearest one, at the
    distance of the start. Both sides move, by their inverse masses: a cloth hangs on what carries it, and weighs on it.
    At a collider, which nothing moves, the particle goes where the collider goes, though it is not pinned.

    After each step the ties are put right one after the other, several times where they share particles, and what they
    move is put into the velocities, v + (x - x_before) / dt. So ties are as stiff as can be at any step, need no
    stiffness, and keep momentum; what the ends would have gained on each other is lost.

    Parameters
    ----------
    on : the particles that are tied: the name of a body or group, such as "cloth top corners", a mask, or rows.
    to : name of the body or group that they are tied to.
    collider : instead of `to`: the number of the collider, counted from 0.

    Raises
    ------
    InvalidInput
        Neither or both of `to` and `collider` are given.

    Notes
    -----
    A triangle that tears keeps what is tied to it. Ties of particles that are taken away are gone.

    Examples
    --------
    >>> pm.Attachment("flag left corners", to="rope")
    >>> pm.Attachment("curtain top edge", collider=0)
    """

    def __init__(self, on: Selection, to: str | None = None, *, collider: int | None = None) -> None:
        if (to is None) == (collider is None):
            raise InvalidInput("an attachment needs either `to`, the name of a body, or `collider`, the number of one")
        if to is not None and not isinstance(to, str):
            raise InvalidInput(f"to = {shown(to)} is not allowed: it must be the name of a body or group")
        self.on, self.to = on, to
        self.collider = None if collider is None else whole_number("collider", collider, at_least=0)
        self.ids: Ids = np.zeros(0, np.int64)
        self._start = np.zeros((0, 3))  # places relative to the collider
        self._ties = _Ties.none()

    def bind(self, system: ParticleSystem) -> None:
        p = system.particles
        rows = p.select(self.on)
        if not len(rows):
            raise InvalidInput(f"on = {shown(self.on)} has no particles that could be attached")
        self.ids = p.id[rows]
        if self.to is None:
            self._bind_to_collider(system, rows)
            return
        if self.to not in p.groups and self.to not in p.surfaces:
            raise unknown("body or group in `to` of an attachment:", self.to, {*p.groups, *p.surfaces})
        if self.to in p.surfaces:
            self._ties = _to_surface(p, rows, self.to)
        else:
            self._ties = _to_particles(p, rows, self.to)

    def _bind_to_collider(self, system: ParticleSystem, rows: NDArray[np.intp]) -> None:
        assert self.collider is not None
        if self.collider >= len(system.colliders):
            raise InvalidInput(
                f"collider = {self.collider} is not allowed: there are {len(system.colliders)}, counted from 0"
            )
        if system.particles.pinned[rows].any():
            raise InvalidInput(
                f"on = {shown(self.on)} has pinned particles, which stay where they are: let them go, or lead them "
                "by a motion with the formula of the collider's place"
            )
        place = system.colliders[self.collider].at(system.t)
        self._start = system.particles.x[rows].astype(np.float64) - place

    def enforce(self, system: ParticleSystem, step: Step) -> None:
        p = system.particles
        if self.collider is None:
            before = p.x.copy()
            self._ties.enforce(p)
            carried_over(p, before, step.dt)
            return
        leader, rows = system.colliders[self.collider], p.rows(self.ids)
        here = rows >= 0
        p.x[rows[here]] = self._start[here] + leader.at(step.t1)
        p.v[rows[here]] = leader.velocity(step.t1)


@dataclass(eq=False)
class _Ties:
    """Particles and what they are tied to.

    Attributes
    ----------
    nodes : ids of the particles, shape (k,).
    corners : ids of the corners of the triangle of each, or three times that of the other particle, shape (k, 3).
    weights : by which the corners make the foot of the particle, shape (k, 3).
    height : over the foot along the normal [m], or distance from the other particle, shape (k,).
    surface : whose triangles these are, "" for particles.
    triangles : those of the surface, when the corners were read.
    numbers : of the triangles, shape (k,).
    """

    nodes: Ids
    corners: Ids
    weights: Array
    height: Array
    surface: str
    triangles: Ids
    numbers: NDArray[np.intp]

    @classmethod
    def none(cls) -> _Ties:
        nothing = np.zeros((0, 3), np.int64)
        return cls(nothing[:, 0], nothing, np.zeros((0, 3)), np.zeros(0), "", nothing, np.zeros(0, np.intp))

    def enforce(self, p: Particles) -> None:
        """Put all right; `p.x` in place."""
        if self.surface:
            self._follow(p.surfaces[self.surface].triangles)
        rows = p.rows(np.column_stack([self.nodes, self.corners]))
        whole = (rows >= 0).all(axis=1)
        rows, weights, height = rows[whole], self.weights[whole].astype(p.dtype), self.height[whole].astype(p.dtype)
        if self.surface:
            from pointmass.constraints.kernels_attachment import put_over

            put_over(rows, weights, height, p.w, p.x, SWEEPS)
        else:
            limit_lengths(np.ascontiguousarray(rows[:, :2]), height, height, p.w, p.x, SWEEPS)

    def _follow(self, triangles: Ids) -> None:
        """Read the corners again where the surface has changed: it has torn, or some triangles are gone."""
        if triangles is self.triangles:
            return
        if len(triangles) == len(self.triangles):
            known = self.numbers >= 0
            self.corners[known] = triangles[self.numbers[known]]
        else:
            places = {tuple(corners): k for k, corners in enumerate(triangles.tolist())}
            self.numbers = np.array([places.get(tuple(c), -1) for c in self.corners.tolist()], np.intp)
        self.triangles = triangles


def _to_surface(p: Particles, rows: NDArray[np.intp], name: str) -> _Ties:
    """Ties to the nearest triangles of a surface, but for those that the particle is itself a corner of."""
    corners = p.corners(name)
    place = p.x.astype(np.float64)
    across = np.cross(place[corners[:, 1]] - place[corners[:, 0]], place[corners[:, 2]] - place[corners[:, 0]])
    size = lengths(across)
    flat = size == 0
    normal = across / np.where(flat, 1, size)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        numbers = triangle_numbers(place[corners], normal)
    best = np.zeros(len(rows), np.intp)
    for k, row in enumerate(rows):
        usable = ~flat & (corners != row).all(axis=1)
        if not usable.any():
            raise InvalidInput(f"to = {name!r} has no triangle that particle {p.id[row]} could be attached to")
        some = numbers[usable]
        square = triangle().columns(*(place[row] - some[:, :3]).T, *some[:, 3:].T)[0]
        best[k] = np.flatnonzero(usable)[np.argmin(square)]
    e1, e2, n = numbers[best, 3:6], numbers[best, 6:9], normal[best]
    arm = place[rows] - place[corners[best, 0]]
    inverse = 1 / size[best] ** 2
    second = rows_dot(np.cross(arm, e2), across[best]) * inverse
    third = rows_dot(np.cross(e1, arm), across[best]) * inverse
    weights = np.stack([1 - second - third, second, third], axis=1)
    triangles = p.surfaces[name].triangles
    return _Ties(p.id[rows], triangles[best], weights, rows_dot(arm, n), name, triangles, best)


def _to_particles(p: Particles, rows: NDArray[np.intp], name: str) -> _Ties:
    """Ties to the nearest particles of a group."""
    place = p.x.astype(np.float64)
    group = p.select(name)
    best, distance = np.zeros(len(rows), np.intp), np.zeros(len(rows))
    for k, row in enumerate(rows):
        others = group[group != row]
        if not len(others):
            raise InvalidInput(f"to = {name!r} has no particle that particle {p.id[row]} could be attached to")
        away = lengths(place[others] - place[row])
        best[k], distance[k] = others[np.argmin(away)], away.min()
    corners = np.repeat(p.id[best][:, None], 3, axis=1)
    weights = np.tile([1.0, 0.0, 0.0], (len(rows), 1))
    return _Ties(p.id[rows], corners, weights, distance, "", corners[:0], np.full(len(rows), -1))
