"""What the forces must do to a particle, against formulas: falls, swings, whirls.

SciPy's integrator stands in for a solver wherever a solution must be followed to a tolerance.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pointmass.forces import (
    Angles,
    Attractor,
    Drag,
    Field,
    Flow,
    Gravitation,
    Gravity,
    Harmonic,
    Magnetic,
    PointVortices,
    QuadraticDrag,
    Springs,
    Vortex,
    Wind,
)
from pointmass.laws.elements import spring_force
from pointmass.laws.force import Blocks
from pointmass.particles import Particles
from pointmass.system import ParticleSystem
from pointmass.tracing import functions as fn

G = 9.81


def run(system, end, tolerance=1e-11, **options):
    """Positions and velocities at `end` and at `t_eval`, each of shape (..., n, 3)."""
    y0 = system.get_state()
    solution = solve_ivp(system.deriv_eval, (0, end), y0, method="DOP853", rtol=tolerance, atol=tolerance, **options)
    assert solution.success
    return solution.y.T.reshape(len(solution.t), system.order, -1, 3), solution


def explicit(system, tableau, weights, dt, steps):
    """A textbook Runge-Kutta method with fixed steps."""
    y, nodes = system.get_state(), [sum(row) for row in tableau]
    for n in range(steps):
        slopes = []
        for row, c in zip(tableau, nodes, strict=True):
            slopes.append(
                system.deriv_eval((n + c) * dt, y + dt * sum(a * k for a, k in zip(row, slopes, strict=False)))
            )
        y = y + dt * sum(b * k for b, k in zip(weights, slopes, strict=True))
    return y


def rk4(system, dt, steps):
    return explicit(system, [[], [0.5], [0, 0.5], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], dt, steps)


# ------------------------------------------------------------------------------------------------ fall


def test_ballistic_flight_and_the_error_of_euler():
    ball = Particles([[0.0, 1.0, 0.0]], [[3.0, 4.0, 0.0]], 2.0)
    system = ParticleSystem(ball, [Gravity()])
    h, steps = 0.01, 50
    t = h * steps
    exact = np.array([3 * t, 1 + 4 * t - G * t * t / 2, 0])
    euler = explicit(system, [[]], [1.0], h, steps)
    np.testing.assert_allclose(euler[:3] - exact, [0, G * h * t / 2, 0], atol=1e-12)
    midpoint = explicit(system, [[], [0.5]], [0.0, 1.0], h, steps)
    np.testing.assert_allclose(midpoint[:3], exact, atol=1e-12)


def test_fall_with_linear_drag():
    m, k = 2.0, 0.7
    system = ParticleSystem(Particles([[0, 0, 0]], [[3, 1, 0]], m), [Gravity(), Drag(k=k)])
    states, _ = run(system, 3.0)
    tau, limit = m / k, np.array([0, -G * m / k, 0])
    v0, decay = np.array([3.0, 1.0, 0.0]), math.exp(-3.0 * k / m)
    np.testing.assert_allclose(states[-1, 1, 0], limit + (v0 - limit) * decay, atol=1e-6)
    np.testing.assert_allclose(states[-1, 0, 0], limit * 3.0 + (v0 - limit) * tau * (1 - decay), atol=1e-6)


def test_fall_with_quadratic_drag():
    m, c = 0.5, 0.02
    system = ParticleSystem(Particles([[0, 0, 0]], m=m), [Gravity(), QuadraticDrag(c=c)])
    states, _ = run(system, 2.5)
    limit = math.sqrt(m * G / c)
    assert -states[-1, 1, 0, 1] == pytest.approx(limit * math.tanh(G * 2.5 / limit), rel=1e-6)
    assert -states[-1, 0, 0, 1] == pytest.approx(limit**2 / G * math.log(math.cosh(G * 2.5 / limit)), rel=1e-6)
    coasting = ParticleSystem(Particles([[0, 0, 0]], [[5, 0, 0]], m), [QuadraticDrag(c=c)])
    assert run(coasting, 2.5)[0][-1, 1, 0, 0] == pytest.approx(5 / (1 + c * 5 * 2.5 / m), rel=1e-6)


def test_wind_carries_to_its_own_speed():
    dust = ParticleSystem(Particles([[0, 0, 0]], m=0.2), [Wind((3, 0, 1), k=0.5)])
    final = run(dust, 4.0)[0][-1, 1, 0]
    np.testing.assert_allclose(final, np.array([3, 0, 1]) * (1 - math.exp(-4.0 * 0.5 / 0.2)), rtol=1e-8)
    gusts = ParticleSystem(Particles([[0, 0, 0]]), [Wind(("3*sin(t)", 0, 0), k=1.0)])
    got = run(gusts, 2.0)[0][-1, 1, 0, 0]
    assert got == pytest.approx(1.5 * (math.sin(2) - math.cos(2) + math.exp(-2)), rel=1e-8)


# ------------------------------------------------------------------------------------------------ springs


def pair(m1, m2, k_s, k_d, stretch):
    masses = Particles([[0, 0, 0], [1 + stretch, 0, 0]], m=[m1, m2])
    return ParticleSystem(masses, [Springs([(0, 1)], k_s=k_s, k_d=k_d, rest=1.0)])


def crossing_times(system, end):
    def stretch(t, y):
        x = y[:6].reshape(2, 3)
        return np.linalg.norm(x[0] - x[1]) - 1.0

    _, solution = run(system, end, events=stretch)
    return solution.t_events[0]


def test_period_of_two_unequal_masses():
    m1, m2, k_s = 1.0, 3.0, 40.0
    times = crossing_times(pair(m1, m2, k_s, 0.0, 0.05), 5.0)
    period = 2 * math.pi * math.sqrt(m1 * m2 / (m1 + m2) / k_s)
    assert np.diff(times[::2]).mean() == pytest.approx(period, rel=1e-4)


def test_logarithmic_decrement():
    mu, k_s, zeta = 0.75, 40.0, 0.1
    system = pair(1.0, 3.0, k_s, 2 * zeta * math.sqrt(k_s * mu), 0.05)
    period = 2 * math.pi / (math.sqrt(k_s / mu) * math.sqrt(1 - zeta**2))
    states, _ = run(system, 2 * period, t_eval=[0, period, 2 * period])
    stretch = np.linalg.norm(states[:, 0, 0] - states[:, 0, 1], axis=1) - 1
    np.testing.assert_allclose(np.log(stretch[:-1] / stretch[1:]), 0.631484, rtol=1e-4)


def test_F05_a_rigid_rotation_is_not_damped():
    rod = Particles([[-0.5, 0, 0], [0.5, 0, 0]], [[0, -1, 0], [0, 1, 0]])
    springs = Springs([(0, 1)], k_s=0.0, k_d=5.0, rest=1.0)
    springs.bind(rod)
    f = np.zeros((2, 3))
    springs.add_forces(rod, 0.0, rod.x, rod.v, f)
    assert np.abs(f).max() < 1e-12

    @spring_force
    def as_printed(x1, v1, x2, v2, t, k_d=5.0):
        dx, dv = x1 - x2, v1 - v2
        return -k_d * fn.length(dv) * fn.inverse(fn.length(dx)) * dx

    printed = as_printed(pairs=[(0, 1)])
    printed.bind(rod)
    printed.add_forces(rod, 0.0, rod.x, rod.v, f)
    assert np.abs(f).max() > 1  # the slide's |dv| would push a rotating rod together


def test_spring_jacobian_against_the_closed_form():
    rng = np.random.default_rng(2)
    p = Particles(rng.standard_normal((2, 3)), rng.standard_normal((2, 3)))
    k_s, k_d, rest = 1.3, 0.4, 0.9
    force = Springs([(0, 1)], k_s, k_d, rest)
    force.bind(p)
    blocks = Blocks()
    force.add_jacobian(p, 0.0, p.x, p.v, blocks)
    dx, dv = (m.toarray() for m in blocks.matrices(2))
    d, u = p.x[0] - p.x[1], p.v[0] - p.v[1]
    length = np.linalg.norm(d)
    n = d / length
    across = np.eye(3) - np.outer(n, n)
    by_x = -k_s * (np.outer(n, n) + (1 - rest / length) * across) - k_d / length * (
        (n @ u) * across + np.outer(n, across @ u)
    )
    sign = np.array([[1, -1], [-1, 1]])
    np.testing.assert_allclose(dx, np.kron(sign, by_x), atol=1e-12)
    np.testing.assert_allclose(dv, np.kron(sign, -k_d * np.outer(n, n)), atol=1e-12)


coordinates = st.floats(-3, 3, allow_nan=False).map(lambda v: round(v, 6))


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_nets_keep_momentum_and_angular_momentum(data):
    n = data.draw(st.integers(3, 8))
    numbers = st.lists(coordinates, min_size=3 * n, max_size=3 * n).map(lambda v: np.reshape(v, (n, 3)))
    x, v = data.draw(numbers), data.draw(numbers)
    joints = data.draw(st.lists(st.permutations(range(n)).map(lambda p: tuple(p[:3])), max_size=6))
    pairs = data.draw(st.lists(st.permutations(range(n)).map(lambda p: tuple(p[:2])), max_size=8))
    e1, e2 = (np.array([x[j[k + 1]] - x[j[k]] for j in joints]).reshape(-1, 3) for k in (0, 1))
    if joints and min(np.linalg.norm(e1, axis=1).min(), np.linalg.norm(e2, axis=1).min()) < 1e-2:
        return  # a joint with an arm of almost no length has forces without bound
    p = Particles(x, v, np.linspace(0.5, 2, n))
    f = np.zeros((n, 3))
    for force in (Springs(pairs, 10.0, 0.5, 1.0), Angles(joints, 2.0, 0.3, 0.4)):
        force.bind(p)
        force.add_forces(p, 0.0, p.x, p.v, f)
    parts = np.abs(f).sum() + 1e-3
    scale = 1e-11 * max(parts, 10 * len(pairs) + 1e3 * len(joints))
    assert np.isfinite(f).all()
    assert np.abs(f.sum(axis=0)).max() < scale
    assert np.abs(np.cross(x, f).sum(axis=0)).max() < 10 * scale


def test_angles_are_softened_nowhere_and_bounded_where_straight():
    straight = Particles([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1.5, 0, 0]])
    for joint in ((0, 1, 2), (0, 2, 3), (0, 1, 1 + 2)):
        force = Angles([joint], k_s=5.0, rest=0.3)
        force.bind(straight)
        f = np.zeros((4, 3))
        force.add_forces(straight, 0.0, straight.x, straight.v, f)
        assert (f == 0).all()


# ------------------------------------------------------------------------------------------------ orbits and swings


def test_harmonic_period_and_energy():
    system = ParticleSystem(Particles([[1.0, 0, 0]], m=2.0), [Harmonic(k_s=8.0)])
    states, _ = run(system, math.pi)  # one period: 2 pi sqrt(2/8)
    np.testing.assert_allclose(states[-1, :, 0], [[1, 0, 0], [0, 0, 0]], atol=1e-8)
    assert system.energy().total == pytest.approx(4.0)


def test_kepler_orbit_closes():
    start = Particles([[0.5, 0, 0]], [[0, math.sqrt(3.0), 0]])  # e = 0.5, GM = a = 1, at the perihelion
    system = ParticleSystem(start, [Attractor(mu=1.0)])
    states, _ = run(system, 2 * math.pi)
    np.testing.assert_allclose(states[-1], states[0], atol=1e-7)
    assert system.energy().total == pytest.approx(-0.5)


def test_softened_pair_on_a_circle():
    m1, m2, a, eps = 1.0, 2.0, 1.0, 0.5
    turn = math.sqrt((m1 + m2) / (a**2 + eps**2) ** 1.5)
    x1, x2 = -a * m2 / (m1 + m2), a * m1 / (m1 + m2)
    pair = Particles([[x1, 0, 0], [x2, 0, 0]], [[0, turn * x1, 0], [0, turn * x2, 0]], [m1, m2])
    states, _ = run(ParticleSystem(pair, [Gravitation(eps=eps)]), 2 * math.pi / turn)
    np.testing.assert_allclose(states[-1], states[0], atol=1e-6)


def test_charge_in_a_magnetic_field_goes_in_circles():
    m, q, B, v = 2.0, 3.0, 0.5, 4.0
    system = ParticleSystem(Particles([[0, 0, 0]], [[v, 0, 0]], m, charge=q), [Magnetic((0, 0, B))])
    period = 2 * math.pi * m / (q * B)
    states, _ = run(system, period, t_eval=np.linspace(0, period, 5))
    centre = np.array([0, -m * v / (q * B), 0])
    np.testing.assert_allclose(np.linalg.norm(states[:, 0, 0] - centre, axis=1), m * v / (q * B), rtol=1e-8)
    np.testing.assert_allclose(states[-1, 0, 0], 0, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(states[:, 1, 0], axis=1), v, rtol=1e-9)


def test_a_potential_keeps_its_energy():
    well = Field(potential="0.5*(x**2 + y**2) + 0.1*x**2*y - y**3/30 + exp(-z**2)")
    system = ParticleSystem(Particles([[0.3, 0.1, 0.2]], [[0.1, 0.4, 0.3]]), [well])
    before = system.energy().total
    y = run(system, 20.0)[1].y[:, -1]
    system.set_state(y, 20.0)
    assert system.energy().total == pytest.approx(before, rel=1e-8)


# ------------------------------------------------------------------------------------------------ flows


@pytest.mark.parametrize("flow", [Flow(("-y", "x", "0")), Flow(("-W*y", "W*x", 0), constants={"W": 1.0})])
def test_solid_rotation_by_euler(flow):
    h, steps = 0.01, 629
    system = ParticleSystem(Particles([[1.0, 0, 0]]), [flow])
    y = explicit(system, [[]], [1.0], h, steps)
    assert np.linalg.norm(y) == pytest.approx((1 + h * h) ** (steps / 2), rel=1e-12)


def test_around_a_vortex_and_back():
    r, circulation = 0.7, 2.0
    system = ParticleSystem(Particles([[r, 0, 0.3]]), [Vortex(circulation, eps=0.0)])
    period = 4 * math.pi**2 * r**2 / circulation
    y = rk4(system, period / 60, 60)
    np.testing.assert_allclose(y, [r, 0, 0.3], atol=1e-4 * r)


def test_equal_vortices_turn_and_opposite_ones_travel():
    circulation, d = 1.5, 0.8
    place = [[-d / 2, 0, 0], [d / 2, 0, 0]]
    equal = ParticleSystem(Particles(place, circulation=circulation), [PointVortices()])
    t = 0.5
    angle = circulation / (math.pi * d**2) * t
    y = rk4(equal, t / 50, 50).reshape(2, 3)
    np.testing.assert_allclose(y[1], np.array([math.cos(angle), math.sin(angle), 0]) * d / 2, atol=1e-4 * d)
    np.testing.assert_allclose(y[0], -y[1], atol=1e-12)
    opposite = ParticleSystem(Particles(place, circulation=[circulation, -circulation]), [PointVortices()])
    y = rk4(opposite, t / 50, 50).reshape(2, 3)
    np.testing.assert_allclose(y - place, [[0, circulation / (2 * math.pi * d) * t, 0]] * 2, rtol=1e-4, atol=1e-12)


def test_a_moving_vortex_is_where_it_is():
    moving = Vortex(2.0, center=("3*t", 0, 0), eps=0.1)
    still = Vortex(2.0, eps=0.1)
    x = np.array([[0.4, 0.2, 0.0]])
    here = ParticleSystem(Particles(x), [still]).deriv_eval(0.0)
    there = ParticleSystem(Particles(x + np.array([[6, 0, 0]])), [moving]).deriv_eval(2.0)
    np.testing.assert_allclose(there, here, rtol=1e-13)


def test_a_flow_in_which_time_matters():
    system = ParticleSystem(Particles([[0.0, 0, 0]]), [Flow(("cos(t)", "t", "x"))])
    final = run(system, 2.0)[0][-1, 0, 0]
    np.testing.assert_allclose(final, [math.sin(2), 2, 1 - math.cos(2)], atol=1e-9)
