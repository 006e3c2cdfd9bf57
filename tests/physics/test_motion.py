"""Flows, falls, springs, chains and pendulums against their closed forms."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.solvers import SOLVERS
from pointmass.stability import eigenvalues

G = 9.81


def run(forces, x, v=None, solver=None, dt=1 / 100, steps=100, m=1.0, pinned=(), **columns):
    system = pm.ParticleSystem(pm.Particles(x, v, m=m, **columns), forces)
    system.particles.pin(list(pinned))
    sim = pm.Simulation(system, solver, dt)
    sim.step(steps)
    return sim


def crossings(sim, value, count):
    """Times at which value() goes from negative to positive, by linear interpolation between steps."""
    found, before = [], value()
    while len(found) < count:
        sim.step()
        now = value()
        if before < 0 <= now:
            found.append(sim.t - sim.dt * now / (now - before))
        before = now
    return np.array(found)


# ---------------------------------------------------------------------------------------------------- flows


def test_D01_solid_rotation_with_euler():
    flow = pm.Flow(velocity=("-y", "x", 0))
    sim = run([flow], [[1, 0, 0]], solver=pm.Euler(), dt=0.01, steps=629)
    radius = np.linalg.norm(sim.system.particles.x)
    assert radius == pytest.approx((1 + 0.01**2) ** (629 / 2), rel=1e-12)


@pytest.mark.parametrize("steps", [50, 200])
def test_D02_point_vortex_comes_back(steps):
    radius, circulation = 0.5, 2.0
    period = 4 * np.pi**2 * radius**2 / circulation
    sim = run([pm.Vortex(circulation=circulation, eps=0)], [[radius, 0, 0]], dt=period / steps, steps=steps)
    np.testing.assert_allclose(sim.system.particles.x, [[radius, 0, 0]], atol=1e-4 * radius)


@pytest.mark.parametrize("sign", [1, -1])
def test_D04_two_vortices(sign):
    d, circulation, t = 0.8, 1.5, 2.0
    sim = run(
        [pm.PointVortices()], [[-d / 2, 0, 0], [d / 2, 0, 0]],
        solver=pm.RK4(), dt=t / 200, steps=200, circulation=[circulation, sign * circulation],
    )  # fmt: skip
    x = sim.system.particles.x
    if sign > 0:
        turned = np.arctan2(x[1, 1], x[1, 0])
        assert turned == pytest.approx(circulation / (np.pi * d**2) * t, rel=1e-4)
        assert np.linalg.norm(x[1] - x[0]) == pytest.approx(d, rel=1e-4)
    else:
        np.testing.assert_allclose(np.abs(x[:, 1]), circulation / (2 * np.pi * d) * t, rtol=1e-4)
        assert x[0, 1] == pytest.approx(x[1, 1], rel=1e-12)


# ---------------------------------------------------------------------------------------------------- falls


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_F01_ballistic_error(name):
    h, t = 1 / 32, 2.0
    sim = run([pm.Gravity((1.0, -G, 0.0))], [[0, 0, 0]], [[3, 4, 5]], SOLVERS[name](), h, 64)
    g = np.array([1.0, -G, 0])
    exact = np.array([3, 4, 5]) * t + 0.5 * g * t * t
    sign = {"euler": -1, "symplectic_euler": 1, "implicit_euler": 1, "xpbd": 1}.get(name, 0)
    if name == "bdf2":  # its first step is one of backward Euler: off by a h^2 / 2, and the method carries that on
        assert np.abs(sim.system.particles.x - exact).max() < 2 * G * h**2
        return
    np.testing.assert_allclose(sim.system.particles.x[0] - exact, sign * 0.5 * g * h * t, atol=1e-10)
    np.testing.assert_allclose(sim.system.particles.v[0], np.array([3, 4, 5]) + g * t, rtol=1e-10)


def test_F02_linear_drag():
    m, k, t = 0.3, 0.2, 1.5
    sim = run([pm.Gravity(), pm.Drag(k=k)], [[0, 0, 0]], [[4, 2, 0]], pm.DormandPrince(rtol=1e-9), 0.05, 30, m)
    tau, v0 = m / k, np.array([4, 2, 0])
    end = tau * np.array([0, -G, 0])
    fade = np.exp(-t / tau)
    np.testing.assert_allclose(sim.system.particles.v[0], end + (v0 - end) * fade, rtol=1e-6)
    np.testing.assert_allclose(sim.system.particles.x[0], end * t + (v0 - end) * tau * (1 - fade), rtol=1e-6)


def test_F03_quadratic_drag():
    m, c, t = 0.3, 0.05, 2.0
    sim = run([pm.Gravity(), pm.QuadraticDrag(c=c)], [[0, 0, 0]], None, pm.DormandPrince(rtol=1e-9), 0.05, 40, m)
    top = np.sqrt(m * G / c)
    assert sim.system.particles.v[0, 1] == pytest.approx(-top * np.tanh(G * t / top), rel=1e-6)
    assert sim.system.particles.x[0, 1] == pytest.approx(-(top**2) / G * np.log(np.cosh(G * t / top)), rel=1e-6)


# ---------------------------------------------------------------------------------------------------- springs


def test_F06_period_of_two_masses():
    mu, k = 1 * 3 / 4, 20.0
    sim = run(
        [pm.Springs([(0, 1)], k_s=k, rest=1.0)], [[0, 0, 0], [1.1, 0, 0]],
        solver=pm.DormandPrince(rtol=1e-9), dt=1 / 500, steps=0, m=[1.0, 3.0],
    )  # fmt: skip
    x = sim.system.particles.x
    times = crossings(sim, lambda: float(x[1, 0] - x[0, 0]) - 1, 4)
    np.testing.assert_allclose(np.diff(times), 2 * np.pi * np.sqrt(mu / k), rtol=1e-4)


def test_F07_logarithmic_decrement():
    k, zeta = 20.0, 0.1
    omega = np.sqrt(2 * k)
    springs = pm.Springs([(0, 1)], k_s=k, k_d=zeta * omega, rest=1.0)  # zeta = k_d / (2 sqrt(k mu)), mu = 1/2
    cycle = 2 * np.pi / (omega * np.sqrt(1 - zeta**2))
    sim = run([springs], [[0, 0, 0], [1.1, 0, 0]], solver=pm.DormandPrince(rtol=1e-9), dt=cycle / 50, steps=0)
    x, stretch = sim.system.particles.x, []
    for _ in range(4):
        stretch.append(float(x[1, 0] - x[0, 0]) - 1)
        sim.step(50)
    np.testing.assert_allclose(-np.diff(np.log(stretch)), 0.631484, rtol=1e-4)


@pytest.mark.parametrize("solver", [pm.Leapfrog(), pm.ImplicitEuler(linear_solver="cg")], ids=lambda s: s.name)
def test_K03_hanging_chain(solver):
    n, m, k = 5, 0.1, 200.0
    x = np.stack([np.zeros(n + 1), -0.2 * np.arange(n + 1), np.zeros(n + 1)], axis=1)
    pairs = [(i, i + 1) for i in range(n)]
    sim = run(
        [pm.Gravity(), pm.Springs(pairs, k_s=k, k_d=1.0), pm.Drag(k=0.3)], x,
        solver=solver, dt=1 / 60, steps=900, m=m, pinned=[0],
    )  # fmt: skip
    stretch = -sim.system.particles.x[-1, 1] - 0.2 * n
    assert stretch == pytest.approx(m * G * n * (n + 1) / (2 * k), rel=1e-6)
    assert np.abs(sim.system.particles.v).max() < 1e-7


@pytest.mark.parametrize(("angle", "ratio"), [(10, 1.001907), (90, 1.180341), (120, 1.372881)])
def test_H01_pendulum_on_a_spring_rod(angle, ratio):
    k = G / 1e-4  # m g / (k L) = 1e-4
    a = np.radians(angle)
    start = [np.sin(a), -np.cos(a), 0]
    sim = run(
        [pm.Gravity(), pm.Springs([(0, 1)], k_s=k, rest=1.0)], [[0, 0, 0], start],
        solver=pm.RK4(), dt=1 / 1000, steps=0, pinned=[0],
    )  # fmt: skip
    x = sim.system.particles.x
    first, second = crossings(sim, lambda: float(x[1, 0]), 2)
    assert second - first == pytest.approx(ratio * 2 * np.pi * np.sqrt(1 / G), rel=5e-4)


@pytest.mark.parametrize("n", [2, 5])
def test_H02_modes_of_a_hanging_chain(n):
    # Small transverse swings of a chain of n links: omega^2 = (g / l) * roots of the Laguerre polynomial L_n.
    length, m, k = 0.1, 0.05, 1e5
    x = np.stack([np.zeros(n + 1), -length * np.arange(n + 1), np.zeros(n + 1)], axis=1)
    for i in range(n):  # hung: each link bears what is below it
        x[i + 1 :, 1] -= (n - i) * m * G / k
    pairs = [(i, i + 1) for i in range(n)]
    particles = pm.Particles(x, m=m)
    particles.pin([0])
    system = pm.ParticleSystem(particles, [pm.Gravity(), pm.Springs(pairs, k_s=k, rest=length)])
    frequencies = np.unique(np.abs(eigenvalues(system).imag).round(6))
    swings = frequencies[(frequencies > 0) & (frequencies < 0.1 * np.sqrt(k / m))]
    roots = np.polynomial.laguerre.lagroots([0] * n + [1])
    unique = swings[np.append(True, np.diff(swings) > 1e-3 * swings[1:])]
    np.testing.assert_allclose(unique, np.sqrt(G / length * roots), rtol=0.01)
    if n > 2:
        return
    # and the slowest one in time
    mode = np.real(np.linalg.eig(transverse(n))[1][:, np.argmin(np.linalg.eigvals(transverse(n)).real)])
    particles.x[1:, 0] = 1e-3 * length * mode / np.abs(mode).max() * np.sign(mode[-1])
    sim = pm.Simulation(system, pm.Leapfrog(), 5e-4)
    first, second = crossings(sim, lambda: float(system.particles.x[-1, 0]), 2)
    assert 2 * np.pi / (second - first) == pytest.approx(np.sqrt(G / length * roots.min()), rel=0.01)


def transverse(n):
    """l/g times the matrix of x'' = -A x for a hanging chain of n equal masses (tensions n, ..., 1)."""
    tension = np.arange(n, 0, -1.0)
    a = np.diag(tension + np.append(tension[1:], 0))
    return a - np.diag(tension[1:], 1) - np.diag(tension[1:], -1)


@pytest.mark.parametrize("h", [1 / 60, 1 / 240])
@pytest.mark.parametrize("iterations", [1, 20])
def test_a_mass_on_a_spring_of_xpbd_hangs_as_deep_as_on_any(h, iterations):
    """Stretch m g / k_s for every step and number of sweeps (Macklin et al. 2016), where PBD's would depend on both.

    From the rest length it swings with backward Euler's damping, w^2 h/2 = 2/s at the least: e^-20 is left after 10 s.
    """
    p = pm.Particles([[0, 0, 0], [0, -1, 0]], m=1.0)
    p.pin([0])
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)], k_s=1000.0)])
    pm.Simulation(system, pm.XPBD(iterations), dt=h, compiled=False).run(10.0)
    assert -p.x[1, 1] - 1.0 == pytest.approx(9.81 / 1000.0, rel=1e-6)
