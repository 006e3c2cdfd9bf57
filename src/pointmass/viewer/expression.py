"""One number from all particles, such as "mean(y)" or "max(speed) - 1": formulas of scene files that gather."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.laws.formula import Formula
from pointmass.viewer.columns import Columns


def _of_some(gather: Callable[[Any], Any]) -> Callable[[Any], float]:
    """Of nobody there is neither a mean nor a largest."""
    return lambda column: float(gather(column)) if np.size(column) else np.nan


GATHERS: dict[str, Callable[[Any], Any]] = {
    "mean": _of_some(np.mean),
    "sum": lambda column: float(np.sum(column)),
    "min": _of_some(np.min),
    "max": _of_some(np.max),
    "std": _of_some(np.std),
}


class Expression:
    """A formula over the particles that gives one number.

    Parameters
    ----------
    text : as formulas of scene files, with mean, sum, min, max and std of all particles.
    names : of the columns that there are.

    Raises
    ------
    InvalidInput
        Not a formula, or a name that is not known.

    Examples
    --------
    >>> Expression("sum(0.5*m*speed**2)", ["m", "speed"])
    """

    def __init__(self, text: str, names: Iterable[str]) -> None:
        self._formula = Formula(text, names, "expression", GATHERS)
        self.text = self._formula.text

    def of(self, columns: Columns) -> float:
        """Its value; NaN where it has none.

        Raises
        ------
        InvalidInput
            It gives a number for each particle, not one of all.
        """
        with np.errstate(all="ignore"):
            value = np.asarray(self._formula({name: columns[name] for name in self._formula.names}), np.float64)
        if value.ndim:
            raise InvalidInput(
                f"expression {self._formula.shown!r} has a number for each particle: gather them, "
                f"such as mean({self._formula.shown})"
            )
        return float(value)
