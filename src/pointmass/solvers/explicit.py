"""Explicit Runge-Kutta methods: one loop that reads a Butcher tableau."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar

import numpy as np

from pointmass.errors import InvalidInput, number
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.control import PIController
from pointmass.solvers.dense import hermite
from pointmass.solvers.islands import moved, number_of

Row = tuple[Fraction, ...]


def row(text: str) -> Row:
    """A row of a tableau from its fractions, as they are printed: ``row("2/9 1/3 4/9")``."""
    return tuple(Fraction(entry) for entry in text.split())


def weighted(weights: Sequence[float], slopes: Sequence[Array]) -> Array | float:
    """w1 k1 + w2 k2 + ..., from left to right and without the terms whose weight is 0; 0 if none is left.

    The order of the additions is part of the method: compiled code that keeps it gives the same bits.
    """
    total: Array | float = 0.0
    first = True
    for weight, slope in zip(weights, slopes, strict=False):
        if weight:
            total = weight * slope if first else total + weight * slope
            first = False
    return total


class ExplicitRungeKutta(Solver):
    """k_i = F(t + c_i h, y + h sum_j a_ij k_j), y1 = y + h sum_i b_i k_i.

    A leaf gives the tableau as exact fractions, and it is checked when the class is defined.

    Attributes
    ----------
    A : row i has the i weights of the stages before it.
    b, c : weights and nodes, one for each stage.

    Raises
    ------
    InvalidInput
        When a leaf is defined whose rows of A do not add up to c, or whose weights do not add up to 1.

    Notes
    -----
    Butcher, Numerical Methods for Ordinary Differential Equations, sec. 23.
    """

    A: ClassVar[tuple[Row, ...]]
    b: ClassVar[Row]
    c: ClassVar[Row]
    _stages: ClassVar[tuple[tuple[float, tuple[float, ...]], ...]]
    _weights: ClassVar[tuple[float, ...]]

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "A" not in vars(cls):  # a family in between
            return
        check_tableau(cls.name, cls.A, cls.b, cls.c)
        cls.evaluations = len(cls.b)
        cls._stages = tuple((float(c), floats(a)) for c, a in zip(cls.c, cls.A, strict=True))
        cls._weights = floats(cls.b)

    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h; the slope there is evaluated only if the error estimate or dense output asks."""
        length = np.asarray(h, y.dtype)
        slopes = self._slopes(system, t, y, h)
        y1 = moved(h, y, y + length * weighted(self._weights, slopes))
        end = cache(lambda: system.deriv_eval(t + h, y1))
        dense = self._dense(length, y, y1, slopes, end)
        return Step(t, h, y, y1, dense, memory, self._error(length, slopes, end))

    def _slopes(self, system: System, t: Clock, y: Array, h: Clock) -> list[Array]:
        length = np.asarray(h, y.dtype)
        slopes: list[Array] = []
        for c, a in self._stages:
            stage = y + length * weighted(a, slopes) if slopes else y
            slopes.append(system.deriv_eval(t + c * h, stage))
        return slopes

    def _error(self, h: Array, slopes: list[Array], end: Callable[[], Array]) -> Array | None:
        return None

    def _dense(
        self, h: Array, y0: Array, y1: Array, slopes: list[Array], end: Callable[[], Array]
    ) -> Callable[[Clock], Array]:
        return hermite(h, y0, y1, lambda: (slopes[0], end()))


class EmbeddedRungeKutta(ExplicitRungeKutta):
    """A Runge-Kutta method with a second set of weights, whose difference estimates the error and sets the step.

    Parameters
    ----------
    rtol, atol : tolerated local error, relative and absolute (in the units of y).
    adaptive : False takes the steps as they are given, and estimates nothing.

    Attributes
    ----------
    b_hat : the second weights; the last one belongs to F(t + h, y1).
    d : weights of the quartic part of the dense output, or None for the cubic of Hermite.
    control : what sets the steps; None if not adaptive.

    Notes
    -----
    An adaptive step evaluates F(t + h, y1) as well, one more than `evaluations` says. The next step does not reuse it:
    a collision may have changed y1.
    """

    b_hat: ClassVar[Row]
    d: ClassVar[Row | None] = None
    _error_weights: ClassVar[tuple[float, ...]]
    _dense_weights: ClassVar[tuple[float, ...] | None]

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        check_weights(cls.name, "b_hat", cls.b_hat)
        cls._error_weights = floats(tuple(b - w for b, w in zip((*cls.b, Fraction(0)), cls.b_hat, strict=True)))
        cls._dense_weights = None if cls.d is None else floats(cls.d)

    def __init__(self, rtol: float = 1e-6, atol: float = 1e-9, adaptive: bool = True) -> None:
        self.rtol = number("rtol", rtol, at_least=0.0)
        self.atol = number("atol", atol, at_least=0.0)
        if self.rtol + self.atol == 0.0:
            raise InvalidInput("rtol and atol are both 0, so no step could be accepted: make one of them positive")
        self.adaptive = bool(adaptive)
        self.control = PIController(self.rtol, self.atol, self.order) if self.adaptive else None

    def start(self, system: System) -> Memory:
        """What the step control knows about each island before its first step."""
        return self.control.start(number_of(system.islands)) if self.control else {}

    def _error(self, h: Array, slopes: list[Array], end: Callable[[], Array]) -> Array | None:
        if not self.adaptive:
            return None
        return moved(h, np.zeros_like(slopes[0]), h * weighted(self._error_weights, [*slopes, end()]))

    def _dense(
        self, h: Array, y0: Array, y1: Array, slopes: list[Array], end: Callable[[], Array]
    ) -> Callable[[Clock], Array]:
        weights = self._dense_weights
        if weights is None:
            return super()._dense(h, y0, y1, slopes, end)
        return hermite(h, y0, y1, lambda: (slopes[0], end()), lambda: h * weighted(weights, [*slopes, end()]))


def floats(fractions: Row) -> tuple[float, ...]:
    """The nearest floats."""
    return tuple(float(fraction) for fraction in fractions)


def check_weights(name: str, what: str, weights: Row) -> None:
    """Raise `InvalidInput` unless the weights add up to 1."""
    if sum(weights) != 1:
        raise InvalidInput(f"the weights {what} of {name} add up to {sum(weights)}, not to 1: correct the tableau")


def check_tableau(name: str, rows: tuple[Row, ...], weights: Row, nodes: Row) -> None:
    """Raise `InvalidInput` unless row i of A has i entries that add up to c_i, and b adds up to 1."""
    check_weights(name, "b", weights)
    if not len(rows) == len(weights) == len(nodes):
        raise InvalidInput(f"A, b and c of {name} have {len(rows)}, {len(weights)} and {len(nodes)} stages")
    for i, (entries, node) in enumerate(zip(rows, nodes, strict=True)):
        if len(entries) != i or sum(entries) != node:
            raise InvalidInput(f"row {i} of A of {name} must have {i} entries that add up to {node}")
