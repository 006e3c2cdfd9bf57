"""Impacts and contact against their closed forms."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.collisions import respond, respond_pair
from pointmass.collisions.contact import Contacts
from pointmass.solvers import SOLVERS

G = 9.81
EXACT = ["leapfrog", "midpoint", "heun", "rk4", "yoshida4", "bs32", "dopri5", "implicit_midpoint"]


def drop(solver, dt, *colliders, x=(0, 1, 0), v=(0, 0, 0), forces=None, **particle):
    system = pm.ParticleSystem(
        pm.Particles(np.atleast_2d(x), v, **particle), [pm.Gravity()] if forces is None else forces, colliders
    )
    return pm.Simulation(system, solver, dt)


@pytest.mark.parametrize("dt", [1 / 30, 1 / 60, 1 / 240])
@pytest.mark.parametrize("name", EXACT)
def test_C01_bouncing_ball(name, dt):
    # Methods of order 2 are exact for constant forces, so impacts and heights are those of the parabolas at any dt.
    sim = drop(SOLVERS[name](), dt, pm.Plane(restitution=0.8))
    fall = np.sqrt(2 / G)
    impacts = [0.451524, 1.173961, 1.751912]
    for n, expected in enumerate(impacts):
        assert fall * (1 + 2 * sum(0.8**k for k in range(1, n + 1))) == pytest.approx(expected, abs=1e-6)
    for n, height in enumerate([0.64, 0.4096, 0.262144], start=1):
        top = impacts[n - 1] + 0.8**n * fall
        sim.step(int(top / dt) - sim.steps)
        y, v = sim.system.particles.x[0, 1], sim.system.particles.v[0, 1]
        assert y + v * v / (2 * G) == pytest.approx(height, rel=1e-6)
        assert sim.t + v / G == pytest.approx(top, rel=1e-6)


@pytest.mark.parametrize("dt", [1 / 30, 1 / 60, 1 / 1000])
def test_C02_ball_comes_to_rest(dt):
    sim = drop(pm.Leapfrog(), dt, pm.Plane(restitution=0.8, eps=1e-6))
    path, y = 0.0, 1.0
    while sim.system.particles.v.any() or sim.t == 0:
        sim.step()
        path += abs(sim.system.particles.x[0, 1] - y)
        y = sim.system.particles.x[0, 1]
    assert sim.t == pytest.approx(4.06371, rel=0.005, abs=dt)
    assert 0 <= y <= 1e-6
    if dt < 1 / 500:  # the sum leaves out what turns round inside of a step
        assert path == pytest.approx(4.55556, rel=0.005)
    sim.step(50)
    assert sim.system.particles.x[0, 1] == y
    assert not sim.system.particles.v.any()


@pytest.mark.parametrize("name", ["implicit_euler", "implicit_midpoint", "bdf2"])
def test_linked_blocks_are_braked_by_mu_g_and_stay_where_they_stop(name):
    """Under steady forces the drag that implicit solvers see is Coulomb's friction, until the last step."""
    blocks = pm.Particles([[0, 0, 0], [0.3, 0, 0]], [3, 0, 0])
    forces = [pm.Gravity(), pm.Springs([(0, 1)], 100.0, 1.0)]
    sim = pm.Simulation(pm.ParticleSystem(blocks, forces, [pm.Plane(friction=0.4)]), SOLVERS[name](), 1 / 60)
    sim.step(20)
    np.testing.assert_allclose(blocks.v, np.tile((3 - 0.4 * G * sim.t, 0, 0), (2, 1)), atol=1e-9)
    sim.step(40)
    assert not blocks.v.any()
    off = 0.03 if name == "implicit_euler" else 2e-3  # h v / 2 at the start; and h v / 2 of the step that stops them
    assert blocks.x[0, 0] == pytest.approx(9 / (2 * 0.4 * G), abs=off)


@pytest.mark.parametrize("compiled", [False, True], ids=["reference", "compiled"])
def test_friction_brings_no_energy_where_springs_are_stiffer_than_the_step_is_long(compiled):
    """The edge of a patch of cloth is bent up, stretched and lets go. A force of mu times what pressed at its
    start, for all of a step in which the springs relax, turned round who slid, and nothing came to rest."""
    patch = pm.cloth(6, 6, 0.2, center=(0, 0, 0), right=(1, 0, 0), down=(0, 0, 1), radius=0.0)
    p = patch.particles
    p.x[p.x[:, 0] > 0.09] += (0.01, 0.02, 0)
    p.v[:, 0] = 0.2
    system = pm.ParticleSystem(p, [pm.Gravity(), *patch.forces], [pm.Plane(friction=0.4, restitution=0.0)])
    sim = pm.Simulation(system, pm.ImplicitEuler(tolerance=1e-3), 1 / 60, compiled=compiled)
    sim.step(20)
    assert not p.v.any()
    assert system.energy().total < 1e-6


