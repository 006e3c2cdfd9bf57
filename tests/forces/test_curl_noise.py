"""Curl noise: no divergence, nothing through solids, the speed that was asked for, and scene files."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.laws.force import Blocks

RNG = np.random.default_rng(11)
SOLIDS = [pm.Sphere((0.1, 0.2, 0.0), 0.5), pm.Plane((0, -0.5, 0)), pm.Box(size=(3, 3, 3), inside=True)]


def velocity(field, x, t=0.0):
    return pm.ParticleSystem(pm.Particles(x), [field]).deriv_eval(t).reshape(-1, 3)


def on_sphere(count):
    d = RNG.standard_normal((count, 3))
    return d / np.linalg.norm(d, axis=1)[:, None]


def trace_of_gradient(field, x):
    """The divergence, from the exact Jacobian, and the size of the slopes."""
    p, blocks = pm.Particles(x), Blocks()
    field.bind(p)
    field.add_jacobian(p, 0.3, p.x, p.v, blocks)
    slopes = blocks.own[0][1]
    return np.trace(slopes, axis1=1, axis2=2), np.abs(slopes).max()


def test_f09_staggered_curl_has_no_divergence():
    # psi on the edges, v on the faces, divergence in the cells: each psi comes twice, with both signs.
    h, n = 1e-2, 12
    k = np.arange(n + 1) * h

    def psi(component, half):
        axes = [k + h / 2 * (axis == half) for axis in range(3)]
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        return pm.noise(x[..., 0], x[..., 1], x[..., 2], 0.4, seed=component)

    a = [psi(axis, axis) for axis in range(3)]
    v = [
        np.diff(a[2], axis=1)[:, :, :-1] / h - np.diff(a[1], axis=2)[:, :-1] / h,
        np.diff(a[0], axis=2)[:-1] / h - np.diff(a[2], axis=0)[:, :, :-1] / h,
        np.diff(a[1], axis=0)[:, :-1] / h - np.diff(a[0], axis=1)[:-1] / h,
    ]
    divergence = sum(np.diff(part, axis=axis)[:n, :n, :n] / h for axis, part in enumerate(v))
    assert np.abs(divergence).max() < 1e-10


@pytest.mark.parametrize("around", [(), SOLIDS])
def test_the_exact_curl_has_no_divergence(around):
    x = RNG.uniform(-1.4, 1.4, (40, 3))
    divergence, size = trace_of_gradient(pm.CurlNoise(0.7, around=around), x)
    assert np.abs(divergence).max() < 1e-12 * size


def test_f10_nothing_flows_through_a_sphere():
    x = SOLIDS[0].motion.place(0) + 0.5 * on_sphere(400)
    u = velocity(pm.CurlNoise(0.7, speed=1.0, around=SOLIDS[:1]), x, 0.4)
    assert np.abs((u * SOLIDS[0].normal(x, 0)).sum(axis=1)).max() < 1e-12
    assert 0.3 < np.linalg.norm(u, axis=1).mean() < 3  # along it, it flows
    free = velocity(pm.CurlNoise(0.7), x, 0.4)
    assert np.abs((free * SOLIDS[0].normal(x, 0)).sum(axis=1)).max() > 0.5


def test_nothing_flows_through_solids_that_are_near_each_other():
    field = pm.CurlNoise(0.7, around=SOLIDS, distance=0.6)
    ball = SOLIDS[0].motion.place(0) + 0.5 * on_sphere(200)
    ball = ball[ball[:, 1] > -0.5]
    floor = RNG.uniform(-1.4, 1.4, (200, 3)) * (1, 0, 1) - (0, 0.5, 0)
    floor = floor[np.linalg.norm(floor - SOLIDS[0].motion.place(0), axis=1) > 0.5]
    wall = np.column_stack([np.full(200, 1.5), RNG.uniform(-0.5, 1.5, 200), RNG.uniform(-1.4, 1.4, 200)])
    for x, normal in ((ball, SOLIDS[0].normal(ball, 0)), (floor, (0, 1, 0)), (wall, (1, 0, 0))):
        u = velocity(field, x)
        assert np.abs((u * normal).sum(axis=1)).max() < 1e-12 * max(1.0, np.abs(u).max())


def test_beyond_its_reach_a_solid_changes_nothing():
    x = RNG.uniform(-3, 3, (300, 3))
    far = SOLIDS[0].distance(x, 0) > 0.4
    with_solid, free = (
        velocity(pm.CurlNoise(0.7, around=around, distance=0.4), x) for around in (SOLIDS[:1], ())
    )  # fmt: skip
    np.testing.assert_allclose(with_solid[far], free[far], rtol=0, atol=1e-13)
    assert not np.isclose(with_solid[~far], free[~far]).all()


@pytest.mark.parametrize("rate", [0.0, 0.7])
def test_root_mean_square_speed(rate):
    x = RNG.uniform(-500, 500, (20_000, 3))
    u = velocity(pm.CurlNoise(2.0, speed=3.0, rate=rate, gain=0.8), x, 1.3)
    assert np.abs(u.mean(axis=0)).max() < 5 * 3 / np.sqrt(3 * 20_000)
    assert (u**2).sum(axis=1).mean() == pytest.approx(9, rel=5 * np.sqrt(2 / 20_000))


def test_whirls_carry_particles_without_crowding_them():
    # A cloud that is even stays even: its density at the particles, det(dx/dx0), stays 1.
    x = RNG.uniform(-1, 1, (30, 3))
    h = 1e-5
    start = np.concatenate([x, *(x + h * e for e in np.eye(3))])
    sim = pm.Simulation(pm.ParticleSystem(pm.Particles(start), [pm.CurlNoise(octaves=1)]), pm.RK4(), dt=0.02)
    sim.step(25)
    moved = sim.system.particles.x.reshape(4, 30, 3)
    volume = np.linalg.det(np.moveaxis(moved[1:] - moved[0], 0, 1) / h)
    # each of 25 steps is off by some (0.02 * slope)^5, the difference by h times a second derivative, both below 1e-3
    np.testing.assert_allclose(volume, 1, rtol=0, atol=5e-3)


def test_parameters_change_in_use():
    field = pm.CurlNoise(speed=1.0)
    x = RNG.uniform(-1, 1, (5, 3))
    before = velocity(field, x)
    field.set(speed=2.0)
    np.testing.assert_allclose(velocity(field, x), 2 * before, rtol=1e-14)
    field.set(seed=3, length=2.0, rate=1.0)
    np.testing.assert_array_equal(velocity(field, x), velocity(pm.CurlNoise(2.0, 2.0, 1.0, seed=3), x))
    with pytest.raises(pm.InvalidInput, match="rate of curl_noise cannot be set"):
        pm.CurlNoise(rate=0).set(rate=1.0)


SCENE = """
bodies = [{ type = "scatter", count = 20 }]

