"""Elastic elements that are relaxed one by one, instead of adding forces: what position-based solvers do.

An element is a `ConstraintForce`: a damped spring of C(x1, ..., xk). With k = k_s h^2, d = k_d h, and r_a for how far
node a comes in the step, its force l / h^2 along dC/dx is the solution of

    l = -k (C - rest) - d sum_a dC/dx_a . r_a

for where the nodes come to when the force has moved them by w_a l dC/dx_a (Macklin, Mueller and Chentanez, XPBD, 2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pointmass.laws.colouring import colour_starts, coloured
from pointmass.laws.elements import ConstraintForce
from pointmass.laws.force import Array, Force, Rows, clock, inputs_for, matrix
from pointmass.laws.stencils import SMALLEST, grid
from pointmass.particles import Particles
from pointmass.tracing import functions as fn


def colours(forces: Sequence[ConstraintForce], particles: Particles, islands: Rows) -> list[Rows]:
    """Numbers of the elements of each force, different for those that share a particle: the order in which they move.

    Elements of an island that is a grid take turns by rows and columns, stencil by stencil; see `coloured` for others.

    Parameters
    ----------
    islands : of each particle, shape (n,).
    """
    enabled = [force for force in forces if force.enabled]
    result = [np.full(len(force.ids), -1, np.intp) for force in forces]
    size = np.bincount(islands, minlength=1)
    by_island = np.argsort(islands, kind="stable")
    ends = np.cumsum(size)
    for island in np.flatnonzero(size >= SMALLEST**2):
        found = grid(enabled, particles, by_island[ends[island] - size[island] : ends[island]])
        below: dict[Force, int] = dict.fromkeys(forces, 0)  # colours of the stencils before this one
        for stencil in [] if found is None else found.stencils:
            own, force = stencil.colours(), stencil.force
            place = next(k for k, other in enumerate(forces) if other is force)
            result[place][stencil.own] = below[force] + own
            below[force] += int(own.max()) + 1
    for force, mine in zip(forces, result, strict=True):
        others = mine < 0
        mine[others] = coloured(force.rows(particles)[others], len(particles))
    return result


def relax(
    forces: Sequence[ConstraintForce],
    orders: Sequence[Rows],
    particles: Particles,
    t: Any,
    h: Array,
    x: Array,
    rise: Array,
    sweeps: int,
    project: Array | None,
) -> None:
    """Let all elements move their particles, force by force and colour by colour; `rise` in place.

    Parameters
    ----------
    orders : colours of the elements of each force.
    t, h : end of the step, a number or one for each particle, and its length, shape (n,) [s].
    x, rise : positions at the start, and how far they come [m], shape (n, 3).
    project : directions in which each particle is free, shape (n, 3, 3); None = all.
    """
    families = [_Family(force, own, particles, t, h) for force, own in zip(forces, orders, strict=True)]
    for _ in range(sweeps):
        for family in families:
            family.sweep(particles.w, x, rise, project)


class _Family:
    """The elements of a force in the order of their colours, with the impulses that they have noted so far."""

    def __init__(self, force: ConstraintForce, own: Rows, particles: Particles, t: Any, h: Array) -> None:
        self.force = force
        rows = force.rows(particles)
        order = np.argsort(own, kind="stable")
        self.starts = colour_starts(own[order])
        self.rows, now = rows[order], clock(t, rows[order, 0])
        law = force.traced_constraint
        count = len(order)
        settings = force.settings(particles, now, order)
        self.values = {name: np.broadcast_to(parts[0], count) for name, parts in settings.items()}
        self.time = np.broadcast_to(now, count)
        self.h = h[self.rows[:, 0]].astype(particles.dtype)
        self.law, self.noted = law, np.zeros(count, particles.dtype)

    def sweep(self, w: Array, x: Array, rise: Array, project: Array | None) -> None:
        for first, last in zip(self.starts[:-1], self.starts[1:], strict=True):
            self._colour(slice(first, last), w, x, rise, project)

    def _colour(self, some: slice, w: Array, x: Array, rise: Array, project: Array | None) -> None:
        """Elements that share no particle."""
        rows, h = self.rows[some], self.h[some]
        nodes = rows.shape[1]
        vectors: dict[str, Array] = {f"x{a + 1}": x[rows[:, a]] + rise[rows[:, a]] for a in range(nodes)}
        settings = {name: (values[some],) for name, values in self.values.items()}
        inputs = inputs_for(self.law, vectors, {"t": self.time[some]}, settings)
        out = matrix(self.law.columns(*inputs), len(rows), rise.dtype)
        gap, k, d = out[:, 0], out[:, 1] * h * h, out[:, 2] * h
        softness, travelled = np.zeros(len(rows), rise.dtype), np.zeros(len(rows), rise.dtype)
        ways = []
        for a in range(nodes):
            slope = out[:, 3 + 3 * a : 6 + 3 * a]
            way = slope if project is None else _turned(project[rows[:, a]], slope)
            softness = softness + w[rows[:, a]] * fn.dot(tuple(slope.T), tuple(way.T))
            travelled = travelled + fn.dot(tuple(slope.T), tuple(rise[rows[:, a]].T))
            ways.append(way)
        more = -(k * gap + self.noted[some] + d * travelled) / (1 + (k + d) * softness)
        self.noted[some] = self.noted[some] + more
        for a in range(nodes):
            rise[rows[:, a]] = rise[rows[:, a]] + (w[rows[:, a]] * more)[:, None] * ways[a]


def _turned(matrices: Array, a: Array) -> Array:
    """Products of 3x3 matrices and vectors, from left to right."""
    return matrices[:, :, 0] * a[:, 0, None] + matrices[:, :, 1] * a[:, 1, None] + matrices[:, :, 2] * a[:, 2, None]
