"""The state inside a step."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from pointmass.solvers.base import Array, Clock
from pointmass.solvers.islands import moved


def hermite(
    h: Clock, y0: Array, y1: Array, slopes: Callable[[], tuple[Array, Array]], bump: Callable[[], Array] | None = None
) -> Callable[[Clock], Array]:
    """The cubic that has the values and slopes of both ends, plus a quartic bump that vanishes there.

    Parameters
    ----------
    h : length of the step [s], a number or shape (dim,).
    y0, y1 : both ends, shape (dim,); they are met to the bit.
    slopes : dy/dt at both ends, asked for once, when the first value is.
    bump : coefficient of theta^2 (1 - theta)^2, shape (dim,), or None for the plain cubic.

    Returns
    -------
    theta in [0, 1], a number or shape (dim,) -> state, shape (dim,).

    Notes
    -----
    The nested form of Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sec. II.6 (CONTD5).
    """

    @cache
    def coefficients() -> tuple[Array, Array, Array, Array | float]:
        f0, f1 = slopes()
        rise = y1 - y0
        left = h * f0 - rise
        return rise, left, rise - h * f1 - left, 0.0 if bump is None else bump()

    def state(theta: Clock) -> Array:
        rise, left, right, top = coefficients()
        rest = 1.0 - theta
        inside = y0 + theta * (rise + rest * (left + theta * (right + rest * top)))
        return moved(h, y0, np.where(np.equal(theta, 1.0), y1, np.where(np.equal(theta, 0.0), y0, inside)))

    return state


def straight(h: Clock, y0: Array, y1: Array, second_order: bool) -> Callable[[Clock], Array]:
    """Straight lines; the positions of an order 2 system follow the cubic of both positions and velocities.

    For implicit methods: accelerations of stiff systems at the ends say nothing about the inside of a long step, and
    a straight line never overshoots. Its error, h^2 times the second derivative over 8, is of the order of theirs.
    """
    n = len(y0) // 2
    still = np.zeros(n)

    def slopes() -> tuple[Array, Array]:
        return np.concatenate([y0[n:], still]), np.concatenate([y1[n:], still])

    cubic = hermite(h, y0, y1, slopes)
    positions = np.arange(len(y0)) < n

    def line(theta: Clock) -> Array:
        inside = np.where(np.equal(theta, 1.0), y1, y0 + theta * (y1 - y0))
        return moved(h, y0, np.where(positions, cubic(theta), inside) if second_order else inside)

    return line
