"""A sphere that emits particles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter
from pointmass.errors import number, unknown
from pointmass.random import on_sphere
from pointmass.tracing import functions as fn

Where = Literal["surface", "volume"]


@dataclass(eq=False, repr=False)
class SphereEmitter(ShapedEmitter):
    """Particles evenly spread over a sphere; its normals go outwards.

    Parameters
    ----------
    radius : [m], at least 0.
    where : "surface" or "volume".
    """

    radius: float = 0.5
    where: Where = "surface"

    def __post_init__(self) -> None:
        super().__post_init__()
        number("radius", self.radius, at_least=0, unit="m")
        check_where(self.where)

    def spot(self, u: Array) -> tuple[Array, Array]:
        normal = on_sphere(u[:, :2])
        depth = fn.pow(u[:, 2:3], 1 / 3) if self.where == "volume" else 1.0  # as much in each shell as it has room
        return self.radius * depth * normal, normal


def check_where(where: str) -> None:
    """Refuse anything but the two parts of a body.

    Raises
    ------
    InvalidInput
        Neither "surface" nor "volume".
    """
    if where not in ("surface", "volume"):
        raise unknown("value of where:", where, ("surface", "volume"))
