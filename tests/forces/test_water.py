"""Water on triangles, and fins: their closed forms, and that they only ever take energy away."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput

HALF = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]  # of area 1/2, with its outward normal along z
SECTION = [(0.0, 0.1, -0.1), (0.0, 0.1, 0.1), (0.0, -0.1, 0.1), (0.0, -0.1, -0.1)]  # looks along x


def forces_on(force, x, v):
    system = pm.ParticleSystem(pm.Particles(x, v), [force])
    system.deriv_eval(0.0, system.get_state())
    return system.particles.f.copy()


def test_a_triangle_that_moves_outwards_is_held_back_and_inwards_it_is_not():
    held = forces_on(pm.Water([(0, 1, 2)], drag=1.0), HALF, (0, 0, 2))
    np.testing.assert_allclose(held, np.full((3, 3), 1 / 3) * (0, 0, -1), atol=1e-15)
    assert not forces_on(pm.Water([(0, 1, 2)], drag=1.0), HALF, (0, 0, -2)).any()
    assert not forces_on(pm.Water([(0, 1, 2)], drag=1.0), HALF, (5, -3, 0)).any()


def test_only_the_speed_in_the_water_counts():
    carried = pm.Water([(0, 1, 2)], drag=1.0, velocity=(0, 0, 2))
    assert not forces_on(carried, HALF, (0, 0, 2)).any()
    assert forces_on(carried, HALF, (0, 0, 3)).sum() == pytest.approx(-0.5)


def test_water_and_fins_never_speed_up_what_moves():
    rng = np.random.default_rng(1)
    x, v = rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    triangles = np.arange(300).reshape(100, 3)
    f = forces_on(pm.Water(triangles, drag=3.0), x, v)
    power = (f * v).sum(axis=1).reshape(100, 3).sum(axis=1)
    assert (power <= 1e-12 * np.abs(f * v).max()).all()
    assert (power < 0).any()
    assert (power == 0).any()
    sections = np.arange(300).reshape(75, 4)
    f = forces_on(pm.Fins(sections, rng.uniform(math.pi / 4, math.pi, 75)), x, v)
    assert ((f * v).sum(axis=1).reshape(75, 4).sum(axis=1) <= 1e-12 * np.abs(f * v).max()).all()


@pytest.mark.parametrize(("angle", "way"), [(math.pi / 4, -1), (math.pi / 2, 0), (3 * math.pi / 4, 1)])
def test_fins_dive_lie_flat_or_climb(angle, way):
    """F = -A (v . n) n with v = u ahead: -u A (cos^2, cos sin)."""
    f = forces_on(pm.Fins([(0, 1, 2, 3)], angle, area=0.5, drag=2.0), SECTION, (3.0, 0.0, 0.0)).sum(axis=0)
    expected = -3.0 * math.cos(angle) * np.array([math.cos(angle), math.sin(angle), 0.0])
    np.testing.assert_allclose(f, expected, atol=1e-12)
    assert np.sign(round(f[1], 9)) == way


def test_fins_across_brake_and_the_couple_has_no_force():
    f = forces_on(pm.Fins([(0, 1, 2, 3)], math.pi, area=0.5, drag=2.0, upright=4.0), SECTION, (3.0, 0.0, 0.0))
    np.testing.assert_allclose(f.sum(axis=0), (-3.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(f[:, 1], (4.0, 4.0, -4.0, -4.0), atol=1e-12)


def test_what_they_do_not_take():
    with pytest.raises(InvalidInput, match=r"angle = 0.1 is not allowed"):
        pm.Fins([(0, 1, 2, 3)], 0.1)
    with pytest.raises(InvalidInput, match="unknown surface 'skin'"):
        pm.ParticleSystem(pm.Particles(HALF), [pm.Water("skin")])
