"""What a user has changed of a scene: parameters, solver and step, what is switched off, and where the wind blows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pointmass.bodies import Body
from pointmass.constraints import Attachment
from pointmass.errors import InvalidInput, number, unknown
from pointmass.laws.force import Force
from pointmass.scene import Scene
from pointmass.solver_choice import AUTO
from pointmass.solvers import SOLVERS, find_solver
from pointmass.viewer.messages import Switch, Value, Vector
from pointmass.viewer.subject import is_flow
from pointmass.viewer.wind import blown


@dataclass(frozen=True)
class Setup:
    """A scene's settings; what is empty is as the scene says.

    Attributes
    ----------
    parameters : of the scene, by name.
    solver : its name, or "auto".
    dt : its step [s]; 0 = as the scene says.
    switches : of forces and colliders, by place, such as {"forces.1": False}.
    wind : direction in which it blows.
    """

    parameters: Mapping[str, Value] = field(default_factory=dict)
    solver: str = ""
    dt: float = 0.0
    switches: Mapping[str, bool] = field(default_factory=dict)
    wind: Vector | None = None

    def changed(self, **values: Any) -> Setup:
        """A copy with other values; tables are laid over those that are there."""
        merged: dict[str, Any] = {
            name: {**getattr(self, name), **value} if isinstance(value, Mapping) else value
            for name, value in values.items()
        }
        return replace(self, **merged)

    def of(self, scene: Scene) -> Scene:
        """A scene with the settings beside its parameters.

        Raises
        ------
        InvalidInput
            No such solver, a step that is not allowed, a collider that cannot be switched off.
        """
        changes: dict[str, Any] = {}
        if self.solver:
            changes["solver"] = AUTO if self.solver == AUTO else find_solver(self.solver)()
        if self.dt:
            changes["dt"] = number("dt", self.dt, above=0, unit="s")
        if self.switches:
            changes |= _switched(scene, self.switches)
        if self.wind is not None:
            changes["forces"] = blown(scene.changed(**changes), self.wind).forces
        return scene.changed(**changes) if changes else scene


def solvers_for(scene: Scene) -> list[str]:
    """Names of the solvers that take a scene: splitting methods and XPBD move masses, and a flow has none."""
    flow = is_flow(scene)
    return [name for name, kind in SOLVERS.items() if not (flow and kind.moves_masses)]


def switches_of(scene: Scene, setup: Setup) -> list[Switch]:
    """Everything in a scene, as it was before `Setup.of`, that can be switched on and off."""
    return [
        Switch(name=name, label=label, on=setup.switches.get(name, not isinstance(item, Force) or item.enabled))
        for name, label, item in _items(scene)
    ]


def switched_inside(scene: Scene, setup: Setup) -> str | None:
    """What of a body is switched otherwise than its builder does, if anything: that has no text."""
    inside = {name: (label, item) for name, label, item in _items(scene) if name.startswith("bodies.")}
    changed = (label for n, (label, item) in inside.items() if setup.switches.get(n, item.enabled) != item.enabled)
    return next(changed, None)


def _items(scene: Scene) -> Iterator[tuple[str, str, Any]]:
    """Place, label and object of each force and collider."""
    labels: dict[str, int] = {}

    def numbered(label: str) -> str:
        labels[label] = labels.get(label, 0) + 1
        return label if labels[label] == 1 else f"{label} {labels[label]}"

    for k, force in enumerate(scene.forces):
        yield f"forces.{k}", numbered(force.name.replace("_", " ")), force
    for k, (body, name) in enumerate(zip(scene.bodies, scene.names, strict=True)):
        for j, force in enumerate(body.forces):
            label = getattr(force, "family", force.name).replace("_", " ")
            yield f"bodies.{k}.forces.{j}", numbered(f"{name}: {label}"), force
    for k, collider in enumerate(scene.colliders):
        yield f"colliders.{k}", numbered(collider.name.lower()), collider


def _switched(scene: Scene, switches: Mapping[str, bool]) -> dict[str, Any]:
    """The lists of a scene with forces on or off, and without the colliders that are off."""
    known = [name for name, _, _ in _items(scene)]
    for name, on in switches.items():
        if name.split(".")[0] not in ("forces", "bodies", "colliders"):
            raise unknown("force or collider", name, known)
        if not on and name in known and name.startswith("colliders."):
            _check_free(scene, int(name.split(".")[1]))
    return {
        "forces": [_switch(f, switches.get(f"forces.{k}")) for k, f in enumerate(scene.forces)],
        "bodies": [_switched_body(b, f"bodies.{k}", switches) for k, b in enumerate(scene.bodies)],
        "colliders": [c for k, c in enumerate(scene.colliders) if switches.get(f"colliders.{k}", True)],
    }


def _switched_body(body: Body, name: str, switches: Mapping[str, bool]) -> Body:
    if not any(place.startswith(f"{name}.") for place in switches):
        return body
    forces = [_switch(f, switches.get(f"{name}.forces.{j}")) for j, f in enumerate(body.forces)]
    return Body(body.particles, forces, body.kind, body.arguments)


def _switch(force: Force, on: bool | None) -> Force:
    if on is None or on == force.enabled:
        return force
    result = type(force)(**force.arguments)
    result.enabled = on
    return result


def _check_free(scene: Scene, number: int) -> None:
    """Attachments name colliders by their numbers."""
    tied = [c.collider for c in scene.constraints if isinstance(c, Attachment) and c.collider is not None]
    if tied and number <= max(tied):
        raise InvalidInput(
            f"collider {number} cannot be switched off: something is attached to collider {max(tied)}, which is found "
            "by its number"
        )
