"""The air of the dust devil."""

import numpy as np

import pointmass as pm

SCENE = pm.SCENES["dust"].with_settings({"wander": 0.0, "wind": 0.0})


def air(x):
    """Velocity of the air at places, t = 0 [m/s]."""
    flow = SCENE.build().forces[1].flows[0]
    flow.set(a=0.0)  # the grains have no height
    particles = pm.Particles(x)
    flow.bind(particles)
    velocity = np.zeros_like(particles.x)
    flow.add_forces(particles, 0.0, particles.x, particles.v, velocity)
    return velocity


def test_it_has_no_divergence():
    h = 1e-4
    x = np.random.default_rng(2).uniform((-2, 0.1, -2), (2, 7, 2), (300, 3))
    along = [(air(x + h * e) - air(x - h * e))[:, k] / (2 * h) for k, e in enumerate(np.eye(3))]
    assert np.abs(along).max() > 1
    assert np.abs(np.sum(along, axis=0)).max() < 1e-4


def test_it_goes_in_below_up_in_the_middle_out_above_and_around():
    middle, out = np.array((0.1 * 2.0, 2.0, 0.0)), np.array((0.0, 0.0, 1.2))  # the column leans by a tenth
    assert np.allclose(air(middle), (0.1 * air(middle)[0, 1], air(middle)[0, 1], 0.0), atol=1e-12)
    assert 0.4 * SCENE.updraft < air(middle)[0, 1] < SCENE.updraft
    assert np.abs(air([(0.0, 0.0, z) for z in (0.0, 0.5, 3.0)])[:, 1]).max() < 1e-3 * SCENE.updraft
    assert air([(0.02, 0.2, 1.2)])[0, 2] < -0.2
    assert air([(0.55, 5.5, 1.2)])[0, 2] > 0.2
    assert air(middle + out)[0, 0] > 1 > -1 > air(middle - out)[0, 0]  # counter-clockwise, seen from above


def test_the_highest_speed_around_is_that_of_the_knob_in_a_vortex_that_grows_wider():
    """Swirl times how much wider it is there, times the profile of slow air below and the end above."""
    y = 2.0
    flow = air(np.column_stack([np.full(4000, 0.1 * y), np.full(4000, y), np.linspace(0.1, 2.0, 4000)]))
    s, wider = y / (0.12 * SCENE.height), 1 + 0.7 * y / SCENE.height
    profile = (1 - (1 + s) * np.exp(-s)) * np.exp(-((y / SCENE.height) ** 4))
    top = (flow[:, 0] - 0.1 * flow[:, 1]).max()  # without what the leaning column carries along
    assert abs(top / (SCENE.swirl * profile / wider) - 1) < 1e-3


def test_sand_lies_is_lifted_falls_and_lies_again():
    scene = pm.SCENES["dust"].with_settings({"sand": 3000, "dust": 20.0}).build()
    frames = [(f.positions[:3000, 1], f.velocities[:3000]) for f in scene.simulation().frames(420, 60)]
    highest = np.max([y for y, _ in frames], axis=0)
    lay, lies = ((y < 1e-3) & ~v.any(axis=1) for y, v in (frames[1], frames[-1]))
    again = lay & lies & (highest > 0.5)
    assert again.sum() > 10
    assert highest.max() > 2
