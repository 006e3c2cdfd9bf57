"""Largest safe steps against eigenvalues that are known."""

import time

import numpy as np
import pytest

import pointmass as pm
from pointmass.solvers.function_system import FunctionSystem
from pointmass.stability import eigenvalues, safe_bound


def chain(n, k=50.0, m=0.2, k_d=0.0, drag=0.0):
    x = np.stack([np.arange(n + 1.0), np.zeros(n + 1), np.zeros(n + 1)], axis=1)
    p = pm.Particles(x, m=m)
    p.pin([0])
    forces = [pm.Springs(np.stack([np.arange(n), np.arange(1, n + 1)], axis=1), k_s=k, k_d=k_d)]
    return pm.ParticleSystem(p, [*forces, pm.Drag(k=drag)] if drag else forces)


def sheet(n, k=100.0, k_d=0.0):
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    x = np.stack([i.ravel(), j.ravel(), 0 * i.ravel()], axis=1).astype(float)
    at = np.arange(n * n).reshape(n, n)
    lines = [(at[1:], at[:-1]), (at[:, 1:], at[:, :-1])]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in lines])
    return pm.ParticleSystem(pm.Particles(x), [pm.Springs(pairs, k_s=k, k_d=k_d)])


def test_nothing_limits_free_particles():
    system = pm.ParticleSystem(pm.Particles(np.zeros((10_000, 3))), [pm.Gravity()], [pm.Plane()])
    began = time.perf_counter()
    report = system.stability(pm.Leapfrog())
    assert time.perf_counter() - began < 10
    assert report.largest_safe_dt == np.inf
    assert (report.frequency, report.damping_ratio, report.period) == (0.0, 0.0, np.inf)


def test_no_particles():
    assert (
        pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity()]).stability(pm.RK4()).largest_safe_dt == np.inf
    )


@pytest.mark.parametrize(
    ("solver", "y"), [(pm.SymplecticEuler(), 2.0), (pm.Leapfrog(), 2.0), (pm.RK4(), 8**0.5), (pm.Euler(), 0.0)]
)
def test_single_spring(solver, y):
    system = chain(1)
    omega = np.sqrt(50 / 0.2)
    report = system.stability(solver)
    assert report.frequency == pytest.approx(omega, rel=1e-9)
    assert report.period == pytest.approx(2 * np.pi / omega, rel=1e-9)
    assert report.largest_safe_dt == pytest.approx(y / omega, rel=1e-6)


@pytest.mark.parametrize("solver", [pm.ImplicitEuler(), pm.ImplicitMidpoint(), pm.DormandPrince()])
def test_nothing_limits_these(solver):
    assert chain(3).stability(solver).largest_safe_dt == np.inf


@pytest.mark.parametrize("n", [2, 7, 40])
def test_chain(n):
    # stretched along the axis only: omega^2 = eigenvalues of k/m tridiag(-1, 2, -1) with one end free
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1
    omega = np.sqrt(50 / 0.2 * np.linalg.eigvalsh(stiffness).max())
    assert chain(n).stability(pm.SymplecticEuler()).largest_safe_dt == pytest.approx(2 / omega, rel=1e-6)


def test_damped_spring():
    # w h < 2 (sqrt(1 + zeta^2) - zeta)
    omega = np.sqrt(50 / 0.2)
    for zeta in (0.1, 0.5, 0.9):
        report = chain(1, k_d=2 * zeta * omega * 0.2).stability(pm.SymplecticEuler())
        assert report.damping_ratio == pytest.approx(zeta, rel=1e-9)
        assert report.largest_safe_dt * omega == pytest.approx(2 * (np.sqrt(1 + zeta**2) - zeta), rel=1e-6)


def test_drag_alone():
    system = pm.ParticleSystem(pm.Particles([[0, 0, 0], [1, 0, 0]], m=[1.0, 0.5]), [pm.Drag(k=4.0)])
    assert system.stability(pm.Euler()).largest_safe_dt == pytest.approx(2 * 0.5 / 4, rel=1e-6)
    assert system.stability(pm.RK4()).largest_safe_dt == pytest.approx(2.785293563 * 0.5 / 4, rel=1e-6)


