"""A run goes on as that of a scene that was built anew, where that can be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pointmass.collisions.collider import Collider
from pointmass.description import Described, same
from pointmass.emitters.emitter import Emitter
from pointmass.laws.force import Force
from pointmass.scene import Scene
from pointmass.simulation import Simulation

WHOLE = ("seed", "dtype", "max_particles", "when_full", "names")
KEPT = ("motions", "constraints")
COUNTED = ("bodies", "emitters", "zones", "controllers", *KEPT)
SCHEDULED = ("rate", "per_distance", "bursts", "start", "stop", "name", "of", "on")  # what numbers births, and so ids


class Adoption:
    """How a run of a scene becomes one of another that was made anew.

    It goes on from where it is if only numbers and formulas of forces, switches, colliders, zones and emitters (but not
    when these emit), the solver with its step, and the look differ. It begins again with other particles, or other
    kinds of forces. What a user has added to the run, which is behind the forces of its scene, stays.

    Attributes
    ----------
    fresh : a run of the new scene, from its beginning.
    goes_on : whether the run can go on.
    compiles : whether the new one may need kernels that the run does not have.

    Raises
    ------
    InvalidInput
        The new scene is not allowed.
    """

    def __init__(self, sim: Simulation, old: Scene, new: Scene) -> None:
        self.fresh = new.simulation()
        self._sim, self._new = sim, new
        self.goes_on = self._alike_in_kind(old)
        system, fresh = sim.system, self.fresh.system
        self.compiles = (
            not self.goes_on
            or not _alike(sim.solver, self.fresh.solver)
            or any(a.enabled != b.enabled or not _same_text(a, b) for a, b in self._forces())
            or [_make(c) for c in system.colliders] != [_make(c) for c in fresh.colliders]
        )

    def belongs_to(self, sim: Simulation) -> bool:
        """Whether it is about a run."""
        return self._sim is sim

    def prepare(self) -> Callable[[], None]:
        """What compiles the kernels of the new run, for another thread: the old one may run on meanwhile."""
        if not self.goes_on:
            return self.fresh.prepare
        twin = self._sim.system.part(np.arange(len(self._sim.system.particles)))
        for k, (force, like) in enumerate(self._forces()):
            if _same_text(force, like):
                twin.forces[k].enabled = like.enabled
            else:
                twin.forces[k] = like.twin()
                twin.forces[k].bind(twin.particles)
        twin.colliders = list(self.fresh.system.colliders)
        return self._sim.engine.of(twin, self.fresh.solver).prepare

    def carry_out(self) -> None:
        """Change the run, if it can go on."""
        system = self._sim.system
        for k, (force, like) in enumerate(self._forces()):
            if not _same_text(force, like):
                system.forces[k] = like
                like.bind(system.particles)
                continue
            for name, parameter in force.parameters.items():
                parameter.components[:] = like.parameters[name].components
            chosen = {name: force.arguments[name] for name in force.selections if name in force.arguments}
            force.arguments = {**like.arguments, **chosen}
            force.enabled = like.enabled
            force.bind(system.particles)
        system.colliders[:] = self.fresh.system.colliders
        self._sim.zones[:], self._sim.emitters[:] = self.fresh.zones, self.fresh.emitters
        for old, new in zip(self._sim.controllers, self.fresh.controllers, strict=True):
            new.bind(system, self._sim.seed)
            new.memory = old.memory
        self._sim.controllers[:] = self.fresh.controllers
        self._sim.look = self._new.look
        if self._sim.dt != self.fresh.dt or not _alike(self._sim.solver, self.fresh.solver):
            self._sim.change(self.fresh.solver, self.fresh.dt)

    def _forces(self) -> list[tuple[Force, Force]]:
        return _pairs(self._sim.system.forces, self.fresh.system.forces)

    def _alike_in_kind(self, old: Scene) -> bool:
        new, system, fresh = self._new, self._sim.system, self.fresh.system
        if not all(same(getattr(old, name), getattr(new, name)) for name in WHOLE):
            return False
        if any(len(getattr(old, what)) != len(getattr(new, what)) for what in COUNTED):
            return False
        if not all(_alike(a, b) for what in KEPT for a, b in _pairs(getattr(old, what), getattr(new, what))):
            return False
        if not all(_same_start(a.particles, b.particles) for a, b in zip(old.bodies, new.bodies, strict=True)):
            return False
        if [type(c) for c in old.controllers] != [type(c) for c in new.controllers]:
            return False
        if not all(_same_births(a, b) for a, b in zip(old.emitters, new.emitters, strict=True)):
            return False
        if len(system.forces) < len(fresh.forces) or not all(_same_law(a, b) for a, b in self._forces()):
            return False
        if len(system.particles) == len(fresh.particles):
            return True
        return not any(_columns(b) or not (_same_text(a, b) or _of_anybody(b)) for a, b in self._forces())


def _make(collider: Collider) -> tuple[Any, ...]:
    """What of a collider is compiled."""
    return type(collider), collider.contact, collider.response, collider.moves


def _pairs(a: Any, b: Any) -> list[tuple[Any, Any]]:
    return list(zip(a, b, strict=False))


def _alike(a: Any, b: Any) -> bool:
    """Whether two objects were made in the same way."""
    if isinstance(a, Described) and isinstance(b, Described):
        return type(a) is type(b) and _equal(a.arguments, b.arguments)
    return type(a) is type(b) and same(a, b)


def _equal(a: dict[str, Any], b: dict[str, Any]) -> bool:
    return a.keys() == b.keys() and all(_alike(value, b[name]) for name, value in a.items())


def _same_start(a: Any, b: Any) -> bool:
    names = ("x", "v", "m", "radius", "lifetime", "pinned")
    return a.attributes.keys() == b.attributes.keys() and all(same(getattr(a, n), getattr(b, n)) for n in names)


def _same_births(a: Emitter, b: Emitter) -> bool:
    """Whether two emitters make particles at the same times, with the same attributes."""
    times = [{n: e.arguments[n] for n in SCHEDULED if n in e.arguments} for e in (a, b)]
    return type(a) is type(b) and _equal(*times) and a.attributes_made == b.attributes_made


def _same_law(a: Force, b: Force) -> bool:
    """Whether two forces differ in their formulas and the numbers of their parameters alone."""
    ids = getattr(a, "ids", None), getattr(b, "ids", None)
    return type(a) is type(b) and a.parameters.keys() == b.parameters.keys() and (ids[0] is None or same(*ids))


def _same_text(a: Force, b: Force) -> bool:
    """Whether two forces of the same kind have the same formulas."""
    return [law.program.text for law in a.laws] == [law.program.text for law in b.laws]


def _of_anybody(force: Force) -> bool:
    """Whether a force can act on other particles than those that it was made for."""
    return getattr(force, "ids", None) is None and (force.on is None or isinstance(force.on, str))


def _columns(force: Force) -> bool:
    return any(isinstance(c.value, np.ndarray) for p in force.parameters.values() for c in p.components)
