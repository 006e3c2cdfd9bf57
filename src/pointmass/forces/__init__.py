"""Forces, one to a file: each is a law with its parameters. A new one is a file, a line in `FORCES` and a test."""

from __future__ import annotations

from pointmass.errors import unknown
from pointmass.forces.angles import Angles
from pointmass.forces.attractor import Attractor
from pointmass.forces.avoid import Avoid
from pointmass.forces.bulk import Bulk
from pointmass.forces.buoyancy import Buoyancy
from pointmass.forces.cruise import Cruise
from pointmass.forces.curl_noise import CurlNoise
from pointmass.forces.cushion import Cushion
from pointmass.forces.diffusion import Diffusion
from pointmass.forces.drag import Drag
from pointmass.forces.field import Field
from pointmass.forces.fins import Fins
from pointmass.forces.flee import Flee
from pointmass.forces.flocking import Flocking
from pointmass.forces.flow import Flow
from pointmass.forces.flutter import Flutter
from pointmass.forces.gravitation import Gravitation
from pointmass.forces.gravity import Gravity
from pointmass.forces.grid_files import load_grid
from pointmass.forces.gust import Gust
from pointmass.forces.harmonic import Harmonic
from pointmass.forces.hinges import Hinges
from pointmass.forces.lennard_jones import LennardJones
from pointmass.forces.line_attractor import LineAttractor
from pointmass.forces.magnetic import Magnetic
from pointmass.forces.muscles import Muscles
from pointmass.forces.plate_wind import PlateWind
from pointmass.forces.point_vortices import PointVortices
from pointmass.forces.quadratic_drag import QuadraticDrag
from pointmass.forces.ring_attractor import RingAttractor
from pointmass.forces.scales import Scales
from pointmass.forces.seek import Seek
from pointmass.forces.slender_drag import SlenderDrag
from pointmass.forces.soft_sphere import SoftSphere
from pointmass.forces.springs import Springs
from pointmass.forces.surface_attractor import SurfaceAttractor
from pointmass.forces.volumes import Volumes
from pointmass.forces.vortex import Vortex
from pointmass.forces.vortex_line import VortexLine
from pointmass.forces.vortex_ring import VortexRing
from pointmass.forces.water import Water
from pointmass.forces.wind import Wind
from pointmass.laws.force import Force

FORCES: dict[str, type[Force]] = {
    "gravity": Gravity,
    "drag": Drag,
    "quadratic_drag": QuadraticDrag,
    "springs": Springs,
    "muscles": Muscles,
    "scales": Scales,
    "slender_drag": SlenderDrag,
    "angles": Angles,
    "hinges": Hinges,
    "volumes": Volumes,
    "bulk": Bulk,
    "attractor": Attractor,
    "line_attractor": LineAttractor,
    "ring_attractor": RingAttractor,
    "surface_attractor": SurfaceAttractor,
    "cushion": Cushion,
    "harmonic": Harmonic,
    "gravitation": Gravitation,
    "lennard_jones": LennardJones,
    "soft_sphere": SoftSphere,
    "flocking": Flocking,
    "flee": Flee,
    "seek": Seek,
    "avoid": Avoid,
    "cruise": Cruise,
    "vortex": Vortex,
    "vortex_line": VortexLine,
    "vortex_ring": VortexRing,
    "point_vortices": PointVortices,
    "curl_noise": CurlNoise,
    "gust": Gust,
    "flutter": Flutter,
    "diffusion": Diffusion,
    "wind": Wind,
    "plate_wind": PlateWind,
    "water": Water,
    "fins": Fins,
    "field": Field,
    "flow": Flow,
    "buoyancy": Buoyancy,
    "magnetic": Magnetic,
}

__all__ = [
    "FORCES",
    "Angles",
    "Attractor",
    "Avoid",
    "Bulk",
    "Buoyancy",
    "Cruise",
    "CurlNoise",
    "Cushion",
    "Diffusion",
    "Drag",
    "Field",
    "Fins",
    "Flee",
    "Flocking",
    "Flow",
    "Flutter",
    "Force",
    "Gravitation",
    "Gravity",
    "Gust",
    "Harmonic",
    "Hinges",
    "LennardJones",
    "LineAttractor",
    "Magnetic",
    "Muscles",
    "PlateWind",
    "PointVortices",
    "QuadraticDrag",
    "RingAttractor",
    "Scales",
    "Seek",
    "SlenderDrag",
    "SoftSphere",
    "Springs",
    "SurfaceAttractor",
    "Volumes",
    "Vortex",
    "VortexLine",
    "VortexRing",
    "Water",
    "Wind",
    "find_force",
    "load_grid",
]


def find_force(name: str) -> type[Force]:
    """The class of a force by its name in scene files, such as "quadratic_drag".

    Raises
    ------
    InvalidInput
        No such force; the known ones are listed.
    """
    if name not in FORCES:
        raise unknown("force", name, FORCES)
    return FORCES[name]
