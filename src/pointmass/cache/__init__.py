"""Runs on disk."""

from pointmass.cache.cache import Cache, check_target
from pointmass.cache.provenance import Making
from pointmass.cache.record import Plan, plan, record

__all__ = ["Cache", "Making", "Plan", "check_target", "plan", "record"]