@pytest.mark.parametrize("name", sorted(SOLVERS))
@pytest.mark.parametrize("dt", [1 / 30, 1 / 240])
def test_C03_block_stops(name, dt):
    sim = drop(SOLVERS[name](), dt, pm.Plane(friction=0.4), x=(0, 0, 0), v=(3, 0, 0))
    stop = 3 / (0.4 * G)
    assert stop == pytest.approx(0.764526, rel=1e-5)
    sim.step(int(stop / dt))
    assert sim.system.particles.v[0, 0] > 0
    sim.step(2)
    assert not sim.system.particles.v.any()
    off = {1: 0.5 * 3 * dt, 2: 0.4 * G * dt**2}  # Euler is off by a h t / 2, BDF2 by its first step
    bound = off[1] if SOLVERS[name].order == 1 else off[2] if name == "bdf2" else 0
    assert sim.system.particles.x[0, 0] == pytest.approx(1.14679, rel=1e-5, abs=bound)
    at = sim.system.particles.x.copy()
    sim.step(100)
    np.testing.assert_array_equal(sim.system.particles.x, at)


@pytest.mark.parametrize("name", sorted(SOLVERS))
@pytest.mark.parametrize("slope", [1e-6, 0.05, 0.36])
def test_C04_incline_rests(name, slope):
    mu = slope / 0.9
    normal = np.array([-slope, 1, 0])
    sim = drop(SOLVERS[name](), 1 / 60, pm.Plane(normal=normal, friction=mu), x=(0, 0, 0))
    sim.step(300)
    np.testing.assert_array_equal(sim.system.particles.x, 0)
    np.testing.assert_array_equal(sim.system.particles.v, 0)


@pytest.mark.parametrize("name", sorted(SOLVERS))
@pytest.mark.parametrize("slope", [0.05, 0.4, 2.0])
def test_C04_incline_slides(name, slope):
    mu, angle = slope / 1.1, np.arctan(slope)
    sim = drop(SOLVERS[name](), 1 / 60, pm.Plane(normal=(-np.sin(angle), np.cos(angle), 0), friction=mu), x=(0, 0, 0))
    sim.step(60)
    downhill = -np.array([np.cos(angle), np.sin(angle), 0])
    a = G * (np.sin(angle) - mu * np.cos(angle))
    assert sim.system.particles.v[0] @ downhill == pytest.approx(a, rel=1e-9)
    assert abs(sim.system.particles.v[0] @ [-np.sin(angle), np.cos(angle), 0]) < 1e-12


def test_C04_no_creep():
    sim = drop(pm.SymplecticEuler(), 1 / 60, pm.Plane(normal=(-0.3, 1, 0.2), friction=0.4), x=(0, 0.05, 0))
    sim.step(200)
    at = sim.system.particles.x.copy()
    sim.step(3_000)
    np.testing.assert_array_equal(sim.system.particles.x, at)


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_C05_rest(name):
    sim = drop(SOLVERS[name](), 1 / 60, pm.Plane(eps=1e-4), x=(0, 0, 0))
    sim.step(10_000 if name == "symplectic_euler" else 300)
    assert abs(sim.system.particles.x[0, 1]) <= 1e-4
    assert sim.system.particles.v[0, 1] >= -1e-12


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_C06_moving_plane_hits_resting_particle(name):
    plane = pm.Plane(point=("-1 + 2*t", 0, 0), normal=(1, 0, 0), restitution=1)
    sim = drop(SOLVERS[name](), 1 / 60, plane, x=(0, 0, 0), forces=[])
    sim.step(60)
    assert sim.system.particles.v[0, 0] == pytest.approx(4, rel=1e-12)
    assert sim.system.particles.x[0, 0] == pytest.approx(4 * (1 - 0.5), rel=1e-9)


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_C07_no_tunnelling(name):
    for speed in (100.0, 1e4):
        thin = pm.Polygon([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], thickness=2e-3, restitution=0.5)
        sim = drop(SOLVERS[name](), 1 / 10, thin, x=(-1, 0.3, 0.1), v=(speed, 0, 0), forces=[])
        sim.step(3)
        assert sim.system.particles.v[0, 0] == pytest.approx(-0.5 * speed, rel=1e-9)


