"""Resting contact: a surface bears what rests on it, and friction holds or brakes (Witkin, Particle System Dynamics).

A particle stands on a surface while it is within eps of it, pressed towards it, and so slow that its next bounce would
not lift it by eps: |N . v| < sqrt(2 a eps). The forces on it are filtered between calculate and gather: their part
into the surface is taken away, and Coulomb friction of at most mu times that load works along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, rows_dot

Rows = NDArray[np.intp]
PASSES = 32  # over the contacts of a particle that stands in a corner


@dataclass(eq=False)
class Standing:
    """The particles that stand on one surface.

    Attributes
    ----------
    rows : of the particles.
    slide : direction in which each slides along the surface, 0 for those that stick, shape (k, 3).
    load : force with which each is pressed on at the start [N], shape (k,).
    pressed, normal : whether the last filtered force pressed each on the surface, and the normals there.
    """

    surface: Collider
    rows: Rows
    slide: Array
    load: Array
    pressed: NDArray[np.bool_] = field(init=False)
    normal: Array = field(init=False)

    def __post_init__(self) -> None:
        self.pressed = np.zeros(len(self.rows), bool)
        self.normal = np.zeros((len(self.rows), 3))


class Contacts:
    """The filter on forces. It is set up before each piece of a step and stays the same during it.

    With `lagged`, loads and whether friction holds are those of the start of the piece, and what stands then cannot lift off before the
    next one: the filter is then linear, and Newton's method sees its exact Jacobian.
    """

    def __init__(self, surfaces: Sequence[Collider], order: int, lagged: bool) -> None:
        self.surfaces = surfaces
        self.order = order
        self.lagged = lagged
        self.standing: list[Standing] = []
        self._passes = 1

    def find(
        self, x: Array, v: Array, m: Array, acceleration: Any, t: Any, radius: Array, free: NDArray[np.bool_]
    ) -> None:
        """Find out who stands where, and stop their motion into and out of the surface.

        Parameters
        ----------
        x, v : state at the start of the piece, shape (n, 3); `v` is changed in place.
        acceleration : function without arguments that gives the unfiltered accelerations, shape (n, 3); it is called only where
            something is near a surface.
        t : clock of each particle, shape (n,).
        free : which particles to look at.
        """
        self.standing = []
        a: Array | None = None
        for surface in self.surfaces:
            gap = surface.distance(x, t) - radius
            rows = np.flatnonzero(free & (np.abs(gap) <= surface.eps))
            if not len(rows):
                continue
            a = acceleration() if a is None else a
            stand = self._stand(surface, rows, x, v, m, a, t)
            if len(stand.rows):
                self.standing.append(stand)
        everyone = np.concatenate([s.rows for s in self.standing]) if len(self.standing) > 1 else np.zeros(0)
        self._passes = 1 if len(np.unique(everyone)) == len(everyone) else PASSES

    def forces(self, t: Any, x: Array, v: Array, m: Array, f: Array) -> None:
        """Take away what presses into the surfaces, and add friction."""
        for stand in self.standing:
            stand.pressed[:] = False
        for _ in range(self._passes):
            before = f.copy() if self._passes > 1 else f
            for stand in self.standing:
                self._bear(stand, t, x, v, m, f)
            if self._passes > 1 and np.array_equal(before, f):
                break

    def projection(self, n: int) -> Any:
        """Directions in which contacts leave particles free, shape (3n, 3n): none where it sticks, along the surface where it slides."""
        from scipy.sparse import block_diag, csr_array

        blocks = np.tile(np.eye(3), (n, 1, 1))
        for stand in self.standing:
            rows = stand.rows[stand.pressed]
            normal = stand.normal[stand.pressed]
            across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
            sticks = (stand.slide[stand.pressed] == 0).all(axis=1) & (stand.surface.friction > 0)
            blocks[rows] = np.where(sticks[:, None, None], 0, blocks[rows] @ across)
        return csr_array(block_diag(list(blocks)))

    def settle(self, x: Array, v: Array, t: Any, radius: Array) -> None:
        """Keep those that stand out of the surface at the end of a piece, and stop those whom friction stopped. In place."""
        for stand in self.standing:
            rows, surface = stand.rows, stand.surface
            now = t[rows]
            local = x[rows] - surface.at(now)
            normal = surface.local_normal(local)
            sunk = np.minimum(surface.local_distance(local) - radius[rows], 0)
            x[rows] -= sunk[:, None] * normal
            back = rows_dot(v[rows] - surface.velocity(now), stand.slide)
            stops = (back < 0) & (stand.slide != 0).any(axis=1)
            v[rows] -= np.where(stops, back, 0)[:, None] * stand.slide
            into = np.minimum(rows_dot(v[rows] - surface.velocity(now), normal), 0)
            v[rows] -= np.where(sunk < 0, into, 0)[:, None] * normal

    def _stand(self, surface: Collider, rows: Rows, x: Array, v: Array, m: Array, a: Array, t: Any) -> Standing:
        now, local = t[rows], x[rows] - surface.at(t[rows])
        normal, relative = surface.local_normal(local), v[rows] - surface.velocity(now)
        if self.order == 1:
            stands = rows_dot(a[rows] - surface.velocity(now), normal) < 0
            count = int(stands.sum())
            return Standing(surface, rows[stands], np.zeros((count, 3), x.dtype), np.zeros(count, x.dtype))
        speed = rows_dot(relative, normal)
        push = a[rows] - surface.acceleration(now)
        lift = rows_dot(push, normal) + surface.bending(local, relative)
        stands = (lift < 0) & (np.abs(speed) <= np.sqrt(2 * surface.eps * np.abs(lift)))
        rows, normal, speed, relative = rows[stands], normal[stands], speed[stands], relative[stands]
        push, lift = push[stands], lift[stands]
        v[rows] -= speed[:, None] * normal
        slide = _direction(relative - speed[:, None] * normal, 1e-12 * (1 + np.abs(v[rows]).max(axis=1)))
        if self.lagged:
            along = push - rows_dot(push, normal)[:, None] * normal
            slips = np.sqrt(rows_dot(along, along)) > surface.friction * -lift
            sticks = (slide == 0).all(axis=1)
            slide = np.where((sticks & slips)[:, None], _direction(along, np.zeros(len(rows))), slide)
        return Standing(surface, rows, slide, -lift * m[rows])

    def _bear(self, stand: Standing, t: Any, x: Array, v: Array, m: Array, f: Array) -> None:
        surface, rows = stand.surface, stand.rows
        now = t[rows] if isinstance(t, np.ndarray) else t
        local = x[rows] - surface.at(now)
        normal = surface.local_normal(local)
        mass = m[rows, None] if self.order == 2 else np.ones((len(rows), 1), f.dtype)
        relative = v[rows] - surface.velocity(now)
        frame = surface.acceleration(now) if self.order == 2 else surface.velocity(now)
        bend = surface.bending(local, relative) if self.order == 2 else 0
        excess = f[rows] - mass * frame
        load = -(rows_dot(excess, normal) + mass[:, 0] * bend)
        load = load if self.lagged else np.maximum(load, 0)
        stand.pressed |= self.lagged | (load > 0)
        stand.normal = normal
        f[rows] += load[:, None] * normal
        if self.order == 2 and surface.friction > 0:
            f[rows] += self._friction(stand, excess, normal, surface.friction * (stand.load if self.lagged else load))

    def _friction(self, stand: Standing, excess: Array, normal: Array, most: Array) -> Array:
        along = excess - rows_dot(excess, normal)[:, None] * normal
        size = np.sqrt(rows_dot(along, along))
        share = np.ones(len(size)) if self.lagged else np.minimum(most / np.where(size > 0, size, 1), 1)
        hold = share[:, None] * along
        sticks = (stand.slide == 0).all(axis=1)
        return -np.where(sticks[:, None], hold, most[:, None] * stand.slide)


def _direction(v: Array, least: Array) -> Array:
    """Unit vectors of rows that are longer than `least`, 0 for the others."""
    size = np.sqrt(rows_dot(v, v))
    moving = size > least
    return np.where(moving[:, None], v / np.where(moving, size, 1)[:, None], 0)
