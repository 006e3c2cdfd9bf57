"""Initial value problems, roots and events, against SciPy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from solver_problems import driven, fixed, oscillators, pendulum

from pointmass.errors import InvalidInput
from pointmass.solvers import RK4, SOLVERS, DormandPrince, Event, FunctionSystem, first_root, integrate


def test_agrees_with_scipy():
    """Both at rtol = 1e-9: errors of some 1e-8 after t = 10."""
    system = driven([0.4])
    ours = integrate(system, DormandPrince(1e-9, 1e-12), (0.0, 10.0), 0.5, [1.0, 0.0])
    theirs = solve_ivp(system.deriv_eval, (0.0, 10.0), [1.0, 0.0], rtol=1e-9, atol=1e-12, t_eval=ours.t)
    np.testing.assert_allclose(ours.y, theirs.y.T, atol=1e-7)


def test_the_grid_is_absolute_and_ends_on_the_end():
    solution = integrate(pendulum(), fixed("rk4"), (1.0, 2.05), 0.1, [1.0, 0.0])
    np.testing.assert_array_equal(solution.t[:-1], 1.0 + 0.1 * np.arange(11))
    assert solution.t[-1] == 2.05
    assert len(integrate(pendulum(), fixed("rk4"), (0.0, 0.3), 0.1, [1.0, 0.0]).t) == 4


@pytest.mark.parametrize("name", SOLVERS)
def test_dense_solution_passes_through_the_grid(name):
    solution = integrate(pendulum(), SOLVERS[name](), (0.0, 2.0), 0.1, [1.0, 0.0], dense=True)
    np.testing.assert_array_equal(solution.at(solution.t), solution.y)
    middle = solution.at(0.5 * (solution.t[1:] + solution.t[:-1]))
    np.testing.assert_allclose(middle, 0.5 * (solution.y[1:] + solution.y[:-1]), atol=0.1**2)  # h^2 max|y''|/8 twice


def test_dense_solution_of_islands_with_steps_of_their_own():
    """cos w t for w = 1 and 20, which the control steps differently."""
    system = oscillators([1.0, 20.0], [0.0, 0.0])
    solution = integrate(system, DormandPrince(1e-9, 1e-9), (0.0, 1.0), 0.5, [1.0, 1.0, 0.0, 0.0], dense=True)
    t = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(solution.at(t)[:, :2], np.cos(np.outer(t, [1.0, 20.0])), atol=1e-6)


def test_events():
    """Zeros of cos t; each direction sees every other one."""
    system = oscillators([1.0], [0.0])
    events = [Event(lambda t, y: y[0], direction=d) for d in (0, 1, -1)]
    solution = integrate(system, DormandPrince(1e-10, 1e-10), (0.0, 10.0), 1.0, [1.0, 0.0], events=events)
    zeros = np.pi * (np.arange(3) + 0.5)
    for times, exact in zip(solution.t_events, (zeros, zeros[1::2], zeros[::2]), strict=True):
        np.testing.assert_allclose(times, exact, atol=1e-8)
    np.testing.assert_allclose(solution.y_events[0][:, 0], 0.0, atol=1e-14)


def test_a_terminal_event_ends_the_run():
    system = FunctionSystem(lambda t, y: [y[1], -9.81], 2, 2, velocity_dependent=False)
    floor, apex = Event(lambda t, y: y[0], terminal=True, direction=-1), Event(lambda t, y: y[1])
    solution = integrate(system, fixed("leapfrog"), (0.0, 5.0), 0.1, [0.0, 4.0], events=[apex, floor], dense=True)
    landing = 8.0 / 9.81
    assert solution.t[-1] == pytest.approx(landing, rel=1e-12)
    np.testing.assert_allclose(solution.y[-1], [0.0, -4.0], atol=1e-12)
    np.testing.assert_allclose(solution.t_events[0], [landing / 2.0], rtol=1e-12)
    assert len(solution.at(np.linspace(0.0, solution.t[-1], 7))) == 7


def test_an_event_in_the_first_state_does_not_end_the_run_again():
    solution = integrate(
        pendulum(), fixed("rk4"), (0.0, 1.0), 0.1, [1.0, 0.0], events=[Event(lambda t, y: t - 0.5, terminal=True)]
    )
    assert solution.t[-1] == pytest.approx(0.5, rel=1e-14)


def test_wrong_arguments_are_refused():
    for change in ({"t_span": (1.0, 0.0)}, {"dt": 0.0}, {"y0": [1.0]}, {"y0": None}):
        arguments = {"t_span": (0.0, 1.0), "dt": 0.1, "y0": [1.0, 0.0], **change}
        with pytest.raises(InvalidInput):
            integrate(pendulum(), fixed("rk4"), **arguments)
    solution = integrate(pendulum(), fixed("rk4"), (0.0, 1.0), 0.1, [1.0, 0.0])
    with pytest.raises(InvalidInput, match="dense=True"):
        solution.at(0.5)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-0.99, 0.99), min_size=1, max_size=8), st.sampled_from([1.0, 3.0, 9.0]))
def test_roots_of_many_lanes_at_once(roots, power):
    """Flat and steep crossings in [-1, 2], both sides a few roundings apart and of different sign."""
    root = np.array(roots)

    def g(x):
        return np.sign(x - root) * np.abs(x - root) ** power

    low, high, g_low, g_high = first_root(g, np.full(len(root), -1.0), np.full(len(root), 2.0))
    assert (low <= root + 1e-30).all()  # the ninth power underflows next to the root
    assert (root - 1e-30 <= high).all()
    assert (high - low <= 8.0 * np.finfo(float).eps).all()
    assert (g_low < 0.0).all()
    assert (g_high >= 0.0).all()


def test_roots_cost_little():
    """Smooth functions converge superlinearly: an equation of Kepler in a quarter of what bisection needs."""
    passes = []

    def g(x):
        passes.append(1)
        return x - 0.3 * np.sin(x) - 0.7

    first_root(g, np.zeros(3), np.ones(3))
    assert len(passes) <= 2 + 15


def test_the_first_of_several_roots():
    low, high, *_ = first_root(np.cos, np.zeros(1), np.full(1, 8.0), pieces=16)
    assert low[0] <= np.pi / 2.0 <= high[0]


def test_lanes_without_a_root_are_nan():
    low, *_ = first_root(lambda x: x - np.array([0.5, 5.0]), np.zeros(2), np.ones(2))
    assert low[0] == pytest.approx(0.5)
    assert np.isnan(low[1])


def test_lanes_do_not_influence_each_other():
    shift = np.array([0.1, 0.77, 0.5])
    together = first_root(lambda x: np.tanh(x - shift) ** 3, np.zeros(3), np.ones(3))
    for i in range(3):
        alone = first_root(lambda x, i=i: np.tanh(x - shift[i]) ** 3, np.zeros(1), np.ones(1))
        assert [side[i] for side in together] == [side[0] for side in alone]


@pytest.mark.parametrize(
    "arguments",
    [
        {"order": 3},
        {"dim": 3, "order": 2},
        {"islands": [0]},
        {"islands": [0, 1], "order": 2},
        {"islands": [0.5, 0.5]},
        {"inertia": [1.0, 1.0]},
    ],
)
def test_function_systems_check_their_arguments(arguments):
    with pytest.raises(InvalidInput):
        FunctionSystem(lambda t, y: y, **{"dim": 2, **arguments})


def test_function_systems_differentiate_by_central_differences():
    """Error eps^(2/3) times third derivatives of order 1."""
    system = pendulum(0.3)
    numeric = FunctionSystem(system.deriv_eval, 2, 2)
    y = np.array([0.7, -0.2])
    np.testing.assert_allclose(numeric.jacobian(0.0, y).toarray(), system.jacobian(0.0, y).toarray(), atol=1e-9)


def test_a_solver_may_be_named_and_must_be_made() -> None:
    decay = FunctionSystem(lambda t, y: -y, 1)
    by_name = integrate(decay, "rk4", (0.0, 1.0), 0.1, [1.0])
    np.testing.assert_array_equal(by_name.y, integrate(decay, RK4(), (0.0, 1.0), 0.1, [1.0]).y)
    with pytest.raises(InvalidInput, match=r"RK4\(\), with brackets"):
        integrate(decay, RK4, (0.0, 1.0), 0.1, [1.0])  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="unknown solver 'rk5'"):
        integrate(decay, "rk5", (0.0, 1.0), 0.1, [1.0])
    with pytest.raises(InvalidInput, match="not 7"):
        integrate(decay, 7, (0.0, 1.0), 0.1, [1.0])  # type: ignore[arg-type]
