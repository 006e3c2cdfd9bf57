"""The backward differentiation formula of order 2."""

from __future__ import annotations

from typing import ClassVar, final

import numpy as np

from pointmass.solvers.base import Array, Memory, System
from pointmass.solvers.implicit import Implicit

LARGEST_RATIO = 1.0 + 2.0**0.5  # of successive steps, beyond which the method is unstable


@final
class BDF2(Implicit):
    """The parabola through y_before, y and y1 has slope F(t + h, y1) at its end: order 2, stable for every h.

    With w = h/h_before, y1 = y + w^2/(1 + 2w) (y - y_before) + h (1 + w)/(1 + 2w) F(t + h, y1). Entries without
    history (h_before infinite, w = 0) take a step of backward Euler, and so do those whose step grows more than
    2.4 times. It damps stiff modes like backward Euler, and resolved ones far less.

    Notes
    -----
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sec. III.5 (variable steps).
    """

    name: ClassVar[str] = "bdf2"
    order: ClassVar[int] = 2
    history: ClassVar[tuple[str, ...]] = ("y_before",)

    def start(self, system: System) -> Memory:
        """No history."""
        return {**super().start(system), "y_before": np.zeros(system.dim), "h_before": np.full(system.dim, np.inf)}

    def _stage(self, y: Array, h: Array, memory: Memory) -> tuple[Array, Array]:
        ratio = h / memory["h_before"]
        w = np.where(ratio > LARGEST_RATIO, 0.0, ratio)
        z = y + w * w / (1.0 + 2.0 * w) * (y - memory["y_before"])
        return z, h * (1.0 + w) / (1.0 + 2.0 * w)

    def _remember(self, y: Array, h: Array, memory: Memory) -> Memory:
        """The start of this step."""
        still = h == 0.0
        return {
            **memory,
            "y_before": np.where(still, memory["y_before"], y),
            "h_before": np.where(still, memory["h_before"], h),
        }
