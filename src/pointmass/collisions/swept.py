"""The first moment at which particles on their way meet a surface.

A step of the solver gives each particle a cubic (x0, v0, x1, v1). It is split into chords that stay within eps of
it; the chords' ends and, where a surface bulges between them, its deepest point tell where it is crossed, and the
crossing is then found on the cubic itself. So nothing tunnels, at any speed, and the time of impact is exact for
ballistic motion.

A surface that is looked up in data may have any shape between two points. Along it a path is marched: the gap at a
place says how far the path is clear from there (conservative advancement: Mirtich, Impulse-based Dynamic Simulation,
1996).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, lengths, rows_dot

RESOLUTION = 2.0**-50  # of a fraction of the way
ROOT_STEPS = 128  # every second one halves the bracket or the step
MOST_CHORDS = 4096
CHORDS_AT_ONCE = 2**16
NEWTON_STEPS = 60
BACK_STEPS = 60  # each twice as long as the one before
MARGIN = 0.0625  # of eps: a march goes on by at least this much, and so may miss a part that is as thin
MOST_LOOKS = 4096  # of a march
SAMPLES = (0.0, 0.5, 1.0)  # of a step, where the acceleration of a moving surface is looked at


@dataclass(frozen=True, eq=False)
class Paths:
    """Cubic Hermite paths of particles during a piece of time.

    Attributes
    ----------
    x0, v0, x1, v1 : positions [m] and velocities [m/s] at both ends, shape (k, 3).
    t0, h : start and length [s], shape (k,).
    radius : of the particles [m], shape (k,).
    """

    x0: Array
    v0: Array
    x1: Array
    v1: Array
    t0: Array
    h: Array
    radius: Array

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Paths:
        """Some of the paths."""
        return Paths(
            self.x0[rows], self.v0[rows], self.x1[rows], self.v1[rows], self.t0[rows], self.h[rows], self.radius[rows]
        )

    def time(self, theta: Array) -> Array:
        """Times at the fractions theta of the way [s], shape (k,)."""
        return self.t0 + theta * self.h

    def position(self, theta: Array) -> Array:
        """Positions at the fractions theta of the way, shape (k, 3)."""
        s, h = theta[:, None], self.h[:, None]
        r = 1.0 - s
        ends = self.x0 * (r * r * (1.0 + 2.0 * s)) + self.x1 * (s * s * (3.0 - 2.0 * s))
        result: Array = ends + h * (self.v0 * (s * r * r) - self.v1 * (s * s * r))
        return result

    def velocity(self, theta: Array) -> Array:
        """Velocities at the fractions theta of the way [m/s], shape (k, 3)."""
        s, h = theta[:, None], self.h[:, None]
        chord = (self.x1 - self.x0) / np.where(h > 0, h, 1)
        result: Array = chord * (6.0 * s * (1.0 - s)) + self.v0 * ((1 - s) * (1 - 3 * s)) + self.v1 * (s * (3 * s - 2))
        return result

    def bends(self) -> Array:
        """Bound of the second derivative to theta [m], shape (k,)."""
        chord, h = self.x1 - self.x0, self.h[:, None]
        start, end = 6 * chord - h * (4 * self.v0 + 2 * self.v1), h * (2 * self.v0 + 4 * self.v1) - 6 * chord
        return np.maximum(lengths(start), lengths(end))

    def pace(self) -> Array:
        """Bound of the first derivative to theta [m], shape (k,)."""
        a, c = self.h[:, None] * self.v0, self.h[:, None] * self.v1
        return np.maximum(np.maximum(lengths(a), lengths(c)), lengths(3 * (self.x1 - self.x0) - a - c))

    @cached_property
    def reach(self) -> Array:
        """Bound of the distance from the start [m], shape (k,): the length of the control polygon of Bezier."""
        a, c = self.h[:, None] * self.v0 / 3, self.h[:, None] * self.v1 / 3
        return lengths(a) + lengths(self.x1 - self.x0 - a - c) + lengths(c)


class _Approach:
    """Gap between paths and one surface, above the level at which each starts if that is inside already."""

    def __init__(self, surface: Collider, paths: Paths, level: Array) -> None:
        self.surface, self.paths, self.level = surface, paths, level
        self.bulges = surface.bulges

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> _Approach:
        return _Approach(self.surface, self.paths.take(rows), self.level[rows])

    def local(self, theta: Array) -> Array:
        """Position relative to the surface, shape (k, 3)."""
        return self.paths.position(theta) - self.surface.at(self.paths.time(theta))

    def gap(self, theta: Array) -> Array:
        return self.gap_at(self.local(theta))

    def slope(self, theta: Array) -> Array:
        """d gap / d theta, shape (k,)."""
        motion = self.surface.velocity(self.paths.time(theta))
        normal = self.surface.local_normal(self.local(theta))
        return rows_dot(normal, self.paths.velocity(theta) - motion) * self.paths.h

    def gap_at(self, local: Array) -> Array:
        return self.surface.local_distance(local) - self.paths.radius - self.level

    def bends(self) -> Array:
        """Bound of the second derivative to theta [m], shape (k,)."""
        bend = self.paths.bends()
        return bend + _swing(self.surface, self.paths) if self.surface.moves else bend

    def pace(self) -> Array:
        """Bound of how fast the gap changes with theta [m], shape (k,)."""
        pace = self.paths.pace()
        return self.surface.steepness * (pace + self._surface_way() if self.surface.moves else pace)

    def _surface_way(self) -> Array:
        """Bound of the way of the surface [m], shape (k,)."""
        surface, paths = self.surface, self.paths
        return lengths(surface.at(paths.t0 + paths.h) - surface.at(paths.t0)) + _swing(surface, paths)

    def chords(self) -> NDArray[np.intp]:
        """How many chords stay within eps of each path."""
        count: NDArray[np.intp] = (
            np.ceil(np.sqrt(self.bends() / (8 * self.surface.eps))).clip(1, MOST_CHORDS).astype(np.intp)
        )
        return count

    def possible(self) -> NDArray[np.bool_]:
        """Where the way is so long, or the end so deep, that there may be a hit."""
        surface, paths = self.surface, self.paths
        start, end = paths.t0, paths.t0 + paths.h
        way = paths.reach
        if surface.moves:
            way = way + self._surface_way()
        if surface.lookup:
            way = surface.steepness * way
        free = self.gap_at(paths.x0 - surface.at(start))
        deep: NDArray[np.bool_] = self.gap_at(paths.x1 - surface.at(end)) < 0
        return (free < way) | deep

    def free_side(self, theta: Array) -> Array:
        """A hit where the gap is at least 0."""
        return theta


class _FlatApproach(_Approach):
    """The same for a flat surface at rest: the gap along a cubic path is a cubic polynomial.

    Round-off tells it from the distance of the place, so `hit` asks that in the end.
    """

    def __init__(self, surface: Collider, paths: Paths, level: Array) -> None:
        super().__init__(surface, paths, level)
        self.bulges = False
        normal = surface.local_normal(paths.x0)
        self.start, self.end = self.gap_at(paths.x0 - surface.at(0.0)), self.gap_at(paths.x1 - surface.at(0.0))
        self.leave, self.arrive = paths.h * rows_dot(normal, paths.v0), paths.h * rows_dot(normal, paths.v1)
        rise = self.end - self.start
        self.square = 3 * rise - (2 * self.leave + self.arrive)
        self.cube = (self.leave + self.arrive) - 2 * rise

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> _FlatApproach:
        return _FlatApproach(self.surface, self.paths.take(rows), self.level[rows])

    def gap(self, theta: Array) -> Array:
        inside = self.start + theta * (self.leave + theta * (self.square + theta * self.cube))
        return np.where(theta == 1.0, self.end, inside)

    def slope(self, theta: Array) -> Array:
        result: Array = self.leave + theta * (2 * self.square + theta * (3 * self.cube))
        return result

    def bends(self) -> Array:
        return np.maximum(np.abs(2 * self.square), np.abs(2 * self.square + 6 * self.cube))

    def possible(self) -> NDArray[np.bool_]:
        """Where a number of Bezier's control polygon is below 0."""
        near: NDArray[np.bool_] = self.start + self.leave / 3 < 0
        return near | (self.end - self.arrive / 3 < 0) | (self.end < 0)

    def free_side(self, theta: Array) -> Array:
        back = np.full(len(theta), RESOLUTION)
        for _ in range(BACK_STEPS):
            inside = (super().gap(theta) < 0) & (theta > 0)
            if not inside.any():
                break
            theta = np.where(inside, np.maximum(theta - back, 0), theta)
            back = np.where(inside, 2 * back, back)
        return theta


