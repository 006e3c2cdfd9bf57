"""Particle systems."""
