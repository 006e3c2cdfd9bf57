"""Impacts inside of steps: islands, many events, corners, moving surfaces."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.engine.reference import MOST_EVENTS, ReferenceEngine
from pointmass.solvers import SOLVERS


def engine(x, v, colliders, forces=(), solver=None, **columns):
    system = pm.ParticleSystem(pm.Particles(x, v, **columns), forces, colliders)
    return ReferenceEngine(system, solver or pm.Leapfrog()), system.particles


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_two_impacts_in_one_step(name):
    e, p = engine(
        [[0, 0, 0]], [[5, 0, 0]], [pm.Box(size=(2, 2, 2), inside=True, restitution=1)], solver=SOLVERS[name]()
    )
    e.step(0, 0.6)  # 3 m: to x = 1, back to -1 would be 3 m
    assert p.x[0, 0] == pytest.approx(-1, abs=1e-9)
    e.step(0.6, 1.0)
    assert p.x[0, 0] == pytest.approx(1, abs=1e-9)


def test_a_linked_particle_finishes_the_step_ballistically():
    e, p = engine(
        [[0, 0.1, 0], [5, 5, 5]], [[0, -1, 0], [0, 0, 0]], [pm.Plane(restitution=0.5)],
        [pm.Springs([(0, 1)], k_s=0.0)],
    )  # fmt: skip
    e.step(0, 0.3)
    np.testing.assert_allclose(p.x[0], [0, 0.1, 0], atol=1e-12)
    np.testing.assert_allclose(p.v[0], [0, 0.5, 0], atol=1e-12)
    assert e.stats.steps == 1


def test_between_two_closing_walls_it_rests_in_the_end():
    # Each bounce is shorter than the one before: the number of events is bounded and nobody tunnels.
    walls = [pm.Plane(point=("-1 + t", 0, 0), normal=(1, 0, 0)), pm.Plane(point=("1 - t", 0, 0), normal=(-1, 0, 0))]
    e, p = engine([[0, 0, 0]], [[30, 0, 0]], walls)
    for k in range(9):
        e.step(0.1 * k, 0.1 * (k + 1))
        assert abs(p.x[0, 0]) <= 1 - 0.1 * (k + 1) + 1e-9
    assert e.stats.steps <= 9 * (MOST_EVENTS + 2)


@pytest.mark.parametrize("radius", [0.0, 0.05])
@pytest.mark.parametrize("gravity", [(0, -9.81, 0), (4, -5, 7), (-9.81, 0, 0)])
def test_comes_to_rest_in_a_corner(radius, gravity):
    room = pm.Box(size=(1, 1, 1), inside=True, restitution=0.4, friction=0.5)
    e, p = engine([[0.1, 0.2, -0.1]], [[1, 2, 3]], [room], [pm.Gravity(gravity)], radius=radius)
    for k in range(400):
        e.step(k / 60, (k + 1) / 60)
    assert room.distance(p.x, 0)[0] - radius >= -1e-12
    assert not p.v.any()
    x = p.x.copy()
    e.step(10, 11)
    np.testing.assert_array_equal(p.x, x)


@pytest.mark.parametrize("opening", [0.5, 5.0, 60.0, 170.0])
def test_comes_to_rest_in_a_wedge(opening):
    half = np.radians(opening / 2)
    walls = [pm.Plane(normal=(s * np.cos(half), np.sin(half), 0), restitution=0.3) for s in (1, -1)]
    e, p = engine([[0.0, 1, 0]], [[0.01, -1, 0]], walls, [pm.Gravity()])
    for k in range(90):
        e.step(k / 60, (k + 1) / 60)
        for wall in walls:
            assert wall.distance(p.x, 0)[0] >= -1e-9
    assert np.abs(p.v).max() < 0.1


def test_a_rising_floor_lifts():
    floor = pm.Plane(point=(0, "0.5*t**2", 0))
    e, p = engine([[0, 0, 0]], None, [floor], [pm.Gravity()], solver=pm.SymplecticEuler())
    for k in range(60):
        e.step(k / 60, (k + 1) / 60)
        assert 0 <= p.x[0, 1] - 0.5 * ((k + 1) / 60) ** 2 <= 2e-4


def test_a_moving_ball_pushes_and_does_not_swallow():
    ball = pm.Sphere(center=("-2 + 3*t", 0.01, 0), radius=0.5, restitution=0, friction=0)
    e, p = engine([[0, 0, 0]], None, [ball])
    for k in range(60):
        e.step(k / 60, (k + 1) / 60)
        assert ball.distance(p.x, (k + 1) / 60)[0] >= -1e-9
    assert p.v[0, 0] > 2.9


@pytest.mark.parametrize("collider", [pm.Plane(), pm.Sphere(center=(0, -1, 0)), pm.Box(center=(0, -0.5, 0))])
def test_on_the_surface_at_the_start(collider):
    e, p = engine([[0, 0, 0]], None, [collider], [pm.Gravity()])
    for k in range(30):
        e.step(k / 60, (k + 1) / 60)
    np.testing.assert_allclose(p.x, 0, atol=1e-9)


def test_who_starts_inside_does_not_sink():
    e, p = engine([[0, -0.3, 0], [0, -0.3, 0]], [[0, -2, 0], [0, 5, 0]], [pm.Plane()], [pm.Gravity()])
    for k in range(60):
        e.step(k / 60, (k + 1) / 60)
        assert p.x[0, 1] >= -0.3 - 1e-12
    assert p.x[1, 1] >= 0


def test_bdf2_forgets_at_an_impact():
    # After a bounce the parabola through the past would be wrong: a linked ball starts anew like a single one.
    results = []
    for springs in ([], [pm.Springs([(0, 1)], k_s=0.0)]):
        e, p = engine(
            [[0, 0.1, 0], [9, 9, 9]], [[0, -1, 0], [0, 0, 0]], [pm.Plane(restitution=1.0)], springs, pm.BDF2()
        )
        for k in range(12):
            e.step(k / 60, (k + 1) / 60)
        results.append(p.x[0, 1])
    np.testing.assert_allclose(results, 0.1, atol=1e-12)


NEIGHBOURS = [  # in the room below: position, velocity, radius
    ((0.0, -1.0, 0.1), (1.0, 0.0, 0.5), 0.0),  # slides along the floor
    ((1.0, -1.0, 0.2), (0.0, 0.0, 0.3), 0.0),  # stands on the floor and at a wall
    ((1.0, -1.0, 1.0), (0.0, 0.0, 0.0), 0.0),  # in a corner
    ((0.0, 0.3, 0.0), (0.2, 0.0, 0.0), 0.0),  # on the ball
    ((0.0, -0.2, -0.5), (4.0, -3.0, 1.0), 0.05),  # flies
    ((-0.5, 0.4, 0.3), (0.0, 0.0, 0.0), 0.05),  # falls onto the plate
    ((0.9, -0.9, -0.8), (9.0, -40.0, -7.0), 0.0),  # hits three walls at once
    ((-1.3, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1),  # begins inside a wall
]


@pytest.mark.parametrize("contact", ["swept", "discrete"])
@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_neighbours_change_no_bits(name, contact):
    """Who stands where, and in how many passes, is each particle's own affair."""
    x, v, radius = (np.array(column) for column in zip(*NEIGHBOURS, strict=True))
    m = np.linspace(0.5, 2, len(x))

    def run(rows):
        room = [
            pm.Box(size=(2, 2, 2), inside=True, restitution=0.4, friction=0.2, contact=contact),
            pm.Sphere(radius=0.3, contact=contact),
            pm.Polygon([[-1, 0.3, -1], [-1, 0.3, 1], [-0.4, 0, 1], [-0.4, 0, -1]], contact=contact),
            pm.Plane(point=("-0.9 + 0.1*sin(5*t)", 0, 0), normal=(1, 0, 0), contact=contact),
        ]
        forces = [pm.Gravity((2.0, -9.81, 0.5)), pm.Drag(0.1)]
        e, p = engine(x[rows], v[rows], room, forces, SOLVERS[name](), radius=radius[rows], m=m[rows])
        for k in range(12):
            e.step(k / 60, (k + 1) / 60)
        return np.concatenate([p.x, p.v], axis=1)

    everybody = run(slice(None))
    for k in range(len(x)):
        np.testing.assert_array_equal(everybody[k], run(slice(k, k + 1))[0])


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4()])
def test_a_body_of_springs_bounces_without_gaining_energy(solver):
    x = np.indices((3, 3, 3)).reshape(3, -1).T * 0.25 + [0, 0.5, 0]
    a, b = np.nonzero(np.tril(np.linalg.norm(x[:, None] - x, axis=2) < 0.45, -1))
    springs = pm.Springs(np.stack([a, b], axis=1), k_s=200.0)
    system = pm.ParticleSystem(pm.Particles(x, m=0.05), [springs, pm.Gravity()], [pm.Plane(restitution=1)])
    start = system.energy().total
    sim = pm.Simulation(system, solver, dt=1 / 250)
    for _ in range(6):
        sim.run(0.5)
        assert system.energy().total < 1.02 * start


