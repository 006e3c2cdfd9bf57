"""Shapes that attract: orbits, energies and ends of the pull, against formulas."""

import numpy as np
import pytest

import pointmass as pm


def flight(force, x, v, steps, dt=1e-3, solver="rk4", compiled=False, **colliders):
    system = pm.ParticleSystem(pm.Particles([x], [v], m=0.3), [force], **colliders)
    sim = pm.Simulation(system, solver, dt, compiled=compiled)
    sim.step(steps)
    return system


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_around_a_line_the_orbital_speed_is_the_same_at_any_radius(radius):
    """strength / r = v^2 / r."""
    line = pm.LineAttractor((0, 0, -50), (0, 0, 50), strength=4.0, power=1.0, eps=1e-9)
    quarter = radius * np.pi / 2 / 2.0
    p = flight(line, (radius, 0, 0), (0, 2, 0), 1000, quarter / 1000).particles
    np.testing.assert_allclose(p.x, [[0, radius, 0]], atol=1e-9)
    np.testing.assert_allclose(p.v, [[-2, 0, 0]], atol=1e-9)


def test_a_point_pulls_like_gravity_and_a_spring():
    """With power 2 and -1 a ring of radius 0 is what an Attractor and a Harmonic are."""
    x, v = (1.0, 0.2, -0.4), (0.1, 0.9, 0.3)
    for one, two in (
        (pm.RingAttractor(radius=0, strength=2.0, power=2.0, eps=0.1), pm.Attractor(2.0, eps=0.1)),
        (pm.RingAttractor(radius=0, strength=2.0, power=-1.0), pm.Harmonic(k_s=2.0 * 0.3)),
    ):
        np.testing.assert_allclose(
            *(flight(force, x, v, 300, 0.01).particles.x for force in (one, two)), rtol=0, atol=1e-12
        )


def test_towards_a_plane_the_pull_is_constant():
    """A fall to an attracting plane and through it, to the same height on the other side (eps is small)."""
    force = pm.SurfaceAttractor([pm.Plane()], strength=2.0, eps=1e-6)
    p = flight(force, (0, 1, 0), (0.5, 0, 0), 500).particles
    np.testing.assert_allclose(p.x, [[0.25, 1 - 0.25, 0]], atol=1e-9)
    p = flight(force, (0, 1, 0), (0.5, 0, 0), 2000, solver="leapfrog").particles
    np.testing.assert_allclose(p.x, [[1, -1, 0]], atol=2e-3)


def test_beyond_its_reach_there_is_no_pull():
    ring = pm.RingAttractor(radius=1.0, strength=50.0, reach=0.5)
    free = flight(ring, (0, 0.51, 1), (3, 0, 0.1), 700, compiled=False).particles
    np.testing.assert_allclose(free.x, [[2.1, 0.51, 1.07]], atol=1e-12)
    caught = flight(ring, (0, 0.45, 1), (3, 0, 0.1), 700).particles
    assert np.abs(caught.x - [2.1, 0.45, 1.07]).max() > 0.1
    near = flight(ring, (0.7, 0, 0), (0, 0, 0), 1).particles  # d = 0.3: (1 - 0.36)^2 of the pull
    np.testing.assert_allclose(near.v[0, 0] / 1e-3, 50 * 0.3 / (0.3**2 + 0.05**2) * 0.64**2, rtol=1e-2)


@pytest.mark.parametrize(
    "force",
    [
        pm.LineAttractor((-1, 0, 0), (1, 0.3, 0), strength=3.0, power=1.5, eps=0.2),
        pm.RingAttractor((0, 0.1, 0), (1, 1, 0), radius=0.7, strength=3.0, power=1.0, eps=0.2),
        pm.SurfaceAttractor([pm.Sphere(radius=0.8), pm.Plane((0, -1, 0))], strength=2.0, power=0.999999999, eps=0.2),
        pm.SurfaceAttractor([pm.Box(size=(1, 1, 1), inside=True)], strength=2.0, power=-1.0),
    ],
)
def test_energy_is_kept(force):
    before = flight(force, (0.9, 0.4, 0.3), (0.2, 0.4, 0.9), 0).energy()
    after = flight(force, (0.9, 0.4, 0.3), (0.2, 0.4, 0.9), 2000).energy()
    assert after.total == pytest.approx(before.total, abs=2e-7)
    assert abs(after.kinetic - before.kinetic) > 0.02


def test_with_drag_everybody_comes_to_rest_on_the_shape():
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, (40, 3))
    ball = pm.SurfaceAttractor([pm.Sphere(("0.1*t", 0, 0), radius=0.8)], strength=6.0, power=-1)
    ring = pm.RingAttractor(radius=0.8, axis=(0, 0, 2), strength=6.0, power=-1)
    for force, off in (
        (ball, lambda x: np.linalg.norm(x - [2.0, 0, 0], axis=1) - 0.8),
        (ring, lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 0.8, x[:, 2])),
    ):
        system = pm.ParticleSystem(pm.Particles(x), [force, pm.Wind((0.1 if force is ball else 0, 0, 0), k=4.0)])
        pm.Simulation(system, "rk4", 0.01, compiled=False).step(2000)
        np.testing.assert_allclose(off(system.particles.x), 0, atol=1e-6)


def test_compiled_kernels_have_the_bits_of_the_reference():
    rng = np.random.default_rng(2)
    x, v = rng.uniform(-1, 1, (2, 300, 3))
    ends = []
    for compiled in (False, True):
        forces = [
            pm.LineAttractor((0, "-t", 0), (0, 1, 0), strength=2.0, power=1.3, reach=1.5),
            pm.RingAttractor(strength="0.5 + chance"),
            pm.SurfaceAttractor([pm.Sphere(("t", 0, 0)), pm.Box()], power=2.0, eps=0.3),
        ]
        system = pm.ParticleSystem(pm.Particles(x, v), forces)
        pm.Simulation(system, "leapfrog", 0.01, compiled=compiled).step(40)
        ends.append(system.particles.x)
    np.testing.assert_array_equal(*ends)


def test_in_a_scene_file_and_back():
    forces = [
        pm.LineAttractor(b=("t", 1, 0), reach=2.0),
        pm.RingAttractor(radius="0.5 + 0.1*sin(t)"),
        pm.SurfaceAttractor([pm.Sphere((0, 1, 0), 0.3), pm.Plane()], strength=-2.0),
    ]
    scene = pm.Scene(emitters=[pm.PointEmitter()], forces=forces)
    assert pm.Scene.from_toml(scene.to_toml()) == scene


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.LineAttractor((1, 1, 1), (1, 1, 1)), "a and b of a line attractor are both"),
        (lambda: pm.LineAttractor(eps=0), "eps = 0"),
        (lambda: pm.RingAttractor(radius=-1), "radius = -1"),
        (lambda: pm.RingAttractor(axis=(0, 0, 0)), "axis = "),
        (lambda: pm.RingAttractor(reach=0), "reach = 0"),
        (lambda: pm.SurfaceAttractor([]), r"around = \[\] is not allowed"),
        (lambda: pm.SurfaceAttractor("sphere"), "around must be a list of colliders"),
        (pm.SurfaceAttractor, "needs the parameter 'around'"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says):
        make()