@pytest.mark.parametrize("solver", [pm.Leapfrog(), pm.RK4(), pm.SymplecticEuler()])
@pytest.mark.parametrize("drag", [1.0, 60.0, 400.0])
def test_the_limit_holds_where_drag_and_springs_mix(solver, drag):
    # Strong drag on some and stiff springs on others: whatever limits, a run just below it stays bounded.
    p = pm.Particles([[0, 0, 0], [1, 0, 0], [5, 0, 0]], m=1.0)
    p.pin([0])
    system = pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=1e4, k_d=2.0), pm.Drag(k=drag, on=[2])])
    limit = system.stability(solver).largest_safe_dt
    p.x[1], p.v[2] = [1.01, 0, 0], [0.01, 0, 0]
    for factor, bounded in ((0.98, True), (1.1, False)):
        y = system.get_state()
        with np.errstate(all="ignore"):
            for _ in range(600):
                y = solver.step(system, 0.0, y, factor * limit, {}).y1
            assert (np.abs(y - system.get_state()).max() < 1) == bounded


def test_pinned_and_standing_particles():
    system = chain(3)
    system.particles.pin([0, 1, 2, 3])
    assert system.stability(pm.Leapfrog()).largest_safe_dt == np.inf
    floor = pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Gravity(), pm.Drag(k=1.0)], [pm.Plane()])
    assert floor.stability(pm.Euler()).largest_safe_dt == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("k_d", [0.0, 0.5])
def test_large_sheets_are_solved_fast_and_the_same_each_time(k_d):
    system = sheet(29, k_d=k_d)  # 5046 numbers
    began = time.perf_counter()
    one = system.stability(pm.SymplecticEuler()).largest_safe_dt
    assert time.perf_counter() - began < 60
    assert one == system.stability(pm.SymplecticEuler()).largest_safe_dt
    # rows of springs at rest do not feel each other: each is a free chain of 29
    omega = 2 * np.sqrt(100.0) * np.cos(np.pi / (2 * 29))
    zeta = k_d * omega / 200
    assert one == pytest.approx(2 * (np.sqrt(1 + zeta**2) - zeta) / omega, rel=1e-4)


def test_islands_are_solved_on_their_own():
    x = np.arange(60.0)[:, None] * [1, 0, 0]
    pairs = [(3 * i, 3 * i + 1) for i in range(20)]
    system = pm.ParticleSystem(pm.Particles(x), [pm.Springs(pairs, k_s=np.linspace(1, 20, 20))])
    frequencies = np.unique(np.abs(eigenvalues(system).imag).round(6))
    np.testing.assert_allclose(frequencies[1:], np.sqrt(2 * np.linspace(1, 20, 20)), rtol=1e-6)


def test_forces_that_are_not_finite():
    system = pm.ParticleSystem(pm.Particles(np.zeros((2, 3))), [pm.Gravitation()])
    with pytest.raises(pm.InvalidInput, match="not finite"):
        system.stability(pm.Leapfrog())


@pytest.mark.parametrize(("solver", "limit"), [("symplectic_euler", 2.0), ("euler", 2.0), ("rk4", 2.785294)])
def test_drag_on_unequal_masses_is_limited_by_the_lightest(solver: str, limit: float) -> None:
    """Each particle is on its own: h < limit m/k of the lightest, for any others beside it."""
    p = pm.Particles([[0, 0, 0], [1, 0, 0], [5, 5, 5]], m=[0.5, 1.0, 2.5])
    report = pm.ParticleSystem(p, [pm.Drag(0.5), pm.Gravity()]).stability(solver)
    assert report.largest_safe_dt == pytest.approx(limit, rel=1e-6)


