"""Gaits: waves of muscle lengths that run along a body of cubes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import unknown

Floats = NDArray[np.float64]
FOLDS = 1.5  # of a concertina, along the body
LIFT = 0.3  # of a sidewinder's vertical bend, relative to the lateral one


@dataclass(frozen=True)
class Wave:
    """Lengths offset + amplitude sin(2 pi f t + phase) of some muscles, relative to their idle ones."""

    offset: Floats
    amplitude: Floats
    phase: Floats


@dataclass(frozen=True)
class Gait:
    """How a body moves.

    Attributes
    ----------
    summary : in words.
    amplitude : of the muscles, as a part of their lengths.
    waves : on the body.
    frequency : [1/s].
    wave : (angle, along, side, height) of muscles -> offset and factors of sin(2 pi f t) and cos(2 pi f t), for an
        amplitude of 1: the angle of the travelling wave, the place from 0 at the head to 1 at the tail, 1 on the left
        and -1 on the right, 1 above and -1 below.
    rings : factor on the amplitude, for the muscles around the body, which are long where those along it are short; 0 =
        they are none.
    """

    summary: str
    amplitude: float
    waves: float
    frequency: float
    wave: Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats, Floats]]
    rings: float = 0.0

    def along(self, amplitude: float, waves: float, s: Floats, side: Floats, height: Floats) -> Wave:
        """The lengths of muscles along the body, at places s from 0 to 1."""
        return _wave(amplitude, *self.wave(2 * math.pi * waves * s, s, side, height))

    def around(self, amplitude: float, waves: float, s: Floats) -> Wave:
        """Those of muscles around it."""
        angle = 2 * math.pi * waves * s
        return _wave(-self.rings * amplitude, 0 * s, np.cos(angle), -np.sin(angle))


def _wave(amplitude: float, offset: Floats, sine: Floats, cosine: Floats) -> Wave:
    return Wave(
        amplitude * offset, amplitude * np.hypot(sine, cosine), np.arctan2(amplitude * cosine, amplitude * sine)
    )


def _travelling(angle: Floats) -> tuple[Floats, Floats]:
    """sin(w t - angle), which runs from head to tail."""
    return np.cos(angle), -np.sin(angle)


def _rectilinear(angle: Floats, s: Floats, side: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
    return (0 * s, *_travelling(angle))


def _serpentine(angle: Floats, s: Floats, side: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
    sine, cosine = _travelling(angle)
    return 0 * s, side * sine, side * cosine


def _sidewinding(angle: Floats, s: Floats, side: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
    """The vertical bend comes a quarter of a period after the lateral one."""
    sine, cosine = _travelling(angle)
    return 0 * s, side * sine - LIFT * height * cosine, side * cosine + LIFT * height * sine


def _concertina(angle: Floats, s: Floats, side: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
    """Folds that stay where they are on the body open and close, one part of it after the other."""
    fold = 0.5 * side * np.cos(2 * math.pi * FOLDS * s)
    sine, cosine = _travelling(angle)
    return fold, fold * sine, fold * cosine


GAITS: dict[str, Gait] = {
    "serpentine": Gait("lateral waves run from head to tail", 0.25, 1.5, 1.0, _serpentine),
    "rectilinear": Gait("it shortens and stretches, straight on", 0.2, 1.0, 1.0, _rectilinear),
    "sidewinding": Gait("lateral waves, and the body is lifted where it swings", 0.25, 2.0, 1.0, _sidewinding),
    "concertina": Gait("folds draw the tail up, and push the head on", 0.4, 0.5, 0.6, _concertina),
}
PERISTALTIC = Gait("thick and short waves run along it", 0.35, 1.0, 0.8, _rectilinear, rings=0.6)


def gait_of(name: str) -> Gait:
    """A gait of snakes by its name.

    Raises
    ------
    InvalidInput
        There is none of this name.
    """
    if name not in GAITS:
        raise unknown("gait", name, GAITS)
    return GAITS[name]
