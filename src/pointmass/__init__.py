"""pointmass: particle systems.

A particle system is a collection of point masses that obeys some physical laws. Forces are objects that add into
accumulators, a solver knows a system by four verbs, and a law of your own is a few lines of Python.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "pointmass.bodies": "BODIES Body chain lattice points scatter",
    "pointmass.cache": "Cache record",
    "pointmass.collisions": "COLLIDERS Box Collider Plane Polygon Sphere respond respond_pair",
    "pointmass.emitters": "EMITTERS Emitter Nozzle",
    "pointmass.errors": "Diverged InvalidInput PointmassError",
    "pointmass.forces": "FORCES Angles Attractor Drag Field Flow Force Gravitation Gravity Harmonic Magnetic PointVortices"
    " QuadraticDrag Springs Vortex Wind load_grid",
    "pointmass.frame": "Arrows Camera Curves Frame Points Segments Triangles",
    "pointmass.laws.arrays": "ArrayForce array_force",
    "pointmass.laws.elements": "element_force spring_force",
    "pointmass.laws.functions": "absolute add atan2 cos cross dot exp floor inverse length log maximum minimum pow scale sin"
    " sqrt sub tan where",
    "pointmass.laws.grid": "Grid",
    "pointmass.laws.unary": "unary_force velocity_field",
    "pointmass.look": "Look",
    "pointmass.particles": "Particles",
    "pointmass.scene": "Scene body_of",
    "pointmass.scenes": "SCENES",
    "pointmass.simulation": "Simulation",
    "pointmass.solvers": "SOLVERS Euler SymplecticEuler Midpoint Heun RK4 Leapfrog Yoshida4 BogackiShampine"
    " DormandPrince ImplicitEuler ImplicitMidpoint BDF2 Event FunctionSystem integrate",
    "pointmass.stability": "Stability",
    "pointmass.system": "ParticleSystem",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = ["__version__", *sorted(_HOME)]  # noqa: PLE0604  # names from the table


def __getattr__(name: str) -> Any:
    """Import a public name from its home on first use: `import pointmass` itself loads nothing."""
    if name not in _HOME:
        raise AttributeError(f"pointmass has no {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
