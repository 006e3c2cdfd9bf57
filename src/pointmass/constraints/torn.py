"""What a system in which something tears has otherwise than at the start: its elements, surfaces and selections."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.laws.elements import ElementForce
from pointmass.particles import Surface
from pointmass.system import ParticleSystem

State = Mapping[str, NDArray[Any]]
ELEMENTS, MARKS, SURFACES = "elements", "marks", "surfaces"


def torn_state(system: ParticleSystem) -> dict[str, State]:
    """Arrays by name, in groups: see `Simulation.state`."""
    state: dict[str, State] = {
        SURFACES: {str(k): surface.triangles for k, surface in enumerate(system.particles.surfaces.values())}
    }
    for k, force in enumerate(system.forces):
        state[f"{MARKS}{k}"] = dict(force.marks())
        if isinstance(force, ElementForce):
            state[f"{ELEMENTS}{k}"] = force.state()
    return state


def put_torn_state(system: ParticleSystem, state: Mapping[str, State]) -> None:
    """Have what a `torn_state` of the same system says; its particles are there."""
    surfaces = system.particles.surfaces
    for (name, surface), triangles in zip(list(surfaces.items()), state.get(SURFACES, {}).values(), strict=False):
        if not np.array_equal(surface.triangles, triangles):
            surfaces[name] = Surface(np.array(triangles, np.int64), surface.uv, surface.areas, surface.inside)
    for k, force in enumerate(system.forces):
        for name, marks in force.marks():
            if name in state.get(f"{MARKS}{k}", {}):
                marks[:] = state[f"{MARKS}{k}"][name]
        if isinstance(force, ElementForce) and f"{ELEMENTS}{k}" in state:
            force.put_state(state[f"{ELEMENTS}{k}"])
