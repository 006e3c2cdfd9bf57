"""Newton's method, conjugate gradients, and what implicit steps promise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse
from solver_problems import pendulum, run

from pointmass.errors import Diverged, InvalidInput
from pointmass.solvers import BDF2, FunctionSystem, ImplicitEuler, ImplicitMidpoint

ALL = [ImplicitEuler, ImplicitMidpoint, BDF2]


def chain(k=100.0, c=1.0, m=0.1, masses=4, islands=1, gravity=9.81):
    """Islands of masses on a string of damped springs in the plane, the first one pinned; exact Jacobian."""
    n, length = masses * islands, 0.1
    a = np.array([i + j * masses for j in range(islands) for i in range(masses - 1)])
    free = np.repeat(np.arange(n) % masses != 0, 2).astype(float)
    ends = np.zeros((n, len(a)))
    ends[a, range(len(a))], ends[a + 1, range(len(a))] = 1.0, -1.0  # what a spring's pull does to its ends

    def geometry(y):
        x, v = y.reshape(2, n, 2)
        d, w = x[a + 1] - x[a], v[a + 1] - v[a]
        r = np.linalg.norm(d, axis=1)
        return d / r[:, None], r, w

    def slope(t, y):
        u, r, w = geometry(y)
        f = (k * (r - length) + c * (w * u).sum(1))[:, None] * u
        acceleration = ends @ f / m + [0.0, -gravity]
        return np.concatenate([y[2 * n :] * free, acceleration.ravel() * free])

    def jacobian(t, y):
        u, r, w = geometry(y)
        along = u[:, :, None] * u[:, None, :]
        across = np.eye(2) - along
        turn = np.einsum("si,sj,sjk->sik", u, w, across) + (w * u).sum(1)[:, None, None] * across
        by_x = k * along + (k * (1.0 - length / r))[:, None, None] * across + c * turn / r[:, None, None]
        blocks = (np.einsum("ps,sij,qs->piqj", ends, b, -ends).reshape(2 * n, 2 * n) for b in (by_x, c * along))
        pull, damp = (block / m * free[:, None] for block in blocks)
        return np.block([[np.zeros((2 * n, 2 * n)), np.diag(free)], [pull, damp]])

    inertia = np.where(free > 0.0, m, np.inf)
    owner = np.tile(np.repeat(np.arange(islands), 2 * masses), 2)
    system = FunctionSystem(slope, 4 * n, 2, jacobian, islands=owner, inertia=inertia)
    x = np.stack([length * (np.arange(n) % masses), 0.02 * np.sin(np.arange(n))], axis=1)
    return system, np.concatenate([x.ravel(), np.zeros(2 * n)])


def test_the_chain_has_the_jacobian_it_says():
    system, y = chain()
    y = y + 0.1 * np.cos(np.arange(len(y)))
    numeric = FunctionSystem(system.deriv_eval, system.dim, 2).jacobian(0.0, y)
    np.testing.assert_allclose(system.jacobian(0.0, y).toarray(), numeric.toarray(), atol=1e-4)  # entries of 1e3


def test_I15_conjugate_gradients_solve_the_linear_system_of_backward_euler():
    """One linearised step at rest, where the Jacobian is symmetric, against a dense solution."""
    system, y = chain()
    h, n = 0.01, system.dim // 2
    ours = ImplicitEuler("cg", "one", cg_tolerance=1e-12).step(system, 0.0, y, h, {}).y1[n:] - y[n:]
    jacobian = system.jacobian(0.0, y).toarray()
    moves, pull, damp = jacobian[:n, n:], jacobian[n:, :n], jacobian[n:, n:]
    right = h * (system.deriv_eval(0.0, y)[n:] + h * pull @ y[n:])
    dense = np.linalg.solve(np.eye(n) - h * damp - h * h * pull @ moves, right)
    np.testing.assert_allclose(ours, dense, rtol=0.0, atol=1e-8 * np.abs(dense).max())


def test_I15_one_newton_step_differs_by_the_third_power_of_h():
    system, y = chain()
    y = run(system, ImplicitEuler(), y, 0.002, 20)[-1]  # moving, so that no term vanishes
    h = 0.1 * np.sqrt(0.1 / 100.0) * 0.5 ** np.arange(4)
    gaps = [
        np.linalg.norm(
            ImplicitEuler().step(system, 0.0, y, each, {}).y1
            - ImplicitEuler(newton="one").step(system, 0.0, y, each, {}).y1
        )
        for each in h.tolist()
    ]
    assert (np.log2(np.array(gaps[:-1]) / gaps[1:]) >= 2.5).all()


@pytest.mark.parametrize("solver", ALL)
@pytest.mark.parametrize("islands", [1, 20])  # dense and sparse factors
def test_direct_and_conjugate_gradients_agree(solver, islands):
    """Both solve the same equations to 1e-10, however the damping is symmetrised on the way."""
    system, y = chain(islands=islands)
    direct, gradients = (run(system, solver(linear), y, 0.01, 10)[-1] for linear in ("direct", "cg"))
    np.testing.assert_allclose(direct, gradients, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("linear", ["direct", "cg"])
@pytest.mark.parametrize("solver", ALL)
def test_islands_do_not_influence_each_other(solver, linear):
    """To the tolerance: in the plane, blocks of three unknowns are others where an island begins elsewhere."""
    system, y = chain(islands=3)
    exact = solver(linear, cg_tolerance=1e-10)
    together = run(system, exact, y, 0.01, 5)[-1]
    alone_system, _ = chain()
    for i in range(3):
        own = np.flatnonzero(system.islands == i)
        alone = run(alone_system, exact, y[own], 0.01, 5)[-1]
        np.testing.assert_allclose(together[own], alone, rtol=0.0, atol=1e-12)


def test_conjugate_gradients_end_for_each_island_on_its_own():
    """A wild neighbour changes neither the number of iterations of a calm island nor its bits."""
    system, y = chain(islands=2)
    y[8:16] *= 30.0
    solver = ImplicitEuler("cg", "one", cg_tolerance=1e-3)
    together = solver.step(system, 0.0, y, 0.01, {}).y1
    own = system.islands == 0
    alone = solver.step(chain()[0], 0.0, y[own], 0.01, {}).y1
    assert together[own].tobytes() == alone.tobytes()


@pytest.mark.parametrize("linear", ["direct", "cg"])
@pytest.mark.parametrize("solver", ALL)
def test_pinned_entries_keep_their_bits(solver, linear):
    system, y = chain(c=50.0)
    y[:2] = -0.0, 0.1 + 0.2
    states = run(system, solver(linear), y, 1.0 / 60.0, 10)
    pinned = states[:, [0, 1, 8, 9]]
    assert pinned.tobytes() == np.tile(y[[0, 1, 8, 9]], (11, 1)).tobytes()


@pytest.mark.parametrize("solver", ALL)
def test_equilibrium_stays(solver):
    """Hanging at rest: forces balance to round-off only, and Newton's method must be content with that."""
    system, _ = chain(k=1e6, c=0.0, masses=2)
    rest = np.array([0.0, 0.0, 0.0, -0.1 - 0.1 * 9.81 / 1e6, 0.0, 0.0, 0.0, 0.0])
    states = run(system, solver(), rest, 1.0 / 60.0, 50)
    np.testing.assert_allclose(states[-1], rest, atol=1e-9)


