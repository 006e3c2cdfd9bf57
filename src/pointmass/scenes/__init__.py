"""Scenes that come with pointmass, one phenomenon to a file."""

from __future__ import annotations

from pointmass.scenes.base import CheckFailed, ShippedScene
from pointmass.scenes.bounce import Bounce
from pointmass.scenes.dust import Dust
from pointmass.scenes.fireworks import Fireworks
from pointmass.scenes.flow import FlowScene
from pointmass.scenes.fountain import Fountain
from pointmass.scenes.hair import HairScene
from pointmass.scenes.orbit import Orbit
from pointmass.scenes.pendulum import Pendulum
from pointmass.scenes.smoke import Smoke
from pointmass.scenes.snow import Snow
from pointmass.scenes.springs import SpringsScene

SCENES: dict[str, type[ShippedScene]] = {
    scene.name: scene
    for scene in (Pendulum, Bounce, FlowScene, Orbit, SpringsScene, Fountain, Fireworks, Snow, Smoke, Dust, HairScene)
}

__all__ = ["SCENES", "CheckFailed", "ShippedScene"]
