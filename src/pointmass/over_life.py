"""Curves and gradients over a particle's life: values at fractions of its lifetime, straight between them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import PALETTES, Color, blackbody, linear
from pointmass.errors import InvalidInput, number, shown, unknown

Array = NDArray[np.floating[Any]]
Curve = str | tuple[tuple[float, float], ...]  # pairs of a fraction in [0, 1] and a value, or a name
Gradient = str | tuple[tuple[float, Color], ...]  # pairs of a fraction in [0, 1] and a colour, or a name

CURVES: dict[str, tuple[tuple[float, float], ...]] = {
    "grow": ((0.0, 0.0), (1.0, 1.0)),
    "fade": ((0.0, 1.0), (1.0, 0.0)),
    "last": ((0.0, 1.0), (0.7, 1.0), (1.0, 0.0)),  # as long as it can
    "swell": ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)),
    "flare": ((0.0, 0.0), (0.1, 1.0), (1.0, 0.0)),
}
GRADIENTS: dict[str, tuple[tuple[float, Color], ...]] = {
    "cooling": ((0.0, 3600.0), (0.6, 1800.0), (1.0, 1000.0)),
    **{name: tuple(zip(np.linspace(0, 1, len(c)).tolist(), c, strict=True)) for name, c in PALETTES.items()},
}


def as_curve(name: str, value: Any, at_most: float | None = None) -> Curve:
    """The curve that a parameter describes, checked.

    Raises
    ------
    InvalidInput
        A name that is not known, fractions outside [0, 1] or out of order, values below 0 or above `at_most`.
    """
    if isinstance(value, str):
        if value not in CURVES:
            raise unknown(f"curve in {name}:", value, CURVES)
        return value
    pairs = _pairs(name, value)
    return tuple((f, number(f"the value at {f} of {name}", v, at_least=0, at_most=at_most)) for f, v in pairs)


def as_gradient(name: str, value: Any) -> Gradient:
    """The gradient that a parameter describes, checked.

    Raises
    ------
    InvalidInput
        A name or a colour that is not known, fractions outside [0, 1] or out of order.
    """
    if isinstance(value, str):
        if value not in GRADIENTS:
            raise unknown(f"gradient in {name}:", value, GRADIENTS)
        return value
    pairs = _pairs(name, value)
    for _, color in pairs:
        linear(color)
    return tuple(pairs)


def values(curve: Curve, life: Array) -> Array:
    """Values of a curve at fractions of the life, shape (n,); before its first and after its last pair it is level."""
    fractions, heights = zip(*(CURVES[curve] if isinstance(curve, str) else curve), strict=True)
    result: Array = np.interp(life, fractions, heights)
    return result


def colors(gradient: Gradient, life: Array) -> Array:
    """Linear RGB of a gradient at fractions of the life, shape (n, 3).

    Between two temperatures the temperature changes evenly, between other colours their light.
    """
    fractions, given = zip(*(GRADIENTS[gradient] if isinstance(gradient, str) else gradient), strict=True)
    if not any(isinstance(color, str) for color in given):
        return blackbody(np.interp(life, fractions, given))
    light = np.array([linear(color) for color in given])
    return np.stack([np.interp(life, fractions, light[:, k]) for k in range(3)], axis=1)


def _pairs(name: str, value: Any) -> list[tuple[float, Any]]:
    """Pairs with fractions that rise within [0, 1]."""
    listed = isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0
    if not listed or not all(isinstance(p, Sequence) and not isinstance(p, str) and len(p) == 2 for p in value):
        raise InvalidInput(
            f"{name} must be a list of pairs such as [[0, 1], [1, 0.5]], or the name of one, not {shown(value)}"
        )
    fractions = [number(f"a fraction of {name}", fraction, at_least=0, at_most=1) for fraction, _ in value]
    for before, after in pairwise(fractions):
        if not before < after:
            raise InvalidInput(f"{name} is out of order: its fractions must rise, but {after} comes after {before}")
    return [(fraction, item) for fraction, (_, item) in zip(fractions, value, strict=True)]