def first_hit(surface: Collider, paths: Paths) -> Array:
    """Fraction of the way at which each path first meets a surface, on its free side; inf where it does not.

    A particle that starts inside counts as on the surface: it may leave, and meets it when it sinks deeper.
    """
    theta = np.full(len(paths.h), np.inf)
    level = np.minimum(surface.distance(paths.x0, paths.t0) - paths.radius, 0)
    kind = _Approach if surface.curved or surface.moves else _FlatApproach
    approach = kind(surface, paths, level)
    rows = np.flatnonzero(approach.possible())
    if len(rows):
        approach = approach.take(rows)
        low, high = _march(approach) if surface.lookup else _brackets(approach)
        theta[rows[low == high]] = low[low == high]
        crossed = (low < high) & np.isfinite(high)
        if crossed.any():
            approach = approach.take(crossed)
            theta[rows[crossed]] = approach.free_side(_root(approach, low[crossed], high[crossed]))
    return theta


def _root(approach: _Approach, low: Array, high: Array) -> Array:
    """A crossing between `low`, where the gap is at least 0, and `high`, where it is less; on the free side.

    Newton's method within a bracket. It aims by RESOLUTION before the root, to end on the free side. Where a step
    leaves the bracket or is not half as long as the one before, the bracket is halved instead.
    """
    a, b, last = low, high, high - low
    g_low, g_high = approach.gap(low), approach.gap(high)
    x = a + (b - a) * (g_low / (g_low - g_high))
    open_ = np.ones(len(x), bool)
    for _ in range(ROOT_STEPS):
        gap, slope = approach.gap(x), approach.slope(x)
        free, falls = gap >= 0, slope < 0
        a, b = np.where(open_ & free, x, a), np.where(open_ & ~free, x, b)
        step = -gap / np.where(falls, slope, -1)
        arrived = free & falls & (step <= 2 * RESOLUTION)
        aim = x + step - RESOLUTION
        newton = falls & (a < aim) & (aim < b) & (np.abs(step) <= 0.5 * last)
        x = np.where(newton, aim, 0.5 * (a + b))
        last = np.where(newton, np.abs(step), 0.5 * (b - a))
        open_ &= ~arrived & (b - a > RESOLUTION) & (a < x) & (x < b)
        if not open_.any():
            break
    return a


