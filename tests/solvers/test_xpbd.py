"""XPBD: elements that are relaxed one by one."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.laws.colouring import coloured

DT = 1 / 60
BOTH = pytest.mark.parametrize("compiled", [False, True])


def hanging(solver, *, links=6, k=500.0, k_d=2.0, dt=DT, compiled=False):
    """Masses on a vertical line: all forces keep their directions."""
    chain = pm.chain(links, 1.0, direction=(0, -1, 0), mass=0.3, k_s=k, damping_ratio=0.0)
    chain.forces[0].set(k_d=k_d)
    return pm.Simulation(
        pm.ParticleSystem(chain.particles, [pm.Gravity(), *chain.forces]), solver, dt, compiled=compiled
    )


def jelly(solver, *, dt=DT, counts=(3, 3, 3), floor=False, compiled=True, dtype=np.float64, k=3000.0):
    block = pm.lattice(counts, (1, 1, 1), center=(0, 1.2, 0), tilt=20, k_s=k, damping_ratio=0.1)
    p = block.particles
    particles = pm.Particles(p.x, p.v, p.m, dtype=dtype)
    if not floor:
        particles.pin([0, 2])
    floors = [pm.Plane(restitution=0.2, friction=0.5)] if floor else []
    return pm.Simulation(
        pm.ParticleSystem(particles, [pm.Gravity(), pm.Drag(0.01), *block.forces], floors),
        solver,
        dt,
        compiled=compiled,
    )


@BOTH
def test_many_sweeps_are_backward_euler(compiled):
    ours, exact = hanging(pm.XPBD(2000), compiled=compiled), hanging(pm.ImplicitEuler())
    ours.step(4)
    exact.step(4)
    np.testing.assert_allclose(ours.system.particles.x, exact.system.particles.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.system.particles.v, exact.system.particles.v, rtol=0, atol=1e-9 / DT)


@BOTH
def test_one_spring_is_solved_at_once(compiled):
    """m v1 = m v + h (m g - k (y1 + L) - k_d v1) with y1 = y + h v1, for a mass on a spring that hangs down."""
    sim = hanging(pm.XPBD(), links=1, k=40.0, k_d=0.7, compiled=compiled)
    m, k, k_d, y, v = 0.3, 40.0, 0.7, -1.0, 0.0
    for _ in range(20):
        v = (m * v + DT * (-9.81 * m - k * (y + 1.0))) / (m + DT * k_d + DT * DT * k)
        y = y + DT * v
        sim.step()
        assert sim.system.particles.x[1, 1] == pytest.approx(y, abs=1e-13)
        assert sim.system.particles.v[1, 1] == pytest.approx(v, abs=1e-12)


def test_it_converges_with_short_steps_of_one_sweep():
    """Order 1: half the step, half the error."""
    exact = jelly(pm.RK4(), dt=DT / 64)
    exact.step(64 * 12)
    errors = []
    for n in (32, 64):
        sim = jelly(pm.XPBD(), dt=DT / n)
        sim.step(n * 12)
        errors.append(np.abs(sim.system.particles.x - exact.system.particles.x).max())
    assert errors[0] < 0.01
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.1)


def test_a_hanging_chain_comes_to_rest_where_it_should():
    """Link i from the top bears what hangs below it."""
    sim = hanging(pm.XPBD(200), k=2000.0, k_d=8.0, dt=1 / 30, compiled=True)
    sim.step(600)
    y = sim.system.particles.x[:, 1]
    below = np.arange(6, 0, -1) * 0.3 / 6 * 9.81
    np.testing.assert_allclose(-np.diff(y) - 1 / 6, below / 2000.0, rtol=1e-6)


@pytest.mark.parametrize("k", [1e3, 1e6, 1e9, 1e12])
def test_no_stiffness_is_too_large(k):
    sim = jelly(pm.XPBD(3), k=k, dt=1 / 60)
    sim.step(120)
    assert np.abs(sim.system.particles.v).max() < 20.0
    assert np.abs(sim.system.particles.x).max() < 10.0


@pytest.mark.parametrize("iterations", [1, 3])
@pytest.mark.parametrize("floor", [False, True])
def test_compiled_steps_have_the_bits_of_the_reference_path(iterations, floor):
    one, other = (jelly(pm.XPBD(iterations), floor=floor, compiled=c, dt=1 / 240) for c in (False, True))
    for _ in range(4):
        one.step(60)
        other.step(60)
        np.testing.assert_array_equal(one.system.particles.x, other.system.particles.x)
        np.testing.assert_array_equal(one.system.particles.v, other.system.particles.v)


def test_all_threads_on_one_island_have_the_same_bits(monkeypatch):
    from pointmass.engine import engine

    one = jelly(pm.XPBD(2), floor=True, dt=1 / 120)
    one.step(90)
    monkeypatch.setattr(engine, "LARGE", 1)
    other = jelly(pm.XPBD(2), floor=True, dt=1 / 120)
    other.step(90)
    np.testing.assert_array_equal(one.system.particles.x, other.system.particles.x)


def test_single_precision():
    one, other = (jelly(pm.XPBD(), dtype=d, dt=1 / 240) for d in (np.float64, np.float32))
    one.step(120)
    other.step(120)
    assert other.system.particles.x.dtype == np.float32
    np.testing.assert_allclose(one.system.particles.x, other.system.particles.x, rtol=0, atol=2e-4)


@BOTH
def test_momentum_and_pins(compiled):
    """A free block keeps its momentum to round-off; who is pinned stays to the bit."""
    block = pm.lattice((3, 3, 3), (1, 1, 1), velocity=(0.3, 0.2, -0.1), k_s=400.0)
    block.particles.v[0] += (2, 0, 1)
    sim = pm.Simulation(pm.ParticleSystem(block.particles, block.forces), pm.XPBD(), DT, compiled=compiled)
    before = sim.system.momentum()
    sim.step(100)
    np.testing.assert_allclose(sim.system.momentum(), before, rtol=0, atol=1e-13)
    pinned = jelly(pm.XPBD(), compiled=compiled)
    there = pinned.system.particles.x[[0, 2]].copy()
    pinned.step(100)
    np.testing.assert_array_equal(pinned.system.particles.x[[0, 2]], there)
    assert (pinned.system.particles.v[[0, 2]] == 0).all()


def test_what_lies_on_a_floor_is_held_by_friction_and_lifted_by_its_springs():
    """A chain whose one end is pinned in the air: what springs pull up leaves the floor, and the rest lies there."""
    chain = pm.chain(4, 1.0, direction=(1, 0, 0), mass=0.4, k_s=500.0, damping_ratio=0.4)
    p, floor = chain.particles, pm.Plane(friction=0.8, restitution=0.0)
    p.x[:] = [(0, 0.6, 0), (0.1, 0.4, 0), (0.2, 0, 0), (0.3, 0, 0), (0.5, 0, 0)]
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Drag(0.3), *chain.forces], floor)
    pm.Simulation(system, pm.XPBD(5), 1 / 120).step(2400)
    assert p.x[0, 1] == 0.6
    assert p.x[2, 1] > 0.05
    assert p.x[4, 1] == pytest.approx(0.0, abs=1e-3)
    assert (p.x[:, 1] >= -1e-12).all()
    assert np.abs(p.v).max() < 1e-3


def test_angles_are_relaxed_too():
    joints = pm.Angles([(0, 1, 2)], k_s=5.0, rest=1.0)
    p = pm.Particles([[0, 0, 0], [1, 0, 0], [2, 0.1, 0]])
    p.pin([0, 1])
    system = pm.ParticleSystem(p, [pm.Springs([(1, 2)], 1e5, 10.0), joints, pm.Drag(2.0)])
    pm.Simulation(system, pm.XPBD(4), 1 / 120).step(2400)
    assert joints.values(p, p.x)[0] == pytest.approx(1.0, abs=1e-6)


def test_colours():
    rng = np.random.default_rng(2)
    rows = np.sort(rng.permuted(np.tile(np.arange(40), (300, 1)), axis=1)[:, :3], axis=1)
    colours = coloured(rows, 40)
    for colour in range(colours.max() + 1):
        nodes = rows[colours == colour].ravel()
        assert len(nodes) == len(set(nodes.tolist()))
    assert set(colours.tolist()) == set(range(colours.max() + 1))
    np.testing.assert_array_equal(colours, coloured(rows, 40))
    star = np.stack([np.zeros(200, int), np.arange(1, 201)], axis=1)
    assert sorted(coloured(star, 201).tolist()) == list(range(200))
    assert len(coloured(np.zeros((0, 2), int), 5)) == 0


def test_it_refuses_flows_and_bad_numbers():
    flow = pm.ParticleSystem(pm.Particles([[1, 0, 0]]), pm.Vortex())
    with pytest.raises(pm.InvalidInput, match="xpbd needs x'' = f/m"):
        pm.Simulation(flow, pm.XPBD(), 0.1).step()
    with pytest.raises(pm.InvalidInput, match="iterations = 0 is not allowed"):
        pm.XPBD(0)
