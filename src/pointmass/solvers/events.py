"""When something happens inside a step: roots of many functions at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, final

import numpy as np

from pointmass.errors import whole_number
from pointmass.solvers.base import Array

ULPS = 4.0  # width of the final bracket, in roundings of its larger end


@final
@dataclass(frozen=True)
class Event:
    """Something that happens when g(t, y) changes its sign.

    Attributes
    ----------
    g : (t, y) -> number, with t a number and y of shape (dim,).
    terminal : the run ends there.
    direction : 1 only from negative to positive, -1 only back, 0 both.
    """

    g: Callable[[float, Array], float]
    terminal: bool = False
    direction: Literal[-1, 0, 1] = 0


def first_root(
    g: Callable[[Array], Array], low: Array, high: Array, *, pieces: int = 1, resolution: float = 0.0
) -> tuple[Array, Array, Array, Array]:
    """The first change of sign of each lane of g, between two numbers a few roundings apart.

    Parameters
    ----------
    g : shape (k,) -> shape (k,); lane i sees only its own argument.
    low, high : where to look, low <= high, shape (k,).
    pieces : equal parts of each bracket that are looked at first; two changes of sign in one part are not seen.

    resolution : a bracket of this width is narrow enough anyway; 0 = a few roundings of its ends.

    Returns
    -------
    low, high, g_low, g_high
        Both sides of each root and the values there, shape (k,): one is negative, the other is not (0 counts as
        positive). NaN in lanes without a root.

    Notes
    -----
    The ITP method of Oliveira and Takahashi, ACM Trans. Math. Softw. 47 (2020), 5, with their kappa_1 = 0.2/(b - a),
    kappa_2 = 2 and n_0 = 1: never more than one evaluation above bisection, and superlinear on smooth functions.
    """
    a, b, fa, fb = _first_piece(g, np.array(low, np.float64), np.array(high, np.float64), pieces)
    found = (fa >= 0.0) != (fb >= 0.0)
    width = np.where(found, b - a, 0.0)
    goal = ULPS * np.finfo(np.float64).eps * np.maximum(np.maximum(np.abs(a), np.abs(b)), np.finfo(np.float64).tiny)
    goal = np.maximum(goal, resolution)
    half = np.maximum(np.ceil(np.log2(np.maximum(width / goal, 1.0))), 0.0) + 1.0  # bisections, and n_0
    for k in range(int(half.max(initial=0.0)) + 1):
        open_ = found & (b - a > goal)
        if not open_.any():
            break
        x = _itp(a, b, fa, fb, width, goal, 0.5 * goal * 2.0 ** (half - k))
        fx = g(np.where(open_, x, a))
        left = (fx >= 0.0) == (fa >= 0.0)
        a, fa = np.where(open_ & left, x, a), np.where(open_ & left, fx, fa)
        b, fb = np.where(open_ & ~left, x, b), np.where(open_ & ~left, fx, fb)
    low, high, g_low, g_high = (np.where(found, side, np.nan) for side in (a, b, fa, fb))
    return low, high, g_low, g_high


def _itp(a: Array, b: Array, fa: Array, fb: Array, width: Array, goal: Array, reach: Array) -> Array:
    """Interpolate, truncate towards the middle, project into what bisection would have left of the bracket.

    The truncation is at least a quarter of the goal: less would be lost in round-off, and the far side never follow.
    """
    middle, gap = 0.5 * (a + b), b - a
    slope = np.where(fb == fa, 1.0, fb - fa)
    secant = np.where(np.abs(fa) <= np.abs(fb), a - fa * (gap / slope), b - fb * (gap / slope))
    secant = np.where(np.isfinite(secant), secant, middle)
    side = np.sign(middle - secant)
    cut = np.maximum(0.2 * gap * gap / np.where(width > 0.0, width, 1.0), 0.25 * goal)
    truncated = np.where(cut <= np.abs(middle - secant), secant + side * cut, middle)
    spare = np.maximum(reach - 0.5 * gap, 0.0)
    x = np.where(np.abs(truncated - middle) <= spare, truncated, middle - side * spare)
    return np.clip(x, a, b)


def _first_piece(
    g: Callable[[Array], Array], low: Array, high: Array, pieces: int
) -> tuple[Array, Array, Array, Array]:
    """The first part of each bracket in which g changes its sign; the last one if none does."""
    pieces = whole_number("pieces", pieces, at_least=1)
    a, fa = low, g(low)
    b, fb = a, fa
    for k in range(1, pieces + 1):
        searching = (fa >= 0.0) == (fb >= 0.0)
        x = high if k == pieces else low + (high - low) * (k / pieces)
        fx = g(x)
        a, fa = np.where(searching, b, a), np.where(searching, fb, fa)
        b, fb = np.where(searching, x, b), np.where(searching, fx, fb)
    return a, b, fa, fb