def _swing(surface: Collider, paths: Paths) -> Array:
    """About how far a surface gets away from uniform motion [m], shape (k,)."""
    most = [lengths(surface.acceleration(paths.t0 + s * paths.h)) for s in SAMPLES]
    result: Array = np.max(most, axis=0) * paths.h**2
    return result


def _brackets(approach: _Approach) -> tuple[Array, Array]:
    """Fractions between which each path first goes from outside to inside; (nan, inf) where it does not.

    Chord after chord of all paths, and the longer it takes, the more of them at a time.
    """
    chords = approach.chords()
    low, high = np.full(len(chords), np.nan), np.full(len(chords), np.inf)
    first, count = 1, 1
    while len(paths := np.flatnonzero((chords >= first) & np.isinf(high))):
        rows, turn = np.repeat(paths, count), np.tile(np.arange(first, first + count), len(paths))
        rows, turn = rows[turn <= chords[rows]], turn[turn <= chords[rows]]
        part = approach.take(rows)
        start, end = (turn - 1) / chords[rows], turn / chords[rows]
        inside = np.where(part.gap(end) < 0, end, np.nan)
        if approach.bulges and (look := np.isnan(inside)).any():
            beside = part.take(look)
            middle = _deepest(beside, beside.local(start[look]), beside.local(end[look]))
            inside[look] = start[look] + middle * (end - start)[look]
        sunk = ~np.isnan(inside)
        sunk[sunk] = part.take(sunk).gap(inside[sunk]) < 0
        hit, where = np.unique(rows[sunk], return_index=True)  # chords of a path follow each other
        low[hit], high[hit] = start[sunk][where], inside[sunk][where]
        first, count = first + count, min(2 * count, max(1, CHORDS_AT_ONCE // len(paths)))
    return low, high


def _march(approach: _Approach) -> tuple[Array, Array]:
    """The same for a surface that is looked up, by conservative advancement.

    Who has not come to the end by then skims the surface, nearer than can be told apart: it stops there, as if it had
    touched (both fractions are the same).
    """
    k = len(approach.level)
    low, high = np.full(k, np.nan), np.full(k, np.inf)
    theta, rows, pace = np.zeros(k), np.arange(k), approach.pace()
    gap, least = approach.gap(theta), MARGIN * approach.surface.eps
    for _ in range(MOST_LOOKS):
        end = np.minimum(theta + np.where(gap > least, gap, least) / np.where(pace > 0, pace, least), 1.0)
        gap = approach.gap(end)
        sunk = gap < 0
        low[rows[sunk]], high[rows[sunk]] = theta[sunk], end[sunk]
        on = ~sunk & (theta < end) & (end < 1.0)
        if not on.any():
            return low, high
        approach, rows, theta, gap, pace = approach.take(on), rows[on], end[on], gap[on], pace[on]
    low[rows] = high[rows] = theta
    return low, high


def _deepest(approach: _Approach, a: Array, b: Array) -> Array:
    """A point of each chord a-b inside a convex solid, as a fraction; nan where the chord stays outside.

    Both ends are outside. The gap is convex along the chord, so Newton's method runs from either end to the nearest
    root and never past it; between the roots the chord is inside.
    """
    enter, leave = (_newton(approach, p, q) for p, q in ((a, b), (b, a)))
    inside = enter + leave < 1
    middle = np.full(len(a), np.nan)
    middle[inside] = 0.5 * (enter[inside] + (1 - leave[inside]))
    return middle


def _newton(approach: _Approach, a: Array, b: Array) -> Array:
    """Fraction from a at which the gap is first 0; inf if it never is, or if a is on the surface and b leads away.

    Who has just bounced begins there, perhaps a rounding inside, and does not hit again.
    """
    s, open_ = np.zeros(len(a)), np.ones(len(a), bool)
    for _ in range(NEWTON_STEPS):
        point = a + np.where(open_, s, 0)[:, None] * (b - a)
        gap = approach.gap_at(point)
        slope = rows_dot(approach.surface.local_normal(point), b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(slope < 0, np.where(gap > 0, -gap / slope, 0.0), np.inf)
        s = np.where(open_, np.where(s + step > 1, np.inf, s + step), s)
        open_ &= np.isfinite(s) & (step > 1e-15)
        if not open_.any():
            break
    return s
