"""The lens: particles, springs or the field in the colours of a quantity; what is not shown is not computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pointmass.colors import PALETTES, palette
from pointmass.errors import unknown
from pointmass.flow_field import Paint
from pointmass.frame import Frame
from pointmass.simulation import Simulation
from pointmass.viewer import field, shading
from pointmass.viewer.columns import RESIDUAL, Columns, Numbers
from pointmass.viewer.field import QUANTITIES, Quantity, Seen
from pointmass.viewer.messages import Choice, Legend
from pointmass.viewer.residual import solves
from pointmass.viewer.springs import Limits, Values, any_springs, stretches

PALETTE = "viridis"
MOST = 98.0  # percentile at the upper end of the colours: a few that are beyond all others make them no paler
FALL = 0.99  # of the upper end from frame to frame, so that colours do not flicker
WIDTH = 0.006  # of springs, of the scene's size
EDGE = 1.2  # upper end of the colours of `limit`; 1 is the edge


@dataclass(frozen=True)
class Shown:
    """Colours of a frame.

    Attributes
    ----------
    paint : colours of the field at places; None = as usual.
    """

    frame: Frame
    legend: Legend | None
    paint: Paint | None = None


@dataclass(frozen=True)
class _OfParticles:
    """A quantity of particles, one of `Columns`."""

    choice: Choice
    column: str
    meaning: str = ""


@dataclass(frozen=True)
class _OfSprings:
    """A quantity of springs.

    Attributes
    ----------
    high : upper end of the colours; None = what is seen.
    """

    choice: Choice
    values: Callable[[Frame, Sequence[Simulation], Limits], Values]
    high: float | None = None
    mark: float | None = None
    meaning: str = ""


@dataclass(frozen=True)
class _OfField:
    """A quantity of the velocity field, at particles and where it is drawn."""

    choice: Choice
    quantity: Quantity


LENSES: dict[str, _OfParticles | _OfSprings | _OfField] = {
    "speed": _OfParticles(Choice(name="speed", title="speed", unit="m/s"), "speed"),
    "force": _OfParticles(Choice(name="force", title="force", unit="N"), "force"),
    "age": _OfParticles(Choice(name="age", title="age", unit="s"), "age"),
    "residual": _OfParticles(
        Choice(name="residual", title="residual", unit=""),
        RESIDUAL,
        "what the solver leaves of its equation, relative",
    ),
    "stretch": _OfSprings(
        Choice(name="stretch", title="stretch of springs", unit=""), lambda frame, sims, _: stretches(frame, sims)
    ),
    "limit": _OfSprings(
        Choice(name="limit", title="ω dt over its limit", unit=""),
        lambda _, sims, limits: limits.of(sims),
        high=EDGE,
        mark=1.0,
        meaning="above 1 a step amplifies",
    ),
    "divergence": _OfField(
        Choice(name="divergence", title="divergence of the field", unit="1/s"), QUANTITIES["divergence"]
    ),
    "curl": _OfField(Choice(name="curl", title="curl of the field", unit="1/s"), QUANTITIES["curl"]),
}


class Lens:
    """Colours frames.

    Attributes
    ----------
    name : of the lens that is on, or "".
    """

    def __init__(self) -> None:
        self.name = ""
        self._high = 0.0
        self._limits = Limits()

    def choose(self, name: str, sims: Sequence[Simulation]) -> None:
        """Put one on, or "".

        Raises
        ------
        InvalidInput
            It does not exist here.
        """
        offered = [choice.name for choice in choices(sims)]
        if name and name not in offered:
            raise unknown("lens", name, offered)
        self.name, self._high = name, 0.0

    def heed(self, sims: Sequence[Simulation]) -> None:
        """Settings have changed: one that is no longer there is taken off."""
        if self.name and self.name not in [choice.name for choice in choices(sims)]:
            self.choose("", sims)

    def show(
        self, frame: Frame, sims: Sequence[Simulation], columns: Columns, version: int, seen: Seen | None = None
    ) -> Shown:
        """The frame as it is seen through the lens.

        Parameters
        ----------
        seen : the velocity field, if there is one.
        """
        lens = LENSES.get(self.name)
        if lens is None:
            return Shown(frame, None)
        if isinstance(lens, _OfField):
            return Shown(frame, None) if seen is None else self._of_field(lens, frame, seen, version)
        if isinstance(lens, _OfParticles):
            value = columns[lens.column]
            colors = self._colors(value, None)
            return Shown(
                replace(frame, drawables=shading.painted(frame, colors, version)),
                self._legend(lens.choice, None, lens.meaning),
            )
        pairs, value = lens.values(frame, sims, self._limits)
        colors = self._colors(value, lens.high)
        nodes = np.tile(shading.NEUTRAL, (len(frame.positions), 1))
        width = WIDTH * shading.extent(frame.positions)
        springs = shading.lines("springs under the lens", pairs, colors, width, version)
        drawables = (*shading.bare(frame, nodes, version), springs)
        return Shown(replace(frame, drawables=drawables), self._legend(lens.choice, lens.mark, lens.meaning))

    def _of_field(self, lens: _OfField, frame: Frame, seen: Seen, version: int) -> Shown:
        quantity = lens.quantity
        samples = np.abs(seen.values(quantity, seen.samples()))
        good = samples[np.isfinite(samples)]
        top = float(np.percentile(good, MOST)) if len(good) else 0.0
        self._high = max(top, FALL * self._high) if top > seen.resolution() else 1.0
        high, low = self._high, -self._high if quantity.signed else 0.0

        def paint(places: Numbers) -> shading.Colors:
            value = np.nan_to_num(seen.values(quantity, places), posinf=high, neginf=low)
            return palette(PALETTE, (value - low) / (high - low))

        drawables = shading.painted(frame, paint(frame.positions), version)
        legend = Legend(
            title=lens.choice.title,
            unit=lens.choice.unit,
            low=low,
            high=high,
            colors=list(PALETTES[PALETTE]),
            mark=0.0 if quantity.signed else None,
            meaning=quantity.meaning,
        )
        return Shown(replace(frame, drawables=drawables), legend, paint)

    def _colors(self, value: Numbers, high: float | None) -> shading.Colors:
        good = value[np.isfinite(value)]
        top = float(np.percentile(good, MOST)) if len(good) else 0.0
        self._high = high if high is not None else max(top, FALL * self._high)
        return palette(PALETTE, np.nan_to_num(value / (self._high or 1.0), nan=0.0, posinf=1.0))

    def _legend(self, choice: Choice, mark: float | None, meaning: str) -> Legend:
        return Legend(
            title=choice.title,
            unit=choice.unit,
            low=0.0,
            high=self._high,
            colors=list(PALETTES[PALETTE]),
            mark=mark,
            meaning=meaning,
        )


def choices(sims: Sequence[Simulation]) -> list[Choice]:
    """The lenses that there are."""
    names = ["speed"]
    if sims:
        names += ["force"] * (sims[0].system.order == 2) + ["age"]
    if solves(sims):
        names.append("residual")
    if any_springs(sims):
        names += ["stretch", "limit"]
    if field.names(sims):
        names += ["divergence", "curl"]
    return [LENSES[name].choice for name in names]
