"""Integral curves from places that were clicked, by each chosen solver in its own steps: its error is seen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pointmass.colors import linear
from pointmass.errors import Diverged, InvalidInput, unknown
from pointmass.frame import Drawable, Floats, Ints, Points, Segments
from pointmass.particles import Array
from pointmass.solvers import SOLVERS, DormandPrince, FunctionSystem, Solver
from pointmass.solvers.advance import advance
from pointmass.solvers.control import control_of
from pointmass.viewer import messages
from pointmass.viewer.columns import length
from pointmass.viewer.field import Seen
from pointmass.viewer.messages import CurveEnd, CurveSolver, Vector

NAMES = [name for name, kind in SOLVERS.items() if not kind.moves_masses]  # those that solve x' = u
COLORS = ("#e69f00", "#56b4e9", "#2fc79a", "#e58fc0", "#d55e00", "#9aa7b8")  # Okabe and Ito; dashes differ, too
DASHES = ((1.0, 0.0), (2.5, 1.0), (0.8, 0.8), (1.5, 0.5))  # drawn and left out, by the width of six lines
AT_FIRST = ("euler", "midpoint", "rk4", "dopri5")
REFERENCE = 1e-10  # tolerance of the solver that errors are against
FINE = 400  # parts of the curve of an adaptive solver
MOST_STEPS = 2000
MOST = 24  # curves; the oldest are forgotten
FAR = 10.0  # sizes of the box from it, where a curve ends
WIDE, DOT = 0.008, 0.011  # of the size of the box: a line, and the radius of a step
TURNS, STEPS = 2.5, 20  # how long curves are at first, by the time to cross the box, and in how many steps


@dataclass(frozen=True)
class Start:
    """Where and when curves begin [m, s]."""

    place: Vector
    t: float


@dataclass(frozen=True, eq=False)
class Path:
    """What a solver found: places of shape (k, 3), and whether it came to the end."""

    places: Array
    whole: bool


class IntegralCurves:
    """Those that were started, until they are cleared; when the field changes, they change with it."""

    def __init__(self) -> None:
        self._on = {name: name in AT_FIRST for name in NAMES}
        self._dt = self._span = 0.0  # 0 = as suits the field
        self._starts: list[Start] = []
        self._known: tuple[object, tuple[Drawable, ...], tuple[CurveEnd, ...]] = (None, (), ())

    def message(self, seen: Seen | None) -> messages.Curves | None:
        """How they are set; None where there is no field."""
        if seen is None:
            return None
        dt, span = self._steps(seen)
        solvers = [
            CurveSolver(name=name, color=_color(k), dash=DASHES[_dash(k)], on=self._on[name])
            for k, name in enumerate(NAMES)
        ]
        low, high = messages.vector(seen.low), messages.vector(seen.high)
        return messages.Curves(solvers=solvers, dt=dt, span=span, count=len(self._starts), low=low, high=high)

    def start(self, place: Vector, t: float) -> None:
        """Begin one at a place and time."""
        self._starts = [*self._starts[1 - MOST :], Start(place, t)]

    def clear(self) -> None:
        """Forget all."""
        self._starts = []

    def choose(self, name: str, on: bool) -> None:
        """A solver is to draw them, or no longer.

        Raises
        ------
        InvalidInput
            It does not exist, or solves no flows.
        """
        if name not in self._on:
            raise unknown("solver of integral curves", name, NAMES)
        self._on[name] = on

    def step(self, dt: float, span: float) -> None:
        """Steps of dt for so long [s].

        Raises
        ------
        InvalidInput
            Steps longer than the curve, or too many of them.
        """
        if not span / MOST_STEPS <= dt <= span:
            raise InvalidInput(
                f"dt = {dt:g} s is not allowed: a curve of {span:g} s has 1 to {MOST_STEPS} steps, so give "
                f"{span / MOST_STEPS:g} to {span:g} s"
            )
        self._dt, self._span = dt, span

    def draw(self, seen: Seen | None, version: int) -> tuple[tuple[Drawable, ...], tuple[CurveEnd, ...]]:
        """Lines, a dot at each step of a fixed length, and how far the newest curve ends from the field's own."""
        if seen is None or not self._starts:
            return (), ()
        dt, span = self._steps(seen)
        key = (seen.field, tuple(self._starts), tuple(self._on.items()), dt, span)
        if self._known[0] != key:
            self._known = (key, *self._made(seen, dt, span, version))
        return self._known[1:]

    def _steps(self, seen: Seen) -> tuple[float, float]:
        """dt and how long [s]; if nobody says so, several times across the box."""
        if self._dt > 0:
            return self._dt, self._span
        speed = length(seen.field.velocity(seen.t, seen.samples()))
        speed = speed[np.isfinite(speed) & (speed > 0)]
        typical = float(np.median(speed)) if len(speed) else 0.0
        span = _round(TURNS * float((seen.high - seen.low).max()) / typical) if typical > 0 else 1.0
        return span / STEPS, span

    def _made(
        self, seen: Seen, dt: float, span: float, version: int
    ) -> tuple[tuple[Drawable, ...], tuple[CurveEnd, ...]]:
        size = float((seen.high - seen.low).max())
        drawn: list[Drawable] = []
        ends: list[CurveEnd] = []
        newest = self._starts[-1]
        exact = integral_curve(seen, DormandPrince(REFERENCE, REFERENCE * size), newest, span, span)
        for k, name in enumerate(NAMES):
            if not self._on[name]:
                continue
            solver = SOLVERS[name]()
            adaptive = control_of(solver) is not None
            paths = [
                integral_curve(seen, solver, start, span / FINE if adaptive else dt, span) for start in self._starts
            ]
            color = linear(_color(k), 1.2)
            vertices, pairs = dashed([path.places for path in paths], DASHES[_dash(k)], 6 * WIDE * size)
            drawn.append(
                Segments(
                    name=f"integral curves by {name}",
                    version=version,
                    vertices=vertices.astype(np.float32),
                    pairs=pairs,
                    width=WIDE * size,
                    color=color,
                )
            )
            dots = np.concatenate([path.places[:1] if adaptive else path.places for path in paths])
            drawn.append(
                Points(
                    name=f"steps by {name}",
                    version=version,
                    vertices=dots.astype(np.float32),
                    radius=DOT * size,
                    color=color,
                )
            )
            known = paths[-1].whole and exact.whole
            error = float(np.linalg.norm(paths[-1].places[-1] - exact.places[-1])) if known else None
            ends.append(CurveEnd(name=name, error=error))
        return tuple(drawn), tuple(ends)


