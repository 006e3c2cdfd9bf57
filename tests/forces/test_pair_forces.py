"""Physics of pair forces with a cut-off."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import pointmass as pm


def test_lennard_jones_dimer_swings_at_its_frequency():
    """models.md F11: curvature 57.14644 epsilon / sigma^2 at the minimum, amplitude 1e-3 sigma."""
    epsilon, sigma, m1, m2 = 1.7, 0.8, 1.0, 2.0
    mu = m1 * m2 / (m1 + m2)
    omega = math.sqrt(57.14644 * epsilon / (sigma**2 * mu))
    d = 2 ** (1 / 6) * sigma
    p = pm.Particles([[0, 0, 0], [d + 1e-3 * sigma, 0, 0]], m=[m1, m2])
    dt = 2 * math.pi / omega / 100
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.LennardJones(epsilon, sigma)]), "leapfrog", dt=dt)
    stretch = [1e-3 * sigma]
    for _ in range(280):
        sim.step(1)
        stretch.append(p.x[1, 0] - p.x[0, 0] - d)
    crossings = [k + s / (s - e) for k, (s, e) in enumerate(pairwise(stretch)) if s * e < 0]
    period = 2 * (crossings[-1] - crossings[0]) / (len(crossings) - 1) * dt
    assert len(crossings) == 6
    assert 2 * math.pi / period == pytest.approx(omega, rel=1e-3)


def test_depth_of_the_well():
    p = pm.Particles([[0, 0, 0], [2 ** (1 / 6), 0, 0]])
    shift = 4 * (2.5**-12 - 2.5**-6)
    assert pm.ParticleSystem(p, [pm.LennardJones()]).energy().potential == pytest.approx(-1 - shift, rel=1e-12)
    assert np.abs(pm.ParticleSystem(p, [pm.LennardJones()]).deriv_eval()).max() < 1e-13


def test_a_melt_conserves_energy_and_momentum():
    """A small fcc crystal at the density and temperature of LAMMPS' benchmark."""
    rng = np.random.default_rng(1)
    a = (4 / 0.8442) ** (1 / 3)
    cell = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])
    corners = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    x = ((corners + cell) * a).reshape(-1, 3)
    v = rng.standard_normal(x.shape) * math.sqrt(1.44)
    p = pm.Particles(x, v - v.mean(axis=0))
    system = pm.ParticleSystem(p, [pm.LennardJones(box=(4 * a, 4 * a, 4 * a))])
    before = system.energy()
    assert before.potential / len(p) == pytest.approx(-6.7733681 + 0.5 * 54 * 0.016316891, rel=2e-2)
    pm.Simulation(system, "leapfrog", dt=0.005).step(30)
    after = system.energy()
    assert after.total == pytest.approx(before.total, abs=2e-3 * before.kinetic)
    assert after.kinetic < 0.75 * before.kinetic
    assert np.abs(system.momentum()).max() < 1e-12 * len(p)


@pytest.mark.parametrize("z", [0.0, 0.1, 0.4])
def test_soft_spheres_part_with_the_restitution_of_their_damper(z):
    k_s, m1, m2, r = 1e4, 1.0, 3.0, 0.1
    mu = m1 * m2 / (m1 + m2)
    force = pm.SoftSphere(k_s, 2 * z * math.sqrt(k_s * mu))
    p = pm.Particles([[-0.21, 0, 0], [0, 0, 0]], [[1, 0, 0], [0, 0, 0]], [m1, m2], radius=r)
    contact = math.pi * math.sqrt(mu / k_s)
    pm.Simulation(pm.ParticleSystem(p, [force]), "rk4", dt=contact / 100).step(1000)
    assert p.v[1, 0] - p.v[0, 0] == pytest.approx(math.exp(-math.pi * z / math.sqrt(1 - z * z)), rel=1e-2)
    assert m1 * p.v[0, 0] + m2 * p.v[1, 0] == pytest.approx(m1, rel=1e-12)