@pytest.mark.parametrize("linear", ["direct", "cg"])
@pytest.mark.parametrize("solver", [ImplicitEuler, BDF2])
def test_stiff_chain_falls_and_stays_whole(solver, linear):
    """k h^2/m = 2800, against 4 for the limit of explicit methods."""
    system, y = chain(k=1e5, c=1.0, m=0.01, masses=10)
    y[1:20:2] *= 0.01  # nearly straight
    states = run(system, solver(linear), y, 1.0 / 60.0, 30)
    x = states[-1, :20].reshape(10, 2)
    np.testing.assert_allclose(np.linalg.norm(np.diff(x, axis=0), axis=1), 0.1, rtol=1e-2)
    assert x[-1, 1] < -0.5


@pytest.mark.parametrize(("linear", "most"), [("direct", 5), ("cg", 9)])
@pytest.mark.parametrize("solver", ALL)
def test_a_step_whose_equations_are_not_solved_is_divided(solver, linear, most):
    """One of two islands swings fast: it makes halves, with the memory of each, and its neighbour a whole step."""
    system, y = chain(k=1e4, islands=2)
    y[24:] = 30.0 * np.sin(np.arange(8)) * np.tile([0.0, 1.0], 4)
    hasty = solver(linear, max_iterations=most)
    memory, h = hasty.start(system), 1.0 / 60.0
    step = hasty.step(system, 0.0, y, h, memory)
    own = system.islands == 0
    assert step.rejected > 0
    assert np.array_equal(step.y1[own], solver(linear).step(system, 0.0, y, h, memory).y1[own])
    length, at, now = np.where(own, 0.0, 0.5 * h), np.zeros(len(y)), y
    for _ in range(2):
        half = hasty.step(system, at, now, length, memory)
        at, now, memory = at + length, half.y1, half.memory
    assert np.array_equal(step.y1[~own], now[~own])
    for name, values in step.memory.items():
        assert np.array_equal(values[~own], memory[name][~own])
    assert step.iterations > half.iterations


