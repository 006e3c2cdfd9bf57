"""Every solver of the registry converges at the order it claims."""

from __future__ import annotations

import numpy as np
import pytest
from solver_problems import DRAGGED_AT_2, FORCED_AT_2, PENDULUM_AT_2, fixed, forced, pendulum

from pointmass.solvers import SOLVERS, DormandPrince, FunctionSystem, Leapfrog, integrate

# Orders from the two finest grids: the h^(p+1) term that bends the slope of the coarser ones is below 0.1 there.
# A method of order 5 reaches round-off earlier, one of order 1 leaves the leading term later.
GRIDS = {1: (0.025, 0.0125), 2: (0.05, 0.025), 3: (0.05, 0.025), 4: (0.05, 0.025), 5: (0.1, 0.05)}
PROBLEMS = {
    "pendulum": (pendulum(), [1.0, 0.0], PENDULUM_AT_2),
    "drag": (pendulum(0.7), [1.0, 0.3], DRAGGED_AT_2),
    "forced": (forced(), [1.0, 0.0], FORCED_AT_2),
}


def slope(system, solver, start, exact, grid):
    coarse, fine = (np.linalg.norm(integrate(system, solver, (0.0, 2.0), h, start).y[-1] - exact) for h in grid)
    return np.log2(coarse / fine)


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("name", SOLVERS)
def test_order(name, problem):
    assert slope(*_with(name, problem), GRIDS[SOLVERS[name].order]) == pytest.approx(SOLVERS[name].order, abs=0.15)


def _with(name, problem):
    system, start, exact = PROBLEMS[problem]
    return system, fixed(name), start, exact


def test_a_single_pass_of_the_closing_kick_loses_an_order():
    system, start, exact = PROBLEMS["drag"]
    assert slope(system, Leapfrog(passes=1), start, exact, (0.025, 0.0125)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("name", ["midpoint", "rk4", "yoshida4", "bs32", "dopri5", "implicit_midpoint"])
def test_stages_see_their_own_time(name):
    """A clock that stands still for the length of a step gives order 1 only."""

    def frozen(h):
        start = forced()
        return FunctionSystem(lambda t, y: start.deriv_eval(np.floor(t / h + 1e-9) * h, y), 2, 2, None, False)

    errors = [
        np.linalg.norm(integrate(frozen(h), fixed(name), (0.0, 2.0), h, [1.0, 0.0]).y[-1] - FORCED_AT_2)
        for h in (0.05, 0.025)
    ]
    assert np.log2(errors[0] / errors[1]) < 1.3


def test_first_order_systems():
    system = FunctionSystem(lambda t, y: [-y[0] + t], 1)  # y = t - 1 + 2 e^-t from 1
    exact = np.array([1.0 + 2.0 * np.exp(-2.0)])
    for name, solver in SOLVERS.items():
        if name in ("symplectic_euler", "leapfrog", "yoshida4", "xpbd"):
            continue
        measured = slope(system, fixed(name), [1.0], exact, (0.05, 0.025))
        assert measured == pytest.approx(solver.order, abs=0.15), name


@pytest.mark.parametrize("name", SOLVERS)
def test_dense_output_is_of_the_order_of_the_method_or_cubic(name):
    """The error inside one step falls at least as h^2 for order 1 and 2, as h^4 for order 3 and 4, as h^5 above."""
    system, errors = pendulum(), []
    solver, fine = fixed(name), 0.1 if SOLVERS[name].order > 2 else 0.025
    reference = DormandPrince(rtol=1e-13, atol=1e-13)
    for h in (2.0 * fine, fine):
        step = solver.step(system, 0.0, np.array([1.0, 0.3]), h, solver.start(system))
        exact = integrate(system, reference, (0.0, h / 2.0), h, [1.0, 0.3]).y[-1]
        errors.append(np.linalg.norm(step.dense(0.5) - exact))
        assert (step.dense(0.0) == step.y0).all()
        assert (step.dense(1.0) == step.y1).all()
    assert np.log2(errors[0] / errors[1]) > {1: 2, 2: 2, 3: 4, 4: 4, 5: 5}[solver.order] - 0.3


def test_dormand_prince_dense_output_has_order_four():
    system, errors = pendulum(), []
    solver = DormandPrince(adaptive=False)
    for h in (0.4, 0.2, 0.1, 0.05):
        step = solver.step(system, 0.0, np.array([1.0, 0.3]), h, {})
        exact = integrate(system, DormandPrince(rtol=1e-13, atol=1e-13), (0.0, h / 2.0), h, [1.0, 0.3]).y[-1]
        errors.append(np.linalg.norm(step.dense(0.5) - exact))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (slopes > 4.7).all()
    assert (slopes < 5.5).all()