def grows(system: pm.ParticleSystem, solver, dt: float) -> bool:
    """Whether the linear motion about now grows tenfold from its 300th step to its 600th."""
    n = system.dim // 2
    matrix = system.jacobian(0.0, system.get_state())
    linear = FunctionSystem(lambda t, y: matrix @ y, 2 * n, order=2, velocity_dependent=system.velocity_dependent)
    y = np.random.default_rng(1).normal(size=2 * n)
    sizes = []
    for _ in range(2):
        for _ in range(300):
            with np.errstate(all="ignore"):
                y = solver.step(linear, 0.0, y, dt, {}).y1
        sizes.append(np.abs(y[n:]).max())
    return not sizes[1] < 10 * sizes[0]


@pytest.mark.parametrize("solver", [pm.Leapfrog(), pm.SymplecticEuler(), pm.Yoshida4(), pm.RK4()])
def test_charges_on_springs_in_a_magnetic_field_with_drag(solver) -> None:
    """Stiffness, damping and turning that share no motions: the limit is still one, and not far from the true one."""
    rng = np.random.default_rng(5)
    p = pm.Particles(rng.normal(size=(6, 3)), m=[1, 2, 0.3, 1, 5, 0.7], charge=[1, 0, 2, -1, 0, 3])
    pairs = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (0, 3), (1, 4)]
    forces = [pm.Springs(pairs, k_s=np.geomspace(5, 200, 8), k_d=np.geomspace(3, 0.1, 8))]
    forces += [pm.Drag(2.0, on=[0, 2, 4]), pm.Magnetic((0.3, 1.0, 0.2))]
    system = pm.ParticleSystem(p, forces)
    limit = system.stability(solver).largest_safe_dt
    assert not grows(system, solver, 0.999 * limit)
    assert grows(system, solver, 1.6 * limit)


@pytest.mark.parametrize("n", [4, 22])
def test_a_damped_sheet_of_unequal_masses(n):
    """Solved for all motions (4) and for the fastest ones (22): one limit, for the splitting method a little lower."""
    system = sheet(n, k_d=0.5)
    system.particles.m[:] = np.linspace(0.5, 1.5, n * n)
    undamped = sheet(n)
    undamped.particles.m[:] = system.particles.m
    free = undamped.stability("symplectic_euler").largest_safe_dt
    omega = 2.0 / free
    zeta = 0.5 * omega / 200.0  # k_d/k_s = 2 zeta/omega for every motion
    limit = system.stability("symplectic_euler").largest_safe_dt
    assert limit == pytest.approx(2 * (np.sqrt(1 + zeta**2) - zeta) / omega, rel=1e-4)


def a_chain():
    body = pm.chain(8, k_s=500.0, damping_ratio=0.3, mass=2.4)
    return pm.ParticleSystem(body.particles, [*body.forces, pm.Drag(0.05)])


def a_lattice():
    body = pm.lattice((2, 2, 3), k_s=200.0, damping_ratio=0.2)
    return pm.ParticleSystem(body.particles, body.forces)


def two_damped_masses():
    springs = pm.Springs([(0, 1)], k_s=90.0, k_d=2.0)
    return pm.ParticleSystem(pm.Particles([[0, 0, 0], [0, 1, 0]], m=[0.3, 1.1]), [springs])


