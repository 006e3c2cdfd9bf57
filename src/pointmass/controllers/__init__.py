"""What controls forces between steps: brains, and whatever else has to see before it acts."""

from collections.abc import Mapping

from pointmass.controllers.controller import Controller
from pointmass.controllers.fish_brain import FishBrain
from pointmass.controllers.steer import Steer
from pointmass.controllers.swim import Swim

CONTROLLERS: Mapping[str, type[Controller]] = {"steer": Steer, "swim": Swim, "fish_brain": FishBrain}

__all__ = ["CONTROLLERS", "Controller", "FishBrain", "Steer", "Swim"]
