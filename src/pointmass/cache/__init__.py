"""Runs on disk."""

from pointmass.cache.cache import Cache, check_target
from pointmass.cache.record import record

__all__ = ["Cache", "check_target", "record"]
