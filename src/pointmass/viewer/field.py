"""Arrows and streamlines of the velocity field of a scene, and its divergence and curl as colours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from pointmass.flow_field import (
    ARROWS,
    STREAMLINES,
    FlowField,
    Paint,
    curl,
    divergence,
    field_arrows,
    field_of,
    grid,
    streamlines,
)
from pointmass.frame import Drawable, Frame
from pointmass.particles import Array
from pointmass.simulation import Simulation
from pointmass.viewer.columns import length
from pointmass.viewer.messages import Choice

CHOICES = {
    ARROWS: Choice(name=ARROWS, title="arrows of the field", unit="m/s"),
    STREAMLINES: Choice(name=STREAMLINES, title="streamlines", unit=""),
}
MAKERS: dict[str, Callable[..., Drawable]] = {ARROWS: field_arrows, STREAMLINES: streamlines}
USUAL = {ARROWS: (24, 9), STREAMLINES: (60, 80)}  # how many in a plane and in space, where the look does not say
ROUND = 0.15  # of the size of the particles: room around them
OUTSIDE = 0.3  # of the size of the box, that particles may be beyond it before it is another one
SHARE = 0.1  # of the time, in which a field that changes is drawn anew
SAMPLES = 12  # along the longest side, to know how large a quantity becomes
SMALL = 1e-9  # of the speed over the size of the box: a derivative that is 0 but for rounding


@dataclass(frozen=True)
class Quantity:
    """What the derivatives of a field tell at each place.

    Attributes
    ----------
    of : du_i/dx_j [1/s], shape (k, 3, 3) -> the quantity, shape (k,).
    signed : whether it may be below 0.
    """

    of: Callable[[Array], Array]
    signed: bool
    meaning: str


QUANTITIES = {
    "divergence": Quantity(divergence, True, "above 0 the field spreads, below 0 it gathers"),
    "curl": Quantity(lambda gradient: length(curl(gradient)), False, "twice as fast as small things turn in it"),
}


@dataclass(frozen=True, eq=False)
class Seen:
    """The field of a scene at the time of a frame, in a box.

    Attributes
    ----------
    low, high : corners of the box [m].
    """

    field: FlowField
    t: float
    low: Array
    high: Array

    def values(self, quantity: Quantity, x: Array) -> Array:
        """A quantity at places [1/s], shape (k,); exact, by the derivatives of the formulas' programs."""
        return quantity.of(self.field.gradient(self.t, np.asarray(x, np.float64)))

    def samples(self) -> Array:
        """Places all over the box, shape (k, 3)."""
        return grid(self.low, self.high, SAMPLES)

    def resolution(self) -> float:
        """The least derivative that means anything [1/s]."""
        speed = length(self.field.velocity(self.t, self.samples()))
        return SMALL * float(np.max(speed, initial=0.0, where=np.isfinite(speed))) / float((self.high - self.low).max())


class Field:
    """Finds the field of what is played, and draws it over frames."""

    def __init__(self) -> None:
        self._wanted: dict[str, bool] = {}
        self._source: tuple[Any, ...] = ()  # whose field it is
        self._field: FlowField | None = None
        self._box: tuple[Array, Array] | None = None
        self._drawn: dict[str, tuple[Any, Drawable]] = {}
        self._due: dict[str, float] = {}  # when a field that changes is drawn anew

    def shown(self, sims: Sequence[Simulation]) -> list[str]:
        """Names of what is on: as chosen, or as the look of the scene says."""
        look = sims[0].look if sims else None
        return [n for n in names(sims) if self._wanted.get(n, getattr(look, COUNTS[n], 0) > 0)]

    def choose(self, name: str, on: bool) -> None:
        """Switch one on or off."""
        self._wanted[name] = on
        self._drawn.pop(name, None)

    def see(self, frame: Frame, sims: Sequence[Simulation], setup: object) -> Seen | None:
        """The field at the time of a frame, None where there is none.

        Parameters
        ----------
        setup : another one means that the field may be another one.
        """
        if not names(sims):
            self._source, self._field = (), None
            return None
        source = (sims[0], setup)
        if not self._source or self._source[0] is not sims[0] or self._source[1] != setup:
            self._field, self._source, self._drawn = field_of(sims[0].system), source, {}
        if self._field is None:
            return None
        low, high = self._around(frame, sims[0])
        return Seen(self._field, frame.time, low, high)

    def draw(
        self,
        frame: Frame,
        sims: Sequence[Simulation],
        seen: Seen | None,
        paint: Paint | None,
        scale: object,
        version: int,
    ) -> tuple[Drawable, ...]:
        """The drawables of a frame with the field as it is to be seen.

        Parameters
        ----------
        paint : colours at places, None = as usual.
        scale : another one means other colours.
        """
        if seen is None:
            return frame.drawables
        look, shown = sims[0].look, self.shown(sims)
        kept = [name for name in shown if paint is None and getattr(look, COUNTS[name]) > 0]
        scene = tuple(d for d in frame.drawables if d.name not in CHOICES or d.name in kept)
        return (*scene, *(self._made(name, look, seen, paint, scale, version) for name in shown if name not in kept))

    def _made(self, name: str, look: Any, seen: Seen, paint: Paint | None, scale: object, version: int) -> Drawable:
        count = getattr(look, COUNTS[name]) or USUAL[name][int((seen.high > seen.low).all())]
        fixed = (count, scale, seen.low.tobytes(), seen.high.tobytes())
        key = (fixed, None if seen.field.steady else seen.t)
        known, now = self._drawn.get(name), perf_counter()
        if known is not None and (known[0] == key or (known[0][0] == fixed and now < self._due[name])):
            return known[1]
        drawable = MAKERS[name](seen.field, seen.t, seen.low, seen.high, count, version, paint)
        end = perf_counter()
        self._drawn[name], self._due[name] = (key, drawable), end + (end - now) * (1 / SHARE - 1)
        return drawable

    def _around(self, frame: Frame, sim: Simulation) -> tuple[Array, Array]:
        """The box in which the field is drawn: of the look, or around the particles, which it follows by leaps."""
        if sim.look.field_box is not None:
            low, high = np.array(sim.look.field_box, np.float64)
            return low, high
        x = frame.positions[np.isfinite(frame.positions).all(axis=1)].astype(np.float64)
        if len(x) < 2:
            return self._box or (np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 0.0]))
        low, high = np.percentile(x, [2, 98], axis=0)
        size = max(float((high - low).max()), 1e-3)
        if self._box is not None:
            room = OUTSIDE * float((self._box[1] - self._box[0]).max())
            if (low > self._box[0] - room).all() and (high < self._box[1] + room).all():
                return self._box
        wide = np.where(high > low, ROUND * size, 0.0)
        self._box = low - wide, high + wide
        return self._box


COUNTS = {ARROWS: "arrows", STREAMLINES: "streamlines"}  # names in a look


def names(sims: Sequence[Simulation]) -> list[str]:
    """Names of what can be drawn of a field; nothing where there is none, or several in a duel."""
    return list(CHOICES) if len(sims) == 1 and field_of(sims[0].system) is not None else []
