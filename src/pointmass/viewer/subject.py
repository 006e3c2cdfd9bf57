"""What a page looks at: a scene with parameters that can be turned."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pointmass.scene import Scene
from pointmass.scenes import ShippedScene
from pointmass.viewer.messages import Parameter, Value


def is_flow(scene: Scene) -> bool:
    """Whether its particles follow velocities, and have no masses that could be pulled."""
    return any(force.order == 1 for force in scene.forces)


@dataclass(frozen=True)
class Subject:
    """A scene, made again for each setting of its parameters.

    Attributes
    ----------
    name, summary : for people.
    build : makes the scene with some parameters set.
    parameters : as declared, with the values at the start.
    presets : settings that belong together, by name.
    """

    name: str
    summary: str
    build: Callable[[Mapping[str, Value]], Scene]
    parameters: tuple[Parameter, ...] = ()
    presets: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)

    @classmethod
    def of_scene(cls, scene: Scene) -> Subject:
        """A scene as it is."""
        return cls(scene.name, scene.summary, lambda _: scene)

    @classmethod
    def of_shipped(cls, shipped: ShippedScene, finished: Callable[[Scene], Scene] = lambda scene: scene) -> Subject:
        """A scene that is shipped, with its parameters.

        Parameters
        ----------
        finished : what is done to each scene that is built, such as to choose another solver.
        """
        kind = type(shipped)
        declared = kind.parameters()
        start = {p["name"]: getattr(shipped, p["name"]) for p in declared}

        def build(settings: Mapping[str, Value]) -> Scene:
            return finished(kind.with_settings({**start, **settings}).build())

        parameters = tuple(
            Parameter(
                name=p["name"],
                summary=p["summary"],
                unit=p["unit"],
                value=start[p["name"]],
                minimum=p["minimum"],
                maximum=p["maximum"],
                whole=isinstance(p["default"], int) and not isinstance(p["default"], bool),
                choices=p["choices"],
            )
            for p in declared
        )
        return cls(kind.name, kind.summary(), build, parameters, kind.presets)
