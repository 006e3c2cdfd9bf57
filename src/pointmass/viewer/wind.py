"""Where the wind of a scene blows to, and the scene with another direction."""

from __future__ import annotations

import math
from typing import Any

from pointmass.description import Described
from pointmass.errors import InvalidInput
from pointmass.forces import Gust, PlateWind, Wind
from pointmass.laws.force import Force
from pointmass.scene import Scene
from pointmass.viewer.messages import Vector

DEFAULT = (3.0, 0.0, 0.0)  # of Wind, PlateWind and Gust


def wind_of(scene: Scene) -> Vector | None:
    """The mean wind [m/s] of the first force that has one; None without wind, or where no numbers say it."""
    means = [_mean(force) for force in scene.forces]
    return next((mean for mean in means if mean is not None), None)


def blown(scene: Scene, direction: Vector) -> Scene:
    """The scene with all mean winds in one direction, as strong as they are.

    Raises
    ------
    InvalidInput
        The direction is zero.
    """
    size = math.hypot(*direction)
    if size == 0:
        raise InvalidInput(f"the direction {direction} of the wind is not allowed: it must not be zero")
    unit: Vector = (direction[0] / size, direction[1] / size, direction[2] / size)
    return scene.changed(forces=[force if _mean(force) is None else _turned(force, unit) for force in scene.forces])


def _mean(force: Force) -> Vector | None:
    if not isinstance(force, (Wind, PlateWind)):
        return None
    for part in _parts(force.arguments.get("velocity", DEFAULT)):
        vector = _vector(part)
        if vector is not None and any(vector):
            return vector
    return None


def _turned(force: Force, unit: Vector) -> Force:
    velocity = force.arguments.get("velocity", DEFAULT)
    several = velocity is not _parts(velocity)[0]
    parts = [_turned_part(part, unit) for part in _parts(velocity)]
    result = type(force)(**{**force.arguments, "velocity": parts if several else parts[0]})
    result.enabled = force.enabled
    return result


def _turned_part(part: Any, unit: Vector) -> Any:
    vector = _vector(part)
    if vector is None:
        return part
    speed = math.hypot(*vector)
    turned = tuple(speed * u for u in unit)
    return Gust(**{**part.arguments, "velocity": turned}) if isinstance(part, Gust) else turned


def _parts(velocity: Any) -> list[Any]:
    """What adds up to a velocity; see `Air`."""
    several = isinstance(velocity, (list, tuple)) and any(isinstance(part, Described) for part in velocity)
    return list(velocity) if several else [velocity]


def _vector(part: Any) -> Vector | None:
    """The numbers of a constant velocity, or of the mean of gusts."""
    value = part.arguments.get("velocity", DEFAULT) if isinstance(part, Gust) else part
    if isinstance(value, (str, Described)) or callable(value) or value is None:
        return None
    numbers = [float(n) for n in value if isinstance(n, (int, float)) and not isinstance(n, bool)]
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == len(value) == 3 else None
