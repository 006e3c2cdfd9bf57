"""Every collider of the registry, unasked."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.solvers import SOLVERS
from tests.covering import covering
from tests.shapes import SHEET, TETRAHEDRON

X, Z = np.meshgrid(np.linspace(-2.2, 2.2, 10), np.linspace(-2.2, 2.2, 9), indexing="ij")
HILLS = 0.3 * np.sin(2 * X) * np.cos(Z)
GRID = np.stack(np.meshgrid(*[np.linspace(-1.2, 1.2, 13)] * 3, indexing="ij"))
PEAR = np.sqrt(GRID[0] ** 2 + (1.2 * GRID[1]) ** 2 + GRID[2] ** 2) / 1.2 - 0.6 + 0.1 * GRID[1]
EXAMPLES = {
    "plane": [pm.Plane(), pm.Plane(point=(0, "0.1*sin(3*t)", 0), normal=(1, 2, -1), friction=0.0)],
    "sphere": [
        pm.Sphere(radius=0.7),
        pm.Sphere(center=("0.3*sin(2*t)", 0, 0), radius=0.5, restitution=1.0),
        pm.Sphere(radius=2.0, inside=True),
    ],
    "box": [pm.Box(size=(1, 0.5, 2)), pm.Box(center=(0.1, "0.2*cos(t)", 0)), pm.Box(size=(3, 3, 3), inside=True)],
    "polygon": [
        pm.Polygon([[-1, 0, -1], [-1, 0, 1], [1, 0.5, 1], [1, 0.5, -1]]),
        pm.Polygon([[0, 0, 0], [1, 0, 0], [0, 1, 0]], thickness=0.1, shift=(0, "0.1*t", 0)),
    ],
    "capsule": [
        pm.Capsule((-0.5, 0.2, 0), (0.6, -0.3, 0.4), radius=0.4),
        pm.Capsule(shift=("0.2*sin(2*t)", 0, 0), restitution=1.0),
        pm.Capsule((0, 0, 0), (0, 0, 1), radius=1.8, inside=True),
    ],
    "cylinder": [
        pm.Cylinder((-0.5, 0.2, 0), (0.6, -0.3, 0.4), radius=0.6),
        pm.Cylinder(shift=(0, "0.2*sin(2*t)", 0)),
        pm.Cylinder((0, -2, 1), (1, 2, 0), radius=1.9, inside=True),
    ],
    "distance_grid": [
        pm.DistanceGrid(PEAR, spacing=0.2),
        pm.DistanceGrid(PEAR[2:, :, 1:], spacing=(0.2, 0.25, 0.2), origin=(-1, -1, -1), shift=(0, "0.2*sin(2*t)", 0)),
        pm.DistanceGrid(2 * PEAR, spacing=0.4, inside=True),
    ],
    "height_field": [
        pm.HeightField(HILLS, (4.4, 4.4), depth=0.5),
        pm.HeightField(HILLS[::3, ::2], (2, 3), height=0.5, shift=(0.1, "0.2*sin(2*t)", 0)),
    ],
    "mesh": [
        pm.Mesh(TETRAHEDRON),
        pm.Mesh(TETRAHEDRON, scale=2.5, inside=True),
        pm.Mesh(SHEET, thickness=0.1),
        pm.Mesh(SHEET, shift=(0, "0.1*t", 0.2), restitution=1.0),
    ],
}
ALL = [pytest.param(c, id=f"{name}-{k}") for name, several in EXAMPLES.items() for k, c in enumerate(several)]
colliders = pytest.mark.parametrize("collider", ALL)


def points(seed, n, size=2.0):
    return np.random.default_rng(seed).uniform(-size, size, (n, 3))


def test_every_collider_has_an_example():
    assert set(EXAMPLES) == set(pm.COLLIDERS)
    for name, several in EXAMPLES.items():
        assert all(type(c) is pm.COLLIDERS[name] for c in several)


@colliders
def test_C08_gradient_is_the_normal(collider):
    x, t, step = points(1, 400), 0.3, 1e-6
    steps = step * np.eye(3)
    there = np.stack([collider.normal(x + s, t) for s in (*steps, *-steps)])
    smooth = (np.abs(there - there[0]).max(axis=(0, 2)) < 1e-3) & (np.abs(collider.distance(x, t)) > 1e-4)
    x = x[smooth]  # off the bisectors, where the normal jumps
    assert len(x) > 350
    gradient = np.stack([(collider.distance(x + s, t) - collider.distance(x - s, t)) / (2 * step) for s in steps], 1)
    if isinstance(collider, pm.DistanceGrid):  # linear in each cell: its slope is only about 1
        gradient /= np.linalg.norm(gradient, axis=1)[:, None]
    np.testing.assert_allclose(gradient, collider.normal(x, t), atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(collider.normal(x, t), axis=1), 1, rtol=1e-12)


@colliders
def test_distance_is_at_most_the_way(collider):
    a, b = points(2, 300), points(3, 300)
    change = np.abs(collider.distance(a, 0.1) - collider.distance(b, 0.1))
    assert (change <= collider.steepness * np.linalg.norm(a - b, axis=1) + 1e-12).all()


@colliders
def test_bending_is_the_second_derivative(collider):
    x, v, s = points(4, 300), points(5, 300), 1e-3
    x = x[np.linalg.norm(x, axis=1) > 0.3]
    v = v[: len(x)]
    for surface in collider.surfaces:
        ends = surface.local_distance(x + s * v) + surface.local_distance(x - s * v) - 2 * surface.local_distance(x)
        jump = np.abs(surface.local_normal(x + s * v) - surface.local_normal(x - s * v)).max(axis=1) > 0.05
        bend = surface.bending(x, v)
        jump |= np.abs(surface.bending(x + s * v, v) - surface.bending(x - s * v, v)) > 0.02 + 0.1 * np.abs(bend)
        assert bend.any() == (surface.curved and not surface.lookup)
        if surface.curved and not surface.lookup:  # those that are looked up are taken to be flat pieces
            np.testing.assert_allclose((ends / s**2)[~jump], bend[~jump], rtol=0.02, atol=0.02)


@colliders
def test_motion_is_differentiated_exactly(collider):
    t, s = np.linspace(0, 2, 7), 1e-5
    shape = (len(t), 3)
    at = {k: np.broadcast_to(collider.at(t + k * s), shape) for k in (-1, 0, 1)}
    np.testing.assert_allclose(np.broadcast_to(collider.velocity(t), shape), (at[1] - at[-1]) / (2 * s), atol=1e-8)
    bend = (at[1] + at[-1] - 2 * at[0]) / s**2
    np.testing.assert_allclose(np.broadcast_to(collider.acceleration(t), shape), bend, atol=1e-4)
    assert collider.moves == bool(np.abs(at[0] - at[0][0]).max() > 0)


@colliders
def test_mesh_is_closed_and_points_outwards(collider):
    corners, faces = collider.mesh(10.0)
    _, first, same = np.unique(corners.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    corners, faces = corners[first], same.ravel()[faces]  # a sharp edge of a round body has its corners twice
    used = corners[faces]
    if collider.lookup:  # of any shape: those that are closed have a volume
        assert (used[:, 0] * np.cross(used[:, 1], used[:, 2])).sum() > 0
    normals = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])
    area = np.linalg.norm(normals, axis=1)
    assert (area > 1e-9).all(), "no triangle is degenerate"
    middle = used.mean(axis=1)
    if isinstance(collider, pm.Plane):
        assert (normals @ collider.direction > 0).all()
        np.testing.assert_allclose(collider.local_distance(corners), 0, atol=1e-12)
        return
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = {tuple(e) for e in edges.tolist()}
    assert len(there) == len(edges), "no two triangles run along an edge in the same direction"
    assert {(b, a) for a, b in there} == there, "every edge has a triangle on both sides"
    center = corners.mean(axis=0)
    assert collider.lookup or ((normals * (middle - center)).sum(axis=1) > 0).all()


@colliders
def test_arguments_are_remembered(collider):
    for same in (type(collider)(**collider.arguments), copy.deepcopy(collider), pickle.loads(pickle.dumps(collider))):
        x = points(6, 20)
        np.testing.assert_array_equal(same.distance(x, 0.7), collider.distance(x, 0.7))
        np.testing.assert_array_equal(same.normal(x, 0.7), collider.normal(x, 0.7))
        assert repr(same) == repr(collider)


@colliders
@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    restitution=st.floats(0, 1),
    friction=st.floats(0, 3),
    speed=st.floats(1e-6, 1e6),
)
def test_a_response_adds_no_energy_and_stays_in_the_friction_cone(collider, seed, restitution, friction, speed):
    x = points(seed, 20)
    v = speed * points(seed + 1, 20)
    n, motion = collider.normal(x, 0.2), collider.velocity(0.2)
    before, after = v - motion, pm.respond(v, n, motion, restitution, friction) - motion
    size = (before**2).sum(axis=1) + (motion**2).sum()
    assert ((after**2).sum(axis=1) <= (before**2).sum(axis=1) + 1e-12 * size).all()
    into = np.minimum((before * n).sum(axis=1), 0)
    away = np.where(into < 0, -restitution * into, (before * n).sum(axis=1))
    np.testing.assert_allclose((after * n).sum(axis=1), away, atol=1e-9 * speed + 1e-12)
    tangential = (after - before) - ((after - before) * n).sum(axis=1)[:, None] * n
    push = (1 + restitution) * np.abs(into)
    assert (np.linalg.norm(tangential, axis=1) <= friction * push + 1e-9 * speed + 1e-12).all()
    kept = before - (before * n).sum(axis=1)[:, None] * n
    assert ((kept + tangential) * kept >= -1e-9 * speed**2 - 1e-12).all(), "friction turns nothing round"


def scene(colliders, seed, solver, dt, speed, gravity, radius, dtype=float, pairs=()):
    rng = np.random.default_rng(seed)
    p = pm.Particles(rng.uniform(-1.4, 1.4, (8, 3)), speed * rng.normal(size=(8, 3)), radius=radius, m=0.5, dtype=dtype)
    p.pin([0])
    forces = [pm.Gravity(gravity), pm.Drag(k=0.05)]
    if len(pairs):
        forces.append(pm.Springs(pairs, k_s=20.0, k_d=0.2))
    return pm.Simulation(pm.ParticleSystem(p, forces, colliders), solver, dt)


@settings(max_examples=25, deadline=None)
@given(
    kind=st.integers(0, 2**20),
    seed=st.integers(0, 2**32 - 1),
    name=st.sampled_from(sorted(SOLVERS)),
    dt=st.sampled_from([1 / 10, 1 / 60, 1 / 240]),
    speed=st.sampled_from([0.0, 1.0, 30.0, 1e4]),
    tilt=st.floats(-9, 9),
    radius=st.sampled_from([0.0, 0.05]),
    linked=st.booleans(),
)
def test_nobody_ends_inside(kind, seed, name, dt, speed, tilt, radius, linked):
    everything = [c for several in EXAMPLES.values() for c in several if not c.moves]
    rng = np.random.default_rng(kind)
    chosen = [everything[k] for k in rng.choice(len(everything), 2, replace=False)]
    pairs = [(1, 2), (2, 3)] if linked else ()
    dt = min(dt, 1 / 60) if speed > 1e3 else dt  # a path of a kilometre has thousands of chords
    sim = scene(chosen, seed, SOLVERS[name](), dt, speed, (tilt, -9.81, 0), radius, pairs=pairs)
    p = sim.system.particles
    start = np.stack([np.minimum(c.distance(p.x, 0) - p.radius, 0) for c in chosen])
    pinned = p.x[0].copy()
    for _ in range(15):
        try:
            sim.step()
        except pm.Diverged:
            assert sim.solver.implicit, "Newton's method may give up on a wild scene, and says so"
            break
        for c, before in zip(chosen, start, strict=True):
            depth = c.distance(p.x, sim.t) - p.radius
            assert (depth - before >= -1e-9 * (1 + np.abs(p.x).max(axis=1))).all()
        np.testing.assert_array_equal(p.x[0], pinned)
        assert not p.v[0].any()


@colliders
def test_a_room_has_walls_of_its_own_material(collider):
    arguments = {"restitution": 0.2, "friction": 0.9, "eps": 1e-3, "contact": "discrete", "response": "stick"}
    made = type(collider)(**collider.arguments | arguments)
    assert all(surface.material == arguments for surface in (made, *made.surfaces))


@pytest.mark.parametrize(
    ("collider", "name"), covering(4, ALL, ["symplectic_euler", "rk4", "dopri5", "implicit_euler"])
)
def test_the_same_bits_twice(collider, name):
    states = []
    for _ in range(2):
        sim = scene([copy.deepcopy(collider)], 3, SOLVERS[name](), 1 / 60, 3.0, (1, -9.81, 0), 0.02)
        sim.step(20)
        states.append(sim.system.get_state().tobytes())
    assert states[0] == states[1]


@colliders
@pytest.mark.parametrize("contact", ["swept", "discrete"])
def test_float32_bounces_like_float64(collider, contact):
    results = []
    for dtype in (np.float32, np.float64):
        collider = type(collider)(**collider.arguments | {"contact": contact, "friction": 0.0})
        sim = scene([collider], 5, pm.Leapfrog(), 1 / 120, 0.5, (0, -9.81, 0), 0.02, dtype)
        sim.step(12)
        results.append(sim.system.particles.x)
        assert sim.system.particles.x.dtype == dtype
    np.testing.assert_allclose(results[0], results[1], atol=2e-4)
