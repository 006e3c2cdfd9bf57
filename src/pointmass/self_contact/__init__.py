"""Cloth against itself and other cloth: near pairs, where they meet within a step, and what keeps them apart."""
