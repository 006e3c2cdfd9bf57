"""Scenes that come with pointmass, one phenomenon to a file."""

from __future__ import annotations

from pointmass.scenes.base import CheckFailed, ShippedScene
from pointmass.scenes.pendulum import Pendulum

SCENES: dict[str, type[ShippedScene]] = {scene.name: scene for scene in (Pendulum,)}

__all__ = ["SCENES", "CheckFailed", "ShippedScene"]
