"""Things made of particles and springs, under their usual names."""

from pointmass.bodies.body import BODIES, Body, join
from pointmass.bodies.chain import chain
from pointmass.bodies.hair import hair
from pointmass.bodies.lattice import lattice
from pointmass.bodies.points import points
from pointmass.bodies.scatter import scatter

__all__ = ["BODIES", "Body", "chain", "hair", "join", "lattice", "points", "scatter"]
