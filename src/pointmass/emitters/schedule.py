"""When births happen: numbers of births to times and back, whatever the step and the frame rate.

Each schedule counts its births from 0 and knows the time of each by its number alone, so that intervals of time that
follow each other contain every birth once.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array

Array = NDArray[np.floating[Any]]
Numbers = NDArray[np.int64]
PANELS = 1024  # of a second: between their ends a rate that changes is taken to be linear
KEPT = 16  # seconds whose panels are kept
LONGEST = 1e6  # seconds for which a rate that changes can be followed


class Schedule(ABC):
    """Births in order of time."""

    @abstractmethod
    def times(self, k: Numbers) -> Array:
        """When births happen [s], by their numbers, shape (k,)."""

    @abstractmethod
    def counts(self, t: Array) -> Numbers:
        """How many births there are before each time, shape (k,)."""


class Steady(Schedule):
    """A constant rate [1/s]: birth k at start + k / rate."""

    def __init__(self, rate: float, start: float, stop: float) -> None:
        self.rate, self.start, self.stop = rate, start, stop

    def times(self, k: Numbers) -> Array:
        return self.start + k / self.rate

    def counts(self, t: Array) -> Numbers:
        late = np.maximum(np.minimum(t, self.stop) - self.start, 0)
        k = np.maximum(np.floor(late * self.rate).astype(np.int64) - 1, 0)
        return _least(self, k, np.minimum(t, self.stop))


class Curve(Schedule):
    """A rate that changes: birth k when the integral of the rate from the start reaches k.

    The rate is looked at 1024 times a second and is linear in between, so the integral is a quadratic there, which is
    inverted by the formula.

    Parameters
    ----------
    rate : [1/s] at times of shape (k,), at least 0.
    """

    def __init__(self, rate: Callable[[Array], Array], start: float, stop: float) -> None:
        self.rate, self.start, self.stop = rate, start, stop
        self._before = [0.0]  # births before each second since the start
        self._seconds: OrderedDict[int, tuple[Array, Array]] = OrderedDict()

    def times(self, k: Numbers) -> Array:
        result = np.full(len(k), np.inf)  # beyond what has been asked for: later
        home = np.searchsorted(self._before, k, side="right") - 1
        for j in np.unique(home[home < len(self._before) - 1]):
            mine = home == j
            result[mine] = self._times_within(int(j), k[mine])
        return result

    def _times_within(self, j: int, k: Numbers) -> Array:
        rates, births = self._second(j)
        i = np.minimum(np.searchsorted(births, k, side="right"), PANELS) - 1
        rest = PANELS * (k - births[i])  # = r0 u + (r1 - r0) u^2 / 2, with u from 0 to 1
        r0, rise = rates[i], rates[i + 1] - rates[i]
        slope = r0 + np.sqrt(np.maximum(r0 * r0 + 2 * rise * rest, 0))
        u = np.minimum(2 * rest / np.where(slope > 0, slope, 1), 1)
        result: Array = self.start + (j + (i + u) / PANELS)
        return result

    def counts(self, t: Array) -> Numbers:
        t = np.minimum(t, self.stop)
        late = np.maximum(t - self.start, 0)
        last = float(late.max(initial=0.0))
        if last > LONGEST:
            raise InvalidInput(
                f"a rate that changes can be followed for {LONGEST:g} s, but not until t = {t.max():g} s"
            )
        while len(self._before) <= math.floor(last) + 1:
            self._before.append(float(self._second(len(self._before) - 1)[1][-1]))
        return _least(self, np.maximum(np.floor(self._integral(late)).astype(np.int64) - 1, 0), t)

    def _integral(self, late: Array) -> Array:
        """Integral of the rate until so many seconds after the start, shape (k,)."""
        result, home = np.zeros(len(late)), np.floor(late)
        for j in np.unique(home):
            mine = home == j
            rates, births = self._second(int(j))
            i = np.floor((late[mine] - j) * PANELS).astype(np.intp)
            u = (late[mine] - j) * PANELS - i
            result[mine] = births[i] + u * (rates[i] + u * (rates[i + 1] - rates[i]) / 2) / PANELS
        return result

    def _second(self, j: int) -> tuple[Array, Array]:
        """Rates [1/s] at the ends of the panels of a second since the start, and how many births there are before."""
        if j not in self._seconds:
            rates = self.rate(self.start + (j + np.arange(PANELS + 1) / PANELS))
            sums = np.cumsum((rates[:-1] + rates[1:]) / (2 * PANELS))
            self._seconds[j] = rates, self._before[j] + np.append(0.0, sums)
            if len(self._seconds) > KEPT:
                self._seconds.popitem(last=False)
        return self._seconds[j]


class Bursts(Schedule):
    """Many births at once.

    Parameters
    ----------
    bursts : pairs of a time [s] and a count, in order of time.
    """

    def __init__(self, bursts: Sequence[tuple[float, int]], start: float, stop: float) -> None:
        pairs = finite_array("bursts", bursts, (None, 2))
        self._at, counts = pairs[:, 0], pairs[:, 1]
        for time, count in pairs.tolist():
            if count != int(count) or not 1 <= count < 2**38:
                raise InvalidInput(f"bursts has the count {count:g}: it must be a whole number, at least 1")
            if not start <= time < stop:
                raise InvalidInput(f"bursts has the time {time:g} s: it must not be before start or after stop")
        if (np.diff(self._at) <= 0).any():
            raise InvalidInput("bursts must be in order of time, each time once")
        self._before = np.append(0, np.cumsum(counts)).astype(np.int64)

    def times(self, k: Numbers) -> Array:
        return self._at[np.searchsorted(self._before[1:], k, side="right")]

    def counts(self, t: Array) -> Numbers:
        return self._before[np.searchsorted(self._at, t, side="left")]


def _least(schedule: Schedule, k: Numbers, t: Array) -> Numbers:
    """The least number, from k on, whose birth is not before t."""
    early = np.ones(len(k), bool)
    while early.any():
        early[early] = schedule.times(k[early]) < t[early]
        k = k + early
    return k
