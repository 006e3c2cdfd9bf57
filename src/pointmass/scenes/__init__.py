"""Scenes that come with pointmass, one phenomenon to a file."""

from __future__ import annotations

from pointmass.scenes.aquarium import Aquarium
from pointmass.scenes.base import CheckFailed, ShippedScene
from pointmass.scenes.bounce import Bounce
from pointmass.scenes.cloth import ClothScene
from pointmass.scenes.curtain import Curtain
from pointmass.scenes.drape import Drape
from pointmass.scenes.dust import Dust
from pointmass.scenes.field import FieldScene
from pointmass.scenes.fireworks import Fireworks
from pointmass.scenes.fish import FishScene
from pointmass.scenes.flag import Flag
from pointmass.scenes.flock import Flock
from pointmass.scenes.flow import FlowScene
from pointmass.scenes.fountain import Fountain
from pointmass.scenes.hair import HairScene
from pointmass.scenes.heap import Heap
from pointmass.scenes.jelly import JellyScene
from pointmass.scenes.net import NetScene
from pointmass.scenes.orbit import Orbit
from pointmass.scenes.pendulum import Pendulum
from pointmass.scenes.school import School
from pointmass.scenes.smoke import Smoke
from pointmass.scenes.snake import SnakeScene
from pointmass.scenes.snow import Snow
from pointmass.scenes.springs import SpringsScene
from pointmass.scenes.tear import TearScene
from pointmass.scenes.worm import WormScene

SCENES: dict[str, type[ShippedScene]] = {
    scene.name: scene
    for scene in (
        Pendulum,
        Bounce,
        FlowScene,
        FieldScene,
        Orbit,
        SpringsScene,
        JellyScene,
        Fountain,
        Fireworks,
        Snow,
        Smoke,
        Dust,
        Flock,
        ClothScene,
        Flag,
        Drape,
        Curtain,
        NetScene,
        TearScene,
        HairScene,
        Heap,
        SnakeScene,
        WormScene,
        FishScene,
        School,
        Aquarium,
    )
}

__all__ = ["SCENES", "CheckFailed", "ShippedScene"]
