"""Things made of particles and springs, under their usual names."""

from pointmass.bodies.body import BODIES, Body, join
from pointmass.bodies.chain import chain
from pointmass.bodies.cloth import cloth
from pointmass.bodies.cloth_from_mesh import cloth_from_mesh
from pointmass.bodies.hair import hair
from pointmass.bodies.lattice import lattice
from pointmass.bodies.net import net
from pointmass.bodies.points import points
from pointmass.bodies.scatter import scatter

__all__ = [
    "BODIES",
    "Body",
    "chain",
    "cloth",
    "cloth_from_mesh",
    "hair",
    "join",
    "lattice",
    "net",
    "points",
    "scatter",
]
