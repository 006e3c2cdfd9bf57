"""What is plotted over time: energies, momentum, stretch, the solver's work, and expressions of the user."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pointmass.errors import InvalidInput
from pointmass.frame import Frame
from pointmass.simulation import Simulation
from pointmass.solvers import Stats
from pointmass.viewer.columns import Columns
from pointmass.viewer.expression import Expression
from pointmass.viewer.messages import Column, Contender
from pointmass.viewer.track import Track

MOST = 8  # expressions

OF_FRAMES = {  # quantities of frames
    "energy": Column(plot="energy", name="total", unit="J"),
    "kinetic": Column(plot="energy", name="kinetic", unit="J"),
    "potential": Column(plot="energy", name="potential", unit="J"),
    **{f"momentum_{a}": Column(plot="momentum", name=a, unit="kg m/s") for a in "xyz"},
    "stretch": Column(plot="largest stretch", name="stretch", unit=""),
    "particles": Column(plot="particles", name="particles", unit=""),
}
OF_FORCES = "potential_"  # begins the name of the quantity that is a force's part of the potential energy
CONSTANT = ("particles",)  # not plotted until it changes
WORK = {
    "step": Column(plot="step size", name="mean", unit="s"),
    "newton": Column(plot="iterations in a step", name="Newton", unit=""),
    "cg": Column(plot="iterations in a step", name="conjugate gradients", unit=""),
}


@dataclass(frozen=True)
class _Before:
    """What a simulation had done at the last look."""

    sim: Simulation
    time: float
    stats: Stats


class Plots:
    """Measures each frame.

    Attributes
    ----------
    track : what was measured.
    expressions : of the user, by their text.
    """

    def __init__(self) -> None:
        self.track = Track("run")
        self.expressions: dict[str, Expression] = {}
        self._measured: list[Column] = []
        self._first: dict[str, float] = {}
        self._stored: set[str] = set()  # forces that have had energy
        self._before: _Before | None = None
        self._time = -math.inf

    def plot(self, text: str, columns: Columns) -> None:
        """Plot an expression from now on.

        Raises
        ------
        InvalidInput
            It cannot be one, or there are too many already.
        """
        made = Expression(text, columns.names())
        made.of(columns)
        if made.text in self.expressions:
            return
        if len(self.expressions) >= MOST:
            raise InvalidInput(f"{MOST} expressions are plotted already, and no more are allowed: take one away")
        self.expressions[made.text] = made
        self._begin()

    def drop(self, text: str) -> None:
        """Plot it no longer."""
        if self.expressions.pop(text, None) is not None:
            self._begin()

    def measure(
        self, frame: Frame, sims: Sequence[Simulation], columns: Columns, contenders: Sequence[Contender] = ()
    ) -> None:
        """Take a frame into the track."""
        if frame.time < self._time:
            self._first, self._stored = {}, set()
        self._time = frame.time
        self._first = {**frame.quantities, **self._first}
        measured = {**self._of_frame(frame), **_of_duel(contenders)}
        if not self.track.columns or [column for column in measured if column not in self._measured]:
            self._measured = list(measured)
            self._begin()
        values = [measured.get(column, math.nan) for column in self._measured]
        values += [_value(expression, columns) for expression in self.expressions.values()]
        self.track.add(frame.time, [*values, *self._work(sims)])

    def _of_frame(self, frame: Frame) -> dict[Column, float]:
        known = {OF_FRAMES[name]: value for name, value in frame.quantities.items() if name in OF_FRAMES}
        known |= self._of_forces(frame)
        for name in CONSTANT:
            column = OF_FRAMES[name]
            if column not in self._measured and frame.quantities.get(name) == self._first.get(name):
                known.pop(column, None)
        return known

    def _of_forces(self, frame: Frame) -> dict[Column, float]:
        """Potential energy of each force; NaN until it has some, as the mouse has that holds, and until two have."""
        parts = {n.removeprefix(OF_FORCES): e for n, e in frame.quantities.items() if n.startswith(OF_FORCES)}
        self._stored |= {name for name, energy in parts.items() if energy != 0}
        shown = self._stored if len(self._stored) > 1 else ()
        return {
            Column(plot="energy", name=name.replace("_", " "), unit="J"): energy if name in shown else math.nan
            for name, energy in parts.items()
        }

    def _begin(self) -> None:
        own = [Column(plot=text, name=text, unit="") for text in self.expressions]
        self.track.begin([*self._measured, *own, *WORK.values()])

    def _work(self, sims: Sequence[Simulation]) -> list[float]:
        """Since the last look: mean step [s], iterations of Newton and of conjugate gradients in it; NaN: none."""
        if len(sims) != 1:
            return [math.nan] * len(WORK)
        (sim,) = sims
        before, now = self._before, _Before(sim, sim.t, sim.engine.stats)
        if before is not None and before.sim is sim and now.stats.steps == before.stats.steps:
            return [math.nan] * len(WORK)  # a look within a step
        self._before = now
        if before is None or before.sim is not sim:
            return [math.nan] * len(WORK)
        steps = now.stats.steps - before.stats.steps
        solved = [getattr(now.stats, name) - getattr(before.stats, name) for name in ("iterations", "cg_iterations")]
        iterations = [count / steps if sim.solver.implicit else math.nan for count in solved]
        return [(now.time - before.time) / steps, *iterations]


def _of_duel(contenders: Sequence[Contender]) -> dict[Column, float]:
    """Errors, energies and costs."""
    result = {}
    for plot, unit, name, factor in (
        ("error", "m", "error", 1.0),
        ("energy", "J", "energy", 1.0),
        ("cost", "ms", "cost", 1e3),
    ):
        for contender in contenders:
            value = getattr(contender, name)
            if value is not None and not contender.ended:
                result[Column(plot=plot, name=contender.name, unit=unit, log=plot == "error")] = factor * value
    return result


def _value(expression: Expression, columns: Columns) -> float:
    """NaN where a column is no longer there."""
    try:
        return expression.of(columns)
    except InvalidInput:
        return math.nan