[[forces]]
type = "wind"
k = 0.2
[forces.velocity]
type = "curl_noise"
length = 0.5
around = [{ type = "sphere", radius = 0.2 }, { type = "plane" }]
"""


def test_in_a_scene_file():
    scene = pm.Scene.from_toml(SCENE)
    assert pm.Scene.from_toml(scene.to_toml()) == scene
    assert np.isfinite(scene.simulation().system.deriv_eval()).all()


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ({"length": 0}, "length = 0"),
        ({"octaves": 0}, "octaves = 0"),
        ({"rate": -1}, "rate = -1"),
        ({"seed": 0.5}, "seed = 0.5"),
        ({"around": "ball"}, "around must be a list of colliders"),
        ({"around": [3]}, "around must be a list of colliders"),
        ({"distance": 0}, "distance = 0"),
    ],
)
def test_refusals(arguments, hint):
    with pytest.raises(pm.InvalidInput, match=hint):
        pm.CurlNoise(**arguments)


def test_bad_solids_in_a_scene_file():
    with pytest.raises(pm.InvalidInput, match=r"forces.0.velocity.around.1.* radius = -1"):
        pm.Scene.from_toml(SCENE.replace('{ type = "plane" }', '{ type = "sphere", radius = -1 }'))
    with pytest.raises(pm.InvalidInput, match=r"forces.0.velocity.around.1.*'cone'"):
        pm.Scene.from_toml(SCENE.replace('"plane"', '"cone"'))
