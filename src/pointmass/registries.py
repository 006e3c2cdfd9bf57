"""What the lists of a scene file may hold: all kinds of each, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pointmass.bodies import BODIES
from pointmass.collisions import COLLIDERS
from pointmass.constraints import CONSTRAINTS
from pointmass.controllers import CONTROLLERS
from pointmass.emitters import EMITTERS
from pointmass.forces import FORCES
from pointmass.motions import MOTIONS
from pointmass.zones import ZONES

LISTS: Mapping[str, Mapping[str, Any]] = {
    "bodies": BODIES,
    "forces": FORCES,
    "colliders": COLLIDERS,
    "emitters": EMITTERS,
    "zones": ZONES,
    "motions": MOTIONS,
    "constraints": CONSTRAINTS,
    "controllers": CONTROLLERS,
}
