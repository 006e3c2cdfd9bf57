"""Things made of particles and springs, under their usual names."""

from pointmass.bodies.body import BODIES, Body, join
from pointmass.bodies.chain import chain
from pointmass.bodies.cloth import cloth
from pointmass.bodies.cloth_from_mesh import cloth_from_mesh
from pointmass.bodies.cloud import cloud
from pointmass.bodies.fish import fish
from pointmass.bodies.hair import hair
from pointmass.bodies.jelly import jelly
from pointmass.bodies.lattice import lattice
from pointmass.bodies.net import net
from pointmass.bodies.points import points
from pointmass.bodies.scatter import scatter
from pointmass.bodies.snake import snake, worm

__all__ = [
    "BODIES",
    "Body",
    "chain",
    "cloth",
    "cloth_from_mesh",
    "cloud",
    "fish",
    "hair",
    "jelly",
    "join",
    "lattice",
    "net",
    "points",
    "scatter",
    "snake",
    "worm",
]
