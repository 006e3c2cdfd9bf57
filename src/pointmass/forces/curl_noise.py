"""Turbulent air: a velocity field that is random, smooth and free of divergence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from math import sqrt
from typing import Any, Protocol

from pointmass.errors import InvalidInput, shown, whole_number
from pointmass.laws.parameter import Parameter, Scalar, seed_parameter
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn
from pointmass.tracing.derivative import gradient
from pointmass.tracing.noise import OFFSETS, mean_square, single

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


class CurlNoise(VelocityField):
    """x' = curl psi, psi a noise of three components: whirls that carry particles without crowding them.

    The divergence is 0 exactly. At a distance d from a solid, psi' = a psi + (1 - a) n (n . psi) with the normal n and
    a = ramp(d / distance), so that nothing flows through its surface; several solids may be near each other.

    Parameters
    ----------
    length : size of the largest whirls [m], above 0.
    speed : root mean square of the speed, far from solids [m/s].
    rate : how often the pattern becomes another one [1/s], at least 0; with the number 0 it stands still.
    octaves : sizes of whirls, each half as large as the one before.
    gain : speed of an octave relative to the one before, at least 0.
    seed : a whole number; others give other fields.
    around : colliders that the air flows around, or within.
    distance : how far a solid is felt [m], above 0; by default `length`.

    Notes
    -----
    Bridson, Hourihan & Nordenstam, Curl-noise for procedural fluid flow (SIGGRAPH 2007). The solids stand in the flow
    where they are at t, and do not push it.

    Examples
    --------
    >>> air = pm.CurlNoise(length=0.5, speed=2.0, around=[pm.Sphere((0, 1, 0), 0.3)])
    >>> system = pm.ParticleSystem(smoke, forces=[pm.Wind(air, k=0.1)])
    """

    def __init__(
        self,
        length: Scalar = 1.0,
        speed: Scalar = 1.0,
        rate: Scalar = 0.5,
        octaves: int = 3,
        gain: Scalar = 0.5,
        seed: int = 0,
        around: Sequence[Solid] = (),
        distance: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.octaves = whole_number("octaves", octaves, at_least=1)
        self.solids = [surface for solid in _listed(around) for surface in solid.surfaces]
        parameters = [
            Parameter("length", length, unit="m", above=0),
            Parameter("speed", speed, unit="m/s"),
            Parameter("gain", gain, at_least=0),
            seed_parameter(seed),
            Parameter("rate", rate, unit="1/s", at_least=0),
        ]
        self.still = parameters[-1].constant and parameters[-1].at(0.0) == (0.0,)
        if self.still:
            parameters.pop()
        if distance is not None:
            parameters.append(Parameter("distance", distance, unit="m", above=0))
        for k, solid in enumerate(self.solids):
            place = copy(solid.motion.parameters[0])
            place.name = f"around{k}_place"
            parameters += [place, *(Parameter(f"around{k}_{j}", number) for j, number in enumerate(solid.shape))]
        super().__init__(parameters, on, enabled)

    def law(self, x: Any, t: Any, *parameters: Any) -> Any:
        """Velocity [m/s]."""
        own = dict(zip(self.parameters, parameters, strict=True))
        psi = self._around_solids(x, self._noise(x, None if self.still else t * own["rate"], own), own)
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = (gradient(part, x) for part in psi)
        return zy - yz, xz - zx, yx - xy

    def _noise(self, x: Triple, t: Any, own: dict[str, Any]) -> Triple:
        """The stream function [m^2/s] in free space."""
        gain, size = own["gain"], own["length"]
        octaves = [(2.0**k, gain**k) for k in range(self.octaves)]
        square = sum(g * g for _, g in octaves[1:]) + 1.0
        unit = 1.0 / sqrt(6.0 * mean_square((1, 0, 0), not self.still))  # each component has two slopes of one noise
        psi: list[Any] = [0.0, 0.0, 0.0]
        for k, (fine, g) in enumerate(octaves):
            place = [fine / size * a + k * o for a, o in zip(x, OFFSETS, strict=True)]
            now = place if t is None else [*place, t]
            for c in range(3):
                psi[c] = psi[c] + g / fine * single(now, own["seed"] + 65536.0 * k, c)
        return fn.scale(own["speed"] * size * unit / fn.sqrt(square), tuple(psi))

    def _around_solids(self, x: Triple, psi: Triple, own: dict[str, Any]) -> Triple:
        """The stream function that no surface is crossed by: on each, it points along the normal."""
        normals, ramps, reach = [], [], own.get("distance", own["length"])
        for k, solid in enumerate(self.solids):
            from_place = fn.sub(x, own[f"around{k}_place"])
            shape = [own[f"around{k}_{j}"] for j in range(len(solid.shape))]
            normals.append(solid.normal_law(from_place, *shape))
            ramps.append(_ramp(solid.distance_law(from_place, *shape) / reach))
        result = fn.scale(_product(ramps), psi)
        for k, (n, a) in enumerate(zip(normals, ramps, strict=True)):
            others = _product([*ramps[:k], *ramps[k + 1 :]])
            result = fn.add(result, fn.scale(others * (1.0 - a) * fn.dot(n, psi), n))
        return result


def _ramp(r: Any) -> Any:
    """From -1 to 1, smooth at both ends (Bridson 2007)."""
    r = fn.maximum(fn.minimum(r, 1.0), -1.0)
    square = r * r
    return r * (1.875 + square * (0.375 * square - 1.25))


def _product(factors: Sequence[Any]) -> Any:
    result: Any = 1.0
    for factor in factors:
        result = result * factor
    return result


def _listed(around: Any) -> list[Any]:
    solids = list(around) if isinstance(around, (list, tuple)) else [around]
    for solid in solids:
        if not hasattr(solid, "distance_law"):
            raise InvalidInput(f"around must be a list of colliders, such as [Sphere()], not {shown(around)}")
        if solid.lookup:
            raise InvalidInput(
                f"around holds a {solid.name}, but air flows around surfaces that have a formula: use spheres, boxes, "
                "capsules or cylinders about as large"
            )
    return solids
