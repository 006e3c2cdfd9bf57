"""A piece of a straight line that attracts."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput
from pointmass.forces.pull import Pull
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class LineAttractor(Pull):
    """f = -m strength d / (d^2 + eps^2)^((power + 1) / 2), d from the nearest place between a and b.

    A negative strength repels. An endless line has its ends far away.

    Parameters
    ----------
    a, b : its ends [m]; may move as functions of t.
    strength : acceleration 1 m from the line [m/s^2].
    power : how the pull falls off: 0 is the same at all distances, 1 that of a heavy line, 2 that of a point, -1 a
        spring.
    eps : softening length [m], above 0: nearer to the line the pull goes to 0.
    reach : distance at which the pull has smoothly ended [m], by a factor (1 - d^2/reach^2)^2; None = never.

    Examples
    --------
    >>> pm.LineAttractor((0, 0, 0), (0, 2, 0), strength=3.0, power=1.0, reach=1.5)
    """

    def __init__(
        self,
        a: Vector = (0.0, 0.0, 0.0),
        b: Vector = (0.0, 1.0, 0.0),
        strength: Scalar = 1.0,
        power: Scalar = 1.0,
        eps: Scalar = 0.05,
        reach: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        ends = [Parameter("a", a, vector=True, unit="m"), Parameter("b", b, vector=True, unit="m")]
        if ends[0].constant and ends[1].constant and ends[0].at(0.0) == ends[1].at(0.0):
            raise InvalidInput(f"a and b of a line attractor are both {a}: they must be different places")
        super().__init__(ends, strength, power, eps, reach, on, enabled)

    def ways(self, x: Any, own: dict[str, Any]) -> list[Any]:
        line, d = fn.sub(own["b"], own["a"]), fn.sub(x, own["a"])
        along = fn.dot(d, line) * fn.inverse(fn.dot(line, line))
        return [fn.sub(d, fn.scale(fn.maximum(fn.minimum(along, 1.0), 0.0), line))]
