"""The command `pointmass`: scenes from files into caches and films."""

from pointmass.cli.main import main

__all__ = ["main"]