def test_C09_pair_of_spheres():
    n = np.array([0.6, 0.8, 0.0])
    x1, x2 = n[None], np.zeros((1, 3))
    v1, v2 = np.array([[-3.0, -1.0, 0.5]]), np.array([[1.0, 0.2, 0.1]])
    w1, w2 = respond_pair(x1, v1, 1.0, x2, v2, 2.0, 0.6)
    before, after = (v1 - v2)[0], (w1 - w2)[0]
    assert after @ n == pytest.approx(-0.6 * (before @ n), rel=1e-12)
    np.testing.assert_allclose(after - (after @ n) * n, before - (before @ n) * n, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(w1 + 2 * w2, v1 + 2 * v2, rtol=1e-12)


@pytest.mark.parametrize(("mu", "tangential"), [(0.3, 1.2), (1.0, 0.0)])
def test_C10_coulomb_impact(mu, tangential):
    after = respond(np.array([[3.0, -4.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]), np.zeros(3), 0.5, mu)
    np.testing.assert_allclose(after, [[tangential, 2.0, 0.0]], rtol=1e-12, atol=1e-15)


BALL, ROD = pm.Sphere, lambda **k: pm.Capsule((0, 0, -1), (0, 0, 1), radius=1.0, **k)


@pytest.mark.parametrize(
    ("solver", "body"),
    [(pm.Leapfrog(), BALL), (pm.RK4(), BALL), (pm.DormandPrince(rtol=1e-8), BALL), (pm.Leapfrog(), ROD)],
)
def test_leaves_a_sphere_at_two_thirds(solver, body):
    # From rest at the top of a smooth sphere: m v^2 / R = m g cos, v^2 = 2 g R (1 - cos), so cos = 2/3.
    angle, eps = 0.02, 1e-10  # once off, the gap grows as t^3 at first: 10 eps^(1/3) late
    sim = drop(solver, 1 / 500, body(friction=0, eps=eps), x=(np.sin(angle), np.cos(angle), 0), v=(0, 0, 0))
    surface = sim.system.colliders[0]
    last = None
    while sim.t < 3 and surface.distance(sim.system.particles.x, sim.t)[0] <= eps:
        last = sim.system.particles.x[0, 1]
        sim.step()
    # it started at cos(angle), so it leaves at 2/3 of that; one step at the speed there is 4e-3 of height
    assert last == pytest.approx(2 / 3 * np.cos(angle), abs=4e-3)


@pytest.mark.parametrize(
    ("name", "tolerance", "bowl"),
    [
        ("leapfrog", 1e-3, BALL),
        ("rk4", 1e-7, BALL),
        ("implicit_midpoint", 1e-3, BALL),
        ("leapfrog", 1e-3, lambda **k: pm.Cylinder((0, 0, -1), (0, 0, 1), radius=1.0, **k)),
    ],
)
def test_bowl_conserves_energy(name, tolerance, bowl):
    # Pendulum without a rod: the bowl does no work. Second order: (omega h)^2 / 24 ~ 1e-5 of the energy per swing.
    sim = drop(SOLVERS[name](), 1 / 240, bowl(inside=True, friction=0), x=(0.8, -0.6, 0))
    start, lowest = sim.system.energy().total, 0.0
    for _ in range(480):
        sim.step()
        lowest = min(lowest, sim.system.particles.x[0, 1])
        assert sim.system.energy().total == pytest.approx(start, abs=tolerance * G)
        assert abs(np.linalg.norm(sim.system.particles.x) - 1) <= 1e-4
    assert lowest < -0.99


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_rests_on_an_oscillating_floor(name):
    # 0.1 m at 1 Hz accelerates with 4 m/s^2 < g, so a ball stays on it.
    floor = pm.Plane(point=(0, "0.1*sin(6.283185307179586*t)", 0), restitution=0.5)
    sim = drop(SOLVERS[name](), 1 / 60, floor, x=(0, 0, 0), v=(0, 0.2 * np.pi, 0))
    for _ in range(120):
        sim.step()
        assert sim.system.particles.x[0, 1] == pytest.approx(0.1 * np.sin(2 * np.pi * sim.t), abs=2e-4)


def test_is_carried_by_a_floor_that_moves_sideways():
    floor = pm.Plane(point=("0.2*sin(3*t)", 0, 0), friction=0.5)  # 1.8 m/s^2 < mu g
    sim = drop(pm.SymplecticEuler(), 1 / 60, floor, x=(0, 0, 0), v=(0.6, 0, 0))
    for _ in range(200):
        sim.step()
        assert sim.system.particles.x[0, 0] == pytest.approx(0.2 * np.sin(3 * sim.t), abs=1e-9)


def test_rests_in_a_groove():
    # Two planes at 30 degrees: the loads of both have to be found together, and no part of them may lift it out.
    walls = [pm.Plane(normal=(s, 2, 0), friction=0) for s in (1, -1)]
    sim = drop(pm.RK4(), 1 / 60, *walls, x=(0, 0, 0))
    sim.step(200)
    assert np.abs(sim.system.particles.x).max() < 1e-9
    load = 0.5 * G / np.cos(np.arctan(0.5))
    contacts, x, v = Contacts(walls, 2, lagged=False), sim.system.particles.x, sim.system.particles.v
    f = np.array([[0, -G, 0.0]])
    contacts.find(x, v, np.ones(1), f.copy, np.zeros(1), np.zeros(1), np.ones(1, bool))
    contacts.forces(0.0, x, v, np.ones(1), f)
    np.testing.assert_allclose(f, 0, atol=1e-10)
    for stand in contacts.standing:
        assert np.linalg.norm(stand.given) == pytest.approx(load, rel=1e-9)


@pytest.mark.parametrize("name", ["euler", "rk4", "dopri5", "implicit_euler"])
def test_a_flow_follows_a_wall(name):
    system = pm.ParticleSystem(pm.Particles([[0, 0.3, 0]]), [pm.Flow(velocity=(1.0, -1.0, 0.0))], [pm.Plane(eps=1e-4)])
    sim = pm.Simulation(system, SOLVERS[name](), 1 / 60)
    sim.step(60)
    x = system.particles.x[0]
    assert x[0] == pytest.approx(1.0, rel=1e-9)
    assert 0 <= x[1] <= 1e-4


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.RK4(), pm.ImplicitEuler()])
def test_a_net_falls_on_a_sphere(solver):
    n = 6
    grid = np.array([[i, 0, j] for i in range(n) for j in range(n)]) * 0.1 - [0.25, -0.35, 0.25]
    pairs = [(a, b) for a in range(n * n) for b in range(a) if np.linalg.norm(grid[a] - grid[b]) < 0.15]
    ball = pm.Sphere(radius=0.3, friction=0.5, restitution=0)
    system = pm.ParticleSystem(
        pm.Particles(grid, m=0.01), [pm.Gravity(), pm.Drag(k=0.01), pm.Springs(pairs, k_s=100.0, k_d=0.1)], [ball]
    )
    sim = pm.Simulation(system, solver, 1 / 240)
    for _ in range(240):
        sim.step()
        assert ball.distance(system.particles.x, sim.t).min() >= -1e-9
    assert (ball.distance(system.particles.x, sim.t) < 1e-3).sum() >= 4
    assert system.particles.x[:, 1].max() > 0.25