def test_a_step_that_is_divided_to_no_avail_is_an_error():
    system, y = chain(k=1e4)
    y[8:] = 1e6
    with pytest.raises(Diverged, match="not solved after 1 Newton iterations"):
        ImplicitEuler(max_iterations=1).step(system, 0.0, y, 1.0, {})


def test_bdf2_restarts_entry_by_entry():
    """Without history an entry takes a step of backward Euler, whatever its neighbours do."""
    system, y = chain(islands=2)
    solver = BDF2()
    first = solver.step(system, 0.0, y, 0.01, solver.start(system))
    own = system.islands == 0
    memory = dict(first.memory)
    memory["h_before"] = np.where(own, np.inf, memory["h_before"])
    second = solver.step(system, 0.01, first.y1, 0.01, memory).y1
    euler = ImplicitEuler().step(system, 0.01, first.y1, 0.01, {}).y1
    bdf = solver.step(system, 0.01, first.y1, 0.01, first.memory).y1
    np.testing.assert_allclose(second[own], euler[own], atol=1e-12)
    np.testing.assert_allclose(second[~own], bdf[~own], atol=1e-12)
    assert np.abs(euler - bdf).max() > 1e-4


def test_bdf2_keeps_order_two_with_uneven_steps():
    system, errors = pendulum(), []
    exact = np.array([-0.30620095759, -0.90904710500])
    for n in (40, 80):
        t = 2.0 * (np.arange(n + 1) / n + 0.3 * np.sin(2.0 * np.pi * np.arange(n + 1) / n) / (2.0 * np.pi))
        solver, y = BDF2(), np.array([1.0, 0.0])
        memory = solver.start(system)
        for start, end in pairwise(t):
            step = solver.step(system, start, y, end - start, memory)
            y, memory = step.y1, step.memory
        errors.append(np.linalg.norm(y - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("solver", ALL)
def test_equations_without_a_solution_diverge(solver):
    system = FunctionSystem(lambda t, y: y * y + 1.0, 1)  # y = 1 + h (y^2 + 1) has no real root for h = 10
    with pytest.raises(Diverged, match="Newton iterations at t = "):
        solver().step(system, 0.0, np.array([1.0]), 10.0, {})


def test_singular_equations_diverge():
    system = FunctionSystem(lambda t, y: y, 1, jacobian=lambda t, y: sparse.csr_array([[1.0]]))
    with pytest.raises(Diverged, match="singular"):
        ImplicitEuler().step(system, 0.0, np.array([1.0]), 1.0, {})


@pytest.mark.parametrize(
    "arguments", [{"linear_solver": "lu"}, {"newton": "two"}, {"tolerance": 0.0}, {"max_iterations": 0}]
)
def test_arguments_are_checked(arguments):
    with pytest.raises(InvalidInput, match=next(iter(arguments))):
        ImplicitEuler(**arguments)
