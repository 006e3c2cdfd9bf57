"""Colliders as numbers that laws of fields take: where they are, their distance and their normal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Any, Protocol

from pointmass.errors import InvalidInput, shown
from pointmass.laws.parameter import Parameter
from pointmass.tracing import functions as fn

Triple = tuple[Any, ...]


class Solid(Protocol):
    """What a collider tells about its shape: see `collisions.Collider`."""

    @property
    def distance_law(self) -> Callable[..., Any]:
        """Signed distance [m]."""

    @property
    def normal_law(self) -> Callable[..., Any]:
        """Unit normal."""

    @property
    def shape(self) -> tuple[float, ...]:
        """Numbers that the laws take."""

    @property
    def surfaces(self) -> Sequence[Any]:
        """Parts with a smooth distance."""

    @property
    def lookup(self) -> str:
        """In what data the distance is looked up; "" where there are laws."""


class Solids:
    """Colliders that a field is about.

    Attributes
    ----------
    surfaces : their parts with a smooth distance.
    parameters : of the law: place and shape of each.

    Parameters
    ----------
    around : a collider or a list of them.
    needed : what they are for, such as "to avoid", where there must be one.

    Raises
    ------
    InvalidInput
        Something else, a collider without a formula, or none where one is needed.
    """

    def __init__(self, around: Any, needed: str = "") -> None:
        solids = list(around) if isinstance(around, (list, tuple)) else [around]
        for solid in solids:
            if not hasattr(solid, "distance_law"):
                raise InvalidInput(f"around must be a list of colliders, such as [Sphere()], not {shown(around)}")
            if solid.lookup:
                raise InvalidInput(
                    f"around holds a {solid.name}, but fields know surfaces that have a formula: use spheres, boxes, "
                    "capsules or cylinders about as large"
                )
        self.surfaces = [surface for solid in solids for surface in solid.surfaces]
        if needed and not self.surfaces:
            raise InvalidInput(f"around = [] is not allowed: give the colliders {needed}, such as [Sphere()]")
        self.parameters: list[Parameter] = []
        for k, surface in enumerate(self.surfaces):
            place = copy(surface.motion.parameters[0])
            place.name = f"around{k}_place"
            numbers = (Parameter(f"around{k}_{j}", number) for j, number in enumerate(surface.shape))
            self.parameters += [place, *numbers]

    def pushes(self, x: Triple, own: Mapping[str, Any], push: Callable[[Any, Triple], Any]) -> Triple:
        """Force of all surfaces, each along its normal, with the strength `push(distance, normal)` [N]."""
        force: Triple = (0.0, 0.0, 0.0)
        for distance, normal in self.met(x, own):
            force = fn.add(force, fn.scale(push(distance, normal), normal))
        return force

    def met(self, x: Triple, own: Mapping[str, Any]) -> list[tuple[Any, Triple]]:
        """Signed distance [m] from each surface, and its normal.

        Parameters
        ----------
        own : values of the law's parameters by name.
        """
        result = []
        for k, surface in enumerate(self.surfaces):
            from_place = fn.sub(x, own[f"around{k}_place"])
            shape = [own[f"around{k}_{j}"] for j in range(len(surface.shape))]
            result.append((surface.distance_law(from_place, *shape), surface.normal_law(from_place, *shape)))
        return result