def integral_curve(seen: Seen, solver: Solver, start: Start, dt: float, span: float) -> Path:
    """Places on the solution of x' = u(x, t), dt apart in time, until it leaves or the solver fails."""
    field, size = seen.field, float((seen.high - seen.low).max())

    def velocity(t: float, y: Array) -> Array:
        return field.velocity(float(t), y[None]).ravel()

    def slopes(t: float, y: Array) -> Array:
        return field.gradient(float(t), y[None]).reshape(3, 3)

    system = FunctionSystem(velocity, 3, jacobian=slopes)
    count = max(1, math.ceil(span / dt - 1e-9))
    times = start.t + np.append(dt * np.arange(count), span)
    places: list[Array] = [np.array(start.place, np.float64)]
    memory = solver.start(system)
    for begin, end in pairwise(times.tolist()):
        try:
            with np.errstate(all="ignore"):
                place, memory, _ = advance(system, solver, begin, end, places[-1], memory)
        except (Diverged, InvalidInput):
            break
        if not (np.abs(place - 0.5 * (seen.low + seen.high)) < FAR * size).all():  # nor NaN
            break
        places.append(place)
    return Path(np.array(places), len(places) == len(times))


def dashed(paths: list[Array], dash: tuple[float, float], unit: float) -> tuple[Floats, Ints]:
    """Pieces of polylines, `dash[0]` units drawn and `dash[1]` left out: corners, shape (k, 3), and pairs of them."""
    corners: list[Floats] = []
    pairs: list[Ints] = []
    begin = 0
    for path in paths:
        along = np.append(0.0, np.cumsum(length(np.diff(path, axis=0))))
        knots = np.unique([*along, *_edges(along[-1], dash, unit)])
        middle = 0.5 * (knots[1:] + knots[:-1]) % (sum(dash) * unit)
        first = np.flatnonzero(middle <= dash[0] * unit)
        places: Floats = np.stack([np.interp(knots, along, path[:, axis]) for axis in range(3)], axis=1)
        corners.append(places)
        pairs.append((begin + np.stack([first, first + 1], axis=1)).astype(np.int32))
        begin += len(knots)
    return np.concatenate(corners), np.concatenate(pairs)


def _edges(end: float, dash: tuple[float, float], unit: float) -> Iterator[float]:
    """Where dashes begin and end, up to a length."""
    if dash[1] > 0:
        for k in range(int(end / (sum(dash) * unit)) + 1):
            yield from (at for at in (k * sum(dash) * unit, (k * sum(dash) + dash[0]) * unit) if at <= end)


def _round(value: float) -> float:
    """1, 2 or 5 times a power of 10, below a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-9)) * power


def _color(number: int) -> str:
    return COLORS[number % len(COLORS)]


def _dash(number: int) -> int:
    return number % len(DASHES)
