"""The first moment at which particles on their way meet a surface.

A step of the solver gives each particle a cubic (x0, v0, x1, v1). It is split into chords that stay within eps of it; the
chords' ends and, where a surface bulges between them, its deepest point tell where it is crossed, and the crossing is then found on
the cubic itself. So nothing tunnels, at any speed, and the time of impact is exact for ballistic motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, rows_dot
from pointmass.solvers.events import first_root

MOST_CHORDS = 4096
NEWTON_STEPS = 60


@dataclass(frozen=True, eq=False)
class Paths:
    """Cubic Hermite paths of particles during a piece of time.

    Attributes
    ----------
    x0, v0, x1, v1 : positions [m] and velocities [m/s] at both ends, shape (k, 3).
    t0, h : start and length [s], shape (k,).
    """

    x0: Array
    v0: Array
    x1: Array
    v1: Array
    t0: Array
    h: Array

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Paths:
        """Some of the paths."""
        return Paths(self.x0[rows], self.v0[rows], self.x1[rows], self.v1[rows], self.t0[rows], self.h[rows])

    def position(self, theta: Array) -> Array:
        """Positions at the fractions theta of the way, shape (k, 3)."""
        s, h = theta[:, None], self.h[:, None]
        r = 1.0 - s
        ends = self.x0 * (r * r * (1.0 + 2.0 * s)) + self.x1 * (s * s * (3.0 - 2.0 * s))
        return ends + h * (self.v0 * (s * r * r) - self.v1 * (s * s * r))

    def velocity(self, theta: Array) -> Array:
        """Velocities at the fractions theta of the way [m/s], shape (k, 3)."""
        s, h = theta[:, None], self.h[:, None]
        chord = (self.x1 - self.x0) / np.where(h > 0, h, 1)
        return chord * (6.0 * s * (1.0 - s)) + self.v0 * ((1 - s) * (1 - 3 * s)) + self.v1 * (s * (3 * s - 2))

    def bends(self) -> Array:
        """Bound of the second derivative to theta [m], shape (k,)."""
        chord, h = self.x1 - self.x0, self.h[:, None]
        start, end = 6 * chord - h * (4 * self.v0 + 2 * self.v1), h * (2 * self.v0 + 4 * self.v1) - 6 * chord
        return np.sqrt(np.maximum(rows_dot(start, start), rows_dot(end, end)))

    def reach(self) -> Array:
        """Bound of the way from the start [m], shape (k,)."""
        a, c = self.h[:, None] * self.v0 / 3, self.h[:, None] * self.v1 / 3
        b = self.x1 - self.x0 - a - c
        return np.sqrt(rows_dot(a, a)) + np.sqrt(rows_dot(b, b)) + np.sqrt(rows_dot(c, c))


class _Approach:
    """Gap between paths and one surface, less what a particle had already sunk in at the start."""

    def __init__(self, surface: Collider, paths: Paths, radius: Array) -> None:
        self.surface, self.paths, self.radius = surface, paths, radius
        start = surface.distance(paths.x0, paths.t0) - radius
        self.level = np.minimum(start, 0)
        self.start = start - self.level

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> _Approach:
        part = _Approach.__new__(_Approach)
        part.surface, part.paths = self.surface, self.paths.take(rows)
        part.radius, part.level, part.start = self.radius[rows], self.level[rows], self.start[rows]
        return part

    def local(self, theta: Array) -> Array:
        """Position relative to the surface, shape (k, 3)."""
        return self.paths.position(theta) - self.surface.at(self.paths.t0 + theta * self.paths.h)

    def gap(self, theta: Array) -> Array:
        return self.gap_at(self.local(theta))

    def gap_at(self, local: Array) -> Array:
        return self.surface.local_distance(local) - self.radius - self.level

    def near(self) -> NDArray[np.bool_]:
        """Whether a path may come as far as the surface."""
        p, s = self.paths, self.surface
        way = p.reach()
        if s.moves:
            drift = s.at(p.t0 + p.h) - s.at(p.t0)
            swing = np.maximum(*(rows_dot(a, a) for a in (s.acceleration(p.t0), s.acceleration(p.t0 + p.h))))
            way = way + np.sqrt(rows_dot(drift, drift)) + np.sqrt(swing) * p.h**2
        return self.start <= way

    def chords(self) -> NDArray[np.intp]:
        """How many chords stay within eps of each path."""
        bend = self.paths.bends()
        if self.surface.moves:
            a = self.surface.acceleration(self.paths.t0)
            bend = bend + np.sqrt(rows_dot(a, a)) * self.paths.h**2
        return np.clip(np.ceil(np.sqrt(bend / (8 * self.surface.eps))), 1, MOST_CHORDS).astype(np.intp)


def first_hit(surface: Collider, paths: Paths, radius: Array) -> Array:
    """Fraction of the way at which each path first meets a surface, on its free side; inf where it does not.

    A particle that starts inside counts as on the surface: it may leave, and meets it when it sinks deeper.
    """
    theta = np.full(len(paths.h), np.inf)
    everything = _Approach(surface, paths, radius)
    rows = np.flatnonzero(everything.near())
    if not len(rows):
        return theta
    approach = everything.take(rows)
    low, high = _brackets(approach)
    crossed = np.isfinite(high)
    if crossed.any():
        inner = approach.take(crossed)
        root = first_root(inner.gap, low[crossed], high[crossed])[0]
        theta[rows[crossed]] = np.where(np.isfinite(root), root, low[crossed])
    return theta


def _brackets(approach: _Approach) -> tuple[Array, Array]:
    """Fractions between which each path first goes from outside to inside; (nan, inf) where it does not."""
    chords = approach.chords()
    k = len(chords)
    low, high = np.full(k, np.nan), np.full(k, np.inf)
    a, start = approach.local(np.zeros(k)), np.zeros(k)
    for j in range(1, int(chords.max()) + 1):
        open_ = (chords >= j) & np.isinf(high)
        if not open_.any():
            break
        end = np.minimum(j / chords, 1.0)
        b = approach.local(end)
        deepest = np.where(approach.gap_at(b) < 0, 1.0, np.nan)
        if approach.surface.bulges and (look := open_ & np.isnan(deepest)).any():
            deepest[look] = _deepest(approach.take(look), a[look], b[look])
        inside = start + deepest * (end - start)
        sunk = open_ & ~np.isnan(deepest)
        sunk[sunk] = approach.take(sunk).gap(inside[sunk]) < 0
        low, high = np.where(sunk, start, low), np.where(sunk, inside, high)
        a, start = b, end
    return low, high


def _deepest(approach: _Approach, a: Array, b: Array) -> Array:
    """A point of each chord a-b inside a convex solid, as a fraction; nan where the chord stays outside.

    Both ends are outside. The gap is convex along the chord, so Newton's method runs from either end to the nearest
    root and never past it; between the roots the chord is inside.
    """
    enter, leave = (_newton(approach, p, q) for p, q in ((a, b), (b, a)))
    inside = enter + leave < 1
    return np.where(inside, 0.5 * (enter + (1 - leave)), np.nan)


def _newton(approach: _Approach, a: Array, b: Array) -> Array:
    """Fraction from a at which the gap is first 0; inf if it never is."""
    s = np.zeros(len(a))
    for _ in range(NEWTON_STEPS):
        point = a + np.where(np.isfinite(s), s, 0)[:, None] * (b - a)
        gap = approach.gap_at(point)
        slope = rows_dot(approach.surface.local_normal(point), b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(gap <= 0, 0.0, np.where(slope < 0, -gap / slope, np.inf))
        s = np.where(s + step > 1, np.inf, s + step)
        if not (np.isfinite(s) & (step > 1e-15)).any():
            break
    return s
