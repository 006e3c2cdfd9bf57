"""Springs on volumes: what they hold, and that nothing is singular."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm


def strand(bend: float, torsion: float) -> np.ndarray:
    """Four points with links of 1 m, the same bend twice, and a torsion about the middle link."""
    c, s = np.cos(bend), np.sin(bend)
    first, middle = np.array([c, -s, 0.0]), np.array([1.0, 0.0, 0.0])
    last = np.array([c, s * np.cos(torsion), s * np.sin(torsion)])
    return np.cumsum([np.zeros(3), first, middle, last], axis=0)


@pytest.mark.parametrize("torsion", [-1.2, -0.3, 0.0, 0.4, 1.0])
def test_volume_by_bends_and_torsion(torsion: float) -> None:
    p = pm.Particles(strand(0.5, torsion))
    force = pm.Volumes([(0, 1, 2, 3)])
    force.bind(p)
    assert force.values(p, p.x)[0] == pytest.approx(np.sin(0.5) ** 2 * np.sin(torsion) / 6, rel=1e-12)


def test_gives_no_force_on_a_straight_strand_and_a_bounded_one_beside_it() -> None:
    for bend, most in ((0.0, 0.0), (1e-9, 1e-8), (1e-3, 1e-2)):
        force = pm.Volumes([(0, 1, 2, 3)], k_s=60.0, rest=0.1)
        p = pm.Particles(strand(bend, 0.7))
        force.bind(p)
        f = np.zeros((4, 3))
        force.add_forces(p, 0.0, p.x, p.v, f)
        assert np.abs(f).max() <= most


def test_a_strand_turned_into_its_mirror_image_turns_back() -> None:
    """Springs between all pairs cannot tell a strand from its mirror image; the volume can."""
    right, left = strand(0.6, 0.5), strand(0.6, -0.5)
    pairs = [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)]
    rest = [float(np.linalg.norm(right[a] - right[b])) for a, b in pairs]
    rest_volume = np.sin(0.6) ** 2 * np.sin(0.5) / 6
    p = pm.Particles(left)
    volumes = pm.Volumes([(0, 1, 2, 3)], 2e4, 500.0, rest_volume)
    system = pm.ParticleSystem(p, [pm.Springs(pairs, 30.0, 5.0, rest), volumes])
    assert pm.ParticleSystem(pm.Particles(left), [pm.Springs(pairs, 30.0, 1.0, rest)]).stretch() < 1e-12
    pm.Simulation(system, "rk4", 1 / 400, compiled=False).run(20)
    assert volumes.values(p, p.x)[0] == pytest.approx(rest_volume, rel=1e-3)
    assert system.stretch() < 1e-3