@pytest.mark.parametrize("name", sorted(n for n, solver in SOLVERS.items() if solver.implicit))
def test_implicit_steps_of_float32_end_at_its_round_off(name):
    ends = []
    for dtype in (np.float32, np.float64):
        particles = pm.Particles([[i, 0, 0] for i in range(8)], m=0.2, dtype=dtype)
        particles.pin([0])
        springs = pm.Springs([[i, i + 1] for i in range(7)], k_s=5e3, k_d=1.0)
        system = pm.ParticleSystem(particles, [pm.Gravity(), pm.QuadraticDrag(c=0.1), springs])
        sim = pm.Simulation(system, SOLVERS[name](), dt=1 / 60)
        sim.step(30)
        ends.append(particles.x.astype(float))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-2)


@pytest.mark.parametrize("name", sorted(n for n, solver in SOLVERS.items() if solver.implicit))
def test_implicit_steps_of_float32_slide_in_a_bowl(name):
    bowl = pm.Sphere(radius=2.2, inside=True, restitution=0.0, friction=1.0)
    x, v = np.random.default_rng(0).normal(size=(2, 40, 3)) * [[[0.5]], [[10.0]]]
    e, p = engine(x, v, [bowl], [pm.Gravity()], SOLVERS[name](), dtype=np.float32)
    for k in range(40):
        e.step(k / 60, (k + 1) / 60)
    assert (bowl.distance(p.x, 40 / 60) > -1e-5).all()


def test_discrete_contact_leaves_nobody_inside_who_is_just_lifting_off():
    """Backward Euler turns the velocity of who slides down a ball outwards while the ball falls away below."""
    ball = pm.Sphere((0, -1, 0), radius=0.9, restitution=0, friction=1.0, contact="discrete")
    rng = np.random.default_rng(0)
    x, radius = rng.uniform(-1.2, 1.2, (300, 3)), rng.uniform(0, 0.12, 300)
    x, radius = (each[ball.distance(x, 0.0) - radius > 0.02][:40] for each in (x, radius))
    v, m = rng.normal(size=x.shape), rng.uniform(0.2, 2, len(x))
    e, p = engine(x, v, [ball], [pm.Gravity()], solver=pm.ImplicitEuler(), radius=radius, m=m)
    for k in range(50):
        e.step(k / 400, (k + 1) / 400)
        assert (ball.distance(p.x, 0) - p.radius).min() > -1e-12
