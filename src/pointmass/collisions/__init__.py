"""Bouncing off the walls: surfaces, detection of impacts, response, resting contact."""

from pointmass.collisions.box import Box
from pointmass.collisions.capsule import Capsule
from pointmass.collisions.collider import Collider
from pointmass.collisions.cylinder import Cylinder
from pointmass.collisions.distance_grid import DistanceGrid
from pointmass.collisions.height_field import HeightField
from pointmass.collisions.mesh import Mesh
from pointmass.collisions.plane import Plane
from pointmass.collisions.polygon import Polygon
from pointmass.collisions.response import respond, respond_pair
from pointmass.collisions.sphere import Sphere

COLLIDERS: dict[str, type[Collider]] = {
    "plane": Plane,
    "sphere": Sphere,
    "box": Box,
    "polygon": Polygon,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "height_field": HeightField,
    "mesh": Mesh,
    "distance_grid": DistanceGrid,
}

__all__ = [
    "COLLIDERS",
    "Box",
    "Capsule",
    "Collider",
    "Cylinder",
    "DistanceGrid",
    "HeightField",
    "Mesh",
    "Plane",
    "Polygon",
    "Sphere",
    "respond",
    "respond_pair",
]
