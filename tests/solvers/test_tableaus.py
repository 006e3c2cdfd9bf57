"""Tables check themselves, and agree with SciPy's where SciPy has them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy import integrate as scipy_integrate
from solver_problems import kepler, pendulum

from pointmass.errors import InvalidInput
from pointmass.solvers import SOLVERS, BogackiShampine, DormandPrince, ExplicitRungeKutta, Splitting, Substep
from pointmass.solvers.explicit import row

TABLES = {name: s for name, s in SOLVERS.items() if issubclass(s, ExplicitRungeKutta)}


@pytest.mark.parametrize("name", TABLES)
def test_rows_add_up_exactly(name):
    table = TABLES[name]
    assert tuple(sum(entries, Fraction(0)) for entries in table.A) == table.c
    assert sum(table.b) == 1
    assert sum(getattr(table, "b_hat", table.b)) == 1


@pytest.mark.parametrize("change", [{"A": (row(""), row("2/3"))}, {"b": row("1/2 1/3")}, {"c": row("0")}])
def test_a_wrong_tableau_is_refused(change):
    good = {"name": "wrong", "order": 2, "A": (row(""), row("1")), "b": row("1/2 1/2"), "c": row("0 1")}
    type("Right", (ExplicitRungeKutta,), good)
    with pytest.raises(InvalidInput, match="wrong"):
        type("Wrong", (ExplicitRungeKutta,), {**good, **change})


def test_a_wrong_splitting_is_refused():
    with pytest.raises(InvalidInput, match="add up"):
        type("Wrong", (Splitting,), {"name": "wrong", "order": 1, "substeps": (Substep(0.5, 1.0, 0.0),)})


@pytest.mark.parametrize(
    ("ours", "theirs"), [(BogackiShampine(), scipy_integrate.RK23), (DormandPrince(), scipy_integrate.RK45)]
)
def test_one_step_its_error_and_its_dense_output_are_those_of_scipy(ours, theirs):
    system, y0, h = pendulum(0.2), np.array([1.0, 0.3]), 0.3
    scipy_solver = theirs(system.deriv_eval, 0.0, y0, 10.0, first_step=h, rtol=1e-2, atol=1e-2)
    scipy_solver.step()
    dense = scipy_solver.dense_output()
    step = ours.step(system, 0.0, y0, h, ours.start(system))
    np.testing.assert_allclose(step.y1, scipy_solver.y, rtol=1e-14)
    np.testing.assert_allclose(step.error, -(scipy_solver.K.T @ scipy_solver.E) * h, atol=1e-15)
    for theta in np.linspace(0.0, 1.0, 11):
        np.testing.assert_allclose(step.dense(theta), dense(theta * h), rtol=1e-13)


def test_evaluations_are_what_they_say():
    for name, solver in TABLES.items():
        calls = []
        system = kepler()
        evaluate = system.deriv_eval
        system.deriv_eval = lambda t, y, calls=calls, evaluate=evaluate: calls.append(t) or evaluate(t, y)
        fixed = solver(adaptive=False) if hasattr(solver, "b_hat") else solver()
        fixed.step(system, 0.0, np.array([0.5, 0.0, 0.0, 3.0**0.5]), 0.01, {})
        assert len(calls) == solver.evaluations, name
