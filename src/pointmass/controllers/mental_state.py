"""Hunger, libido and fear of fish, each from 0 to 1 (Tu & Terzopoulos, SIGGRAPH 1994)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
P0, P1 = 0.00067, 0.0025  # rates of digestion and of libido [1/s]
SEEN_FOOD, SEEN_MATE = 0.8, 0.5  # weights of what is seen
FOOD, MATE = (0.05, 0.2), (0.025, 0.1)  # stimuli 1/distance at which it begins to count, and counts in full


def stimulus(s: Any, low: float, high: float) -> Array:
    """0 below `low`, 1 above `high`, and (s - low)/(2 high - low - s) in between; s is 1 over the distance."""
    s = np.asarray(s, np.float64)
    inner = np.clip(s, low, high)
    return np.asarray((inner - low) / (2 * high - low - inner))


def hunger(meals: Any, since: Any, appetite: Any, seen: Any = 0.0) -> Array:
    """min(1 - n R(t)/appetite + 0.8 S, 1), at least 0, with R(t) = 1 - p0 t, at least 0.

    Parameters
    ----------
    meals : n, eaten so far.
    since : the last one [s].
    appetite : meals that fill.
    seen : the stimulus S of food.
    """
    digested = np.maximum(1.0 - P0 * np.asarray(since), 0.0)
    return np.asarray(np.clip(1.0 - np.asarray(meals) * digested / appetite + SEEN_FOOD * np.asarray(seen), 0.0, 1.0))


def libido(since: Any, hungry: Any, seen: Any = 0.0) -> Array:
    """min(p1 t (1 - H) + 0.5 S, 1), at least 0, for the time t since the last mating [s]."""
    grown = P1 * np.asarray(since) * (1.0 - np.asarray(hungry))
    return np.asarray(np.clip(grown + SEEN_MATE * np.asarray(seen), 0.0, 1.0))


def fear(distances: Any, reach: float) -> tuple[Array, Array]:
    """min(sum F_i, 1) and the largest F_i = min(reach/d_i, 1), of predators at distances (n, k); inf = none."""
    each = np.minimum(reach / np.maximum(np.asarray(distances, np.float64), 1e-12), 1.0)
    return np.minimum(each.sum(axis=-1), 1.0), each.max(axis=-1, initial=0.0)
