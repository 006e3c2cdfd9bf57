"""A soft layer on solids."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput


def test_somebody_who_meets_it_goes_as_deep_as_the_formula_says_and_comes_back() -> None:
    """Half a swing of w = sqrt(k_s/m): u/w deep, and out after pi/w with the speed of before."""
    p = pm.Particles([[0, 0.1, 0]], [[0, -2.0, 0]], m=0.5)
    system = pm.ParticleSystem(p, [pm.Cushion([pm.Plane()], k_s=800.0, thickness=0.1)])
    sim = pm.Simulation(system, "leapfrog", 1e-4, compiled=False)
    w = math.sqrt(800 / 0.5)
    sim.run(0.5 * math.pi / w)
    assert p.x[0, 1] == pytest.approx(0.1 - 2 / w, rel=1e-5)
    sim.run(0.6 * math.pi / w)
    assert p.v[0, 1] == pytest.approx(2.0, rel=1e-5)


def test_damping_takes_energy_and_never_pulls() -> None:
    """Hunt and Crossley: for c u << 1 the speed after is u (1 - 2 c u / 3)."""
    p = pm.Particles([[0, 0.1, 0]], [[0, -1.0, 0]])
    system = pm.ParticleSystem(p, [pm.Cushion([pm.Plane()], k_s=400.0, thickness=0.1, damping=0.01)])
    pm.Simulation(system, "leapfrog", 1e-4, compiled=False).run(0.3)
    assert 1 - p.v[0, 1] == pytest.approx(2 / 3 * 0.01, rel=0.02)
    outwards = pm.Particles([[0, 0.05, 0]], [[0, 500.0, 0]])
    force = pm.Cushion([pm.Plane()], k_s=400.0, thickness=0.1, damping=0.01)
    force.bind(outwards)
    f = np.zeros((1, 3))
    force.add_forces(outwards, 0.0, outwards.x, outwards.v, f)
    assert (f == 0).all()


def test_needs_a_solid() -> None:
    with pytest.raises(InvalidInput, match=r"around = \[\] is not allowed"):
        pm.Cushion([])
