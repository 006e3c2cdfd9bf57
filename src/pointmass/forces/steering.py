"""What the laws of steering have in common: they are accelerations, as long as an animal can, of what it sees."""

from __future__ import annotations

import math
from typing import Any

from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn

TRIFLE = 1e-6  # of a cosine: at 360 degrees no rounding hides anybody


def field_of_view(degrees: Scalar) -> Parameter:
    """The full angle of a cone around the velocity."""
    return Parameter("field_of_view", degrees, unit="degrees", at_least=0, at_most=360)


def limit_of(limit: Scalar | None) -> list[Parameter]:
    """The parameter `limit`, or none."""
    return [] if limit is None else [Parameter("limit", limit, unit="m/s^2", at_least=0)]


def sees(way: Any, v: Any, degrees: Any) -> Any:
    """Whether somebody with velocity v sees what lies in a direction; who is at rest sees all around."""
    cosine = fn.cos(math.pi / 360.0 * degrees) - TRIFLE
    return fn.dot(way, v) >= cosine * fn.sqrt(fn.dot(way, way) * fn.dot(v, v))


def limited(a: Any, limit: Any) -> Any:
    """An acceleration, made as short as the limit where it is longer; None = as it is."""
    if limit is None:
        return a
    size = fn.length(a)
    return fn.scale(fn.where(size > limit, limit * fn.inverse(size), 1.0), a)
