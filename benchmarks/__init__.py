"""Races against peers: `python -m benchmarks.race`."""
