"""The first hit of a cubic path."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.collisions.swept import Paths, first_hit

FLOATS = st.floats(-2, 2)
POINTS = st.tuples(FLOATS, FLOATS, FLOATS)
SURFACES = [
    pm.Plane(normal=(1, 3, 1)),
    pm.Sphere(radius=0.8),
    pm.Sphere(radius=3, inside=True),
    pm.Box(size=(1, 2, 0.5)),
    pm.Polygon([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]),
    pm.Sphere(center=("sin(3*t)", 0, 0), radius=0.8),
    pm.Capsule((-0.5, -0.5, 0), (0.5, 0.3, 0.2), radius=0.3),
    pm.Capsule((-1, 0, 0), (1, 1, 0), radius=3, inside=True),
    pm.Cylinder((-0.5, -0.5, 0), (0.5, 0.3, 0.2), radius=0.6),
    *pm.Cylinder((0, -3, 0), (1, 3, 0), radius=3, inside=True).surfaces,
    pm.Mesh(([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])),
    pm.Mesh(([[-1, 0, -1], [-1, 0, 1], [1, 0.4, 1], [1, 0, -1]], [[0, 1, 2], [0, 2, 3]]), shift=("sin(3*t)", 0, 0)),
    pm.DistanceGrid(np.linalg.norm(np.indices((9, 9, 9)) - 4.0, axis=0) / 4 - 0.6, spacing=0.25),
    pm.HeightField([[0.1, 0.5, -0.3], [0.2, -0.6, 0.3], [0.0, 0.1, 0.4]], (3, 3)),
]


def path(x0, v0, x1, v1, h=1.0, radius=0.0):
    rows = [np.array([a], float) for a in (x0, v0, x1, v1)]
    return Paths(*rows, np.zeros(1), np.array([h]), np.array([radius]))


@settings(max_examples=80, deadline=None)
@given(st.sampled_from(SURFACES), POINTS, POINTS, POINTS, POINTS, st.sampled_from([0.0, 0.1]))
def test_the_first_hit_is_the_first(surface, x0, v0, x1, v1, radius):
    p = path(x0, v0, x1, v1, radius=radius)
    theta = first_hit(surface, p)[0]
    s = np.linspace(0, 1, 2001)
    many = Paths(*(np.repeat(a, len(s), axis=0) for a in (p.x0, p.v0, p.x1, p.v1, p.t0, p.h, p.radius)))
    gap = surface.distance(many.position(s), many.time(s)) - radius
    gap -= min(gap[0], 0)
    # within a chord the path may dip in by up to eps, but no deeper, and never ends inside
    assert (gap[s < theta] >= -2 * surface.eps).all()
    if np.isfinite(theta):
        at = surface.distance(p.position(np.array([theta])), p.time(np.array([theta]))) - radius
        level = min(float(surface.distance(p.x0, p.t0)[0]) - radius, 0)
        assert 0 <= at[0] - level <= 1e-12
    else:
        assert gap[-1] >= 0


@pytest.mark.parametrize("speed", [1.0, 1e2, 1e4, 1e6])
def test_impact_of_a_bullet(speed):
    thin = SURFACES[4]
    theta = first_hit(thin, path((0, 1, 0), (0, -speed, 0), (0, 1 - speed, 0), (0, -speed, 0)))[0]
    if speed > 1:
        assert theta * speed == pytest.approx(1 - 1e-3, rel=1e-9)


def test_impact_of_a_ballistic_path_is_exact():
    g, h = 9.81, 1.0
    theta = first_hit(pm.Plane(), path((0, 1, 0), (0, 0, 0), (0, 1 - g / 2, 0), (0, -g, 0), h))[0]
    assert theta == pytest.approx(np.sqrt(2 / g), rel=1e-14)


@pytest.mark.parametrize(("offset", "hits"), [(-1e-6, True), (1e-6, False)])
def test_grazing(offset, hits):
    y = 0.8 + offset
    theta = first_hit(pm.Sphere(radius=0.8), path((-5, y, 0), (10, 0, 0), (5, y, 0), (10, 0, 0)))[0]
    assert np.isfinite(theta) == hits


def test_a_corner_of_a_box():
    box = pm.Box(size=(2, 2, 2))
    for aside, hits in ((0.0, True), (2.1, False)):
        theta = first_hit(box, path((3 + aside, 3, 0), (-4, -4, 0), (-1 + aside, -1, 0), (-4, -4, 0)))[0]
        assert np.isfinite(theta) == hits


def test_who_starts_inside_may_leave_but_not_sink():
    plane = pm.Plane()
    assert first_hit(plane, path((0, -1, 0), (0, 1, 0), (0, 0.5, 0), (0, 1, 0)))[0] == np.inf
    assert first_hit(plane, path((0, -1, 0), (0, -1, 0), (0, -2, 0), (0, -1, 0)))[0] == 0
    assert first_hit(plane, path((0, 0, 0), (0, -1, 0), (0, -2, 0), (0, -1, 0)))[0] == 0
    assert first_hit(plane, path((0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)))[0] == np.inf


def test_a_fast_floor_hits_a_resting_particle():
    floor = pm.Plane(point=(0, "-1 + 5*t", 0))
    assert first_hit(floor, path((0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)))[0] == pytest.approx(0.2, rel=1e-12)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("compiled", [False, None])
def test_who_bounces_off_a_ball_flies_on(compiled, dtype):
    """Nobody hits the ball again from a rounding inside it, where the bounce began, until it has had too many."""
    random, center = np.random.default_rng(5), np.array([0.2, 0.1, -0.1])
    out = random.normal(size=(3000, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    v = 0.9 * random.normal(size=out.shape) - out
    toward = -(v * out).sum(axis=1)
    out, v, toward = out[toward > 0.2], v[toward > 0.2], toward[toward > 0.2]
    x = center + out * (0.8 + random.uniform(0, 0.009, len(out)) * toward)[:, None]  # they hit within a step
    ball = pm.Sphere(center, 0.8, restitution=0.5, friction=0.0)
    system = pm.ParticleSystem(pm.Particles(x, v, dtype=dtype), [pm.Drag(0.1)], ball)
    sim = pm.Simulation(system, pm.SymplecticEuler(), dt=0.01, compiled=compiled)
    sim.step()
    normal = (system.particles.x - center) / np.linalg.norm(system.particles.x - center, axis=1)[:, None]
    away = (system.particles.v * normal).sum(axis=1)
    assert system.particles.v.any(axis=1).all()  # nobody is stopped for hitting too often
    assert np.median(away / toward) == pytest.approx(0.5, rel=0.02)