def a_hanging_net():
    """Held at two corners, in balance: its springs are stretched, so they also resist motion across."""
    at = np.arange(16).reshape(4, 4)
    lines = ((at[1:], at[:-1]), (at[:, 1:], at[:, :-1]))
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in lines])
    p = pm.Particles([[0.2 * (k % 4), -0.2 * (k // 4), 0] for k in range(16)], m=0.05)
    p.pin([0, 3])
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Drag(0.3), pm.Springs(pairs, k_s=100.0, k_d=0.4, rest=0.19)])
    pm.Simulation(system, pm.ImplicitEuler(), dt=0.5, compiled=False).step(80)
    return system


def a_chain_of_joints():
    """Straight, where an angle has no force at all, but its whole stiffness.

    The air damps it: a damped angle resists along the bend that there is, and near none that turns within a step.
    """
    p = pm.Particles(0.1 * np.arange(7.0)[:, None] * [1, 0, 0], m=0.02)
    p.pin([0, 1])
    links = pm.Springs([(k, k + 1) for k in range(6)], k_s=50.0)
    angles = pm.Angles([(k, k + 1, k + 2) for k in range(5)], k_s=0.5)
    return pm.ParticleSystem(p, [links, angles, pm.Drag(1.0)])


def a_lattice_of_unequal_masses():
    system = a_lattice()
    system.particles.m[:] *= np.geomspace(0.2, 5.0, 12)
    return system


def growth(system: pm.ParticleSystem, solver, dt: float) -> float:
    """How much larger speeds are after 800 steps than in the first three, from a displacement of a ten-millionth.

    That small, an unstable motion has room to grow before it is anything but linear.
    """
    p, n = system.particles, len(system.particles)
    y, memory = system.get_state(), solver.start(system)
    y[: 3 * n] += (1e-7 * np.random.default_rng(1).normal(size=(n, 3)) * ~p.pinned[:, None]).ravel()
    y[3 * n :] = 0.0
    first, last = 0.0, 0.0
    for k in range(800):
        with np.errstate(all="ignore"):
            step = solver.step(system, k * dt, y, dt, memory)
        y, memory = step.y1, step.memory
        last = float(np.abs(y[3 * n :]).max())
        first = max(first, last) if k < 3 else first
        if not last < 1e3 * first:
            return np.inf
    return last / first


@pytest.mark.parametrize(
    "make",
    [a_chain, a_lattice, two_damped_masses, a_hanging_net, a_chain_of_joints, a_lattice_of_unequal_masses],
)
def test_the_largest_safe_step_is_just_below_the_one_that_diverges(make) -> None:
    """Runs of the system itself: a little below nothing grows, and at 5/4 of it motions do."""
    system = make()
    for solver in (pm.Euler(), pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4(), pm.Heun()):
        limit = system.stability(solver).largest_safe_dt
        assert 0 < limit < np.inf, solver.name
        assert growth(system, solver, 0.97 * limit) < 1.0, solver.name
        assert growth(system, solver, 1.25 * limit) > 10.0, solver.name


def bound_of(system, solver):
    return safe_bound(system, solver), system.stability(solver).largest_safe_dt


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4()], ids=lambda s: s.name)
@pytest.mark.parametrize(
    "system",
    [
        chain(6, k_d=0.7, drag=0.3),
        sheet(5, k_d=0.4),
        pm.ParticleSystem((jelly := pm.jelly((3, 3, 4), (0.2, 0.2, 0.3), pinned="top")).particles, jelly.forces),
        pm.ParticleSystem((wig := pm.hair(2, 20, 0.2, style="curly")).particles, wig.forces),
        pm.ParticleSystem(pm.Particles(np.eye(3), m=0.5), [pm.Drag(k=3.0)]),
    ],
    ids=["chain", "sheet", "jelly", "hair", "drag"],
)
def test_a_bound_is_below_the_largest_safe_step(system, solver):
    bound, longest = bound_of(system, solver)
    assert 0.2 * longest < bound < 1.001 * longest


def test_a_bound_that_is_exact():
    assert bound_of(chain(1), pm.SymplecticEuler()) == pytest.approx((2 / np.sqrt(250),) * 2, rel=1e-6)
    assert bound_of(chain(1), pm.Euler()) == (0.0, 0.0)
    assert bound_of(chain(4), pm.ImplicitEuler()) == (np.inf, np.inf)
    assert bound_of(chain(4), pm.XPBD()) == (np.inf, np.inf)


def test_what_a_bound_does_not_know():
    pairs = pm.ParticleSystem(pm.Particles(np.eye(3)), [pm.Gravitation()])
    assert safe_bound(pairs, pm.Leapfrog()) is None
    assert safe_bound(pm.ParticleSystem(pm.Particles(np.eye(3)), [pm.Vortex()]), pm.RK4()) is None
    assert safe_bound(chain(2, k_d=0.1), pm.Euler()) is None  # amplifies what the damping does not reach, if anything