@pytest.mark.parametrize(
    ("name", "contact"),
    [("leapfrog", "swept"), ("rk4", "discrete"), ("dopri5", "swept"), ("implicit_euler", "discrete")],
)
def test_stays_where_it_hit_a_sticky_surface(name, contact):
    # A ceiling that moves to and fro: neither gravity nor its acceleration tears the particle off.
    ceiling = pm.Plane(("0.3*sin(5*t)", 1, "0.1*t"), (0, -1, 0), response="stick", contact=contact)
    sim = drop(SOLVERS[name](), 1 / 240, ceiling, x=(0, 0.5, 0), v=(1, 6, 0))
    sim.step(40)
    hit = 0.5 / 6  # nearly straight up
    local = sim.system.particles.x - ceiling.at(sim.t)
    late = 6 / 240 if contact == "discrete" else 0.0
    assert local[0] == pytest.approx([hit - 0.3 * np.sin(5 * hit), 0, -0.1 * hit], abs=0.01 + late)
    np.testing.assert_allclose(sim.system.particles.v[0], ceiling.velocity(sim.t), rtol=1e-12)
    sim.step(150)
    np.testing.assert_allclose(sim.system.particles.x - ceiling.at(sim.t), local, rtol=0, atol=1e-13)


@pytest.mark.parametrize("contact", ["swept", "discrete"])
def test_a_sticky_ball_at_rest_keeps_every_bit(contact):
    rng = np.random.default_rng(2)
    x = rng.normal(size=(50, 3))
    x *= 2 / np.linalg.norm(x, axis=1)[:, None]
    ball = pm.Sphere(response="stick", contact=contact)
    sim = drop(pm.SymplecticEuler(), 1 / 60, ball, x=x, v=-5 * x, forces=[pm.Gravity(), pm.Drag(0.1)])
    sim.step(60)
    at = sim.system.particles.x.copy()
    assert np.abs(ball.distance(at, 0.0)).max() < 1e-4
    assert not sim.system.particles.v.any()
    sim.step(100)
    np.testing.assert_array_equal(sim.system.particles.x, at)


def test_slides_along_without_friction():
    floor = pm.Plane(normal=(-0.6, 0.8, 0), response="slide", restitution=1.0, friction=2.0)
    sim = drop(pm.Leapfrog(), 1 / 100, floor, x=(-0.06, 0.08, 0), v=(0.6, -0.8, 0.5))
    sim.step(100)
    downhill = np.array([-0.8, -0.6, 0])
    v = sim.system.particles.v[0]
    hit = 0.1 / (0.5 * G * 0.8)  # of the way 0.1 m against the normal, from above: at most this time
    assert abs(v @ floor.direction) < 1e-12
    assert v[2] == pytest.approx(0.5, rel=1e-12)
    assert v @ downhill == pytest.approx(0.6 * G, abs=0.6 * hit)
