"""Islands with clocks of their own, step control, and what may happen between steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solver_problems import driven, fixed, kepler, oscillators, pendulum

from pointmass.errors import Diverged, InvalidInput
from pointmass.solvers import (
    ALIASES,
    SOLVERS,
    BogackiShampine,
    DormandPrince,
    FunctionSystem,
    Implicit,
    advance,
    find_solver,
)

EXPLICIT = [name for name, solver in SOLVERS.items() if not issubclass(solver, Implicit)]
ADAPTIVE = [DormandPrince(rtol=1e-7), BogackiShampine(rtol=1e-4, atol=1e-6)]
PHASES = [0.0, 1.0, 2.5]
STATES = np.array([[1.0, 0.3], [-2.0, 0.0], [0.1, 5.0]])


def together(y):
    """[x, v] of several islands from one row each."""
    return np.asarray(y).T.ravel()


def solo(i):
    return driven(PHASES[i : i + 1]), STATES[i].copy()


@pytest.mark.parametrize("name", SOLVERS)
def test_steps_of_different_length_are_the_steps_of_each_alone(name):
    """To the bit for explicit methods; 1e-12 where a shared factorisation rounds differently."""
    t, h, solver = np.array([0.0, 0.3, -1.0]), np.array([0.1, 0.01, 0.25]), fixed(name)
    system = driven(PHASES)
    step = solver.step(system, np.tile(t, 2), together(STATES), np.tile(h, 2), solver.start(system))
    for i in range(3):
        alone, y = solo(i)
        own = solver.step(alone, float(t[i]), y, float(h[i]), solver.start(alone))
        atol = 0.0 if name in EXPLICIT else 1e-12
        np.testing.assert_allclose(step.y1[i::3], own.y1, rtol=0.0, atol=atol)
        np.testing.assert_allclose(step.dense(0.3)[i::3], own.dense(0.3), rtol=0.0, atol=atol)


@pytest.mark.parametrize("name", SOLVERS)
def test_an_entry_whose_step_is_zero_keeps_its_bits(name):
    system, solver = oscillators([1.0, 2.0], [0.0, 0.1]), fixed(name)
    y, h = np.array([-0.0, 0.1 + 0.2, 1.0, -0.0]), np.tile([0.0, 0.1], 2)
    step = solver.step(system, np.zeros(4), y, h, solver.start(system))
    assert step.y1[::2].tobytes() == y[::2].tobytes()
    assert step.dense(0.5)[::2].tobytes() == y[::2].tobytes()
    assert (step.y1[1::2] != y[1::2]).any()


@pytest.mark.parametrize("solver", [*ADAPTIVE, *(fixed(name) for name in EXPLICIT)], ids=lambda s: s.name)
@settings(max_examples=10, deadline=None)
@given(clock=st.lists(st.floats(0.0, 0.5), min_size=3, max_size=3), end=st.floats(0.5, 1.5))
def test_advancing_islands_together_gives_the_bits_of_each_alone(solver, clock, end):
    system = driven(PHASES)
    y, memory, _ = advance(system, solver, 0.0, end, together(STATES), {}, clock=np.array(clock))
    y, _, _ = advance(system, solver, end, 2.0, y, memory)
    for i in range(3):
        alone, state = solo(i)
        state, memory, _ = advance(alone, solver, 0.0, end, state, {}, clock=np.array(clock[i : i + 1]))
        state, _, _ = advance(alone, solver, end, 2.0, state, memory)
        assert y[i::3].tobytes() == state.tobytes()


def test_the_tolerance_of_one_island_does_not_touch_another():
    """A wild neighbour costs steps, and changes nothing."""
    calm = advance(oscillators([1.0], [0.0]), DormandPrince(), 0.0, 3.0, np.array([1.0, 0.0]), {})[0]
    both, _, stats = advance(
        oscillators([1.0, 100.0], [0.0, 0.0]), DormandPrince(), 0.0, 3.0, np.array([1.0, 1.0, 0.0, 0.0]), {}
    )
    assert stats.steps > 200
    assert both[::2].tobytes() == calm.tobytes()


def test_a_common_clock_is_a_number():
    seen = []

    def slope(t, y):
        seen.append(t)
        return np.zeros(4)

    system = FunctionSystem(slope, 4, 2, islands=[0, 1, 0, 1])
    advance(system, fixed("rk4"), 0.0, 1.0, np.ones(4), {})
    assert all(isinstance(t, float) for t in seen)
    advance(system, fixed("rk4"), 0.0, 1.0, np.ones(4), {}, clock=np.array([0.0, 0.5]))
    assert np.shape(seen[-1]) == (4,)


def test_kepler_error_follows_the_tolerance():
    """One orbit of eccentricity 0.5: 5 to 20 times less for each decade, 2e-7 at 1e-9 within a factor of 3."""
    start = np.array([0.5, 0.0, 0.0, 3.0**0.5])
    errors = []
    for decade in range(5, 11):
        solver = DormandPrince(rtol=10.0**-decade, atol=10.0**-decade)
        errors.append(np.linalg.norm(advance(kepler(), solver, 0.0, 2.0 * np.pi, start, {})[0] - start))
    ratios = np.array(errors[:-1]) / errors[1:]
    assert (ratios > 5.0).all()
    assert (ratios < 20.0).all()
    assert 0.7e-7 < errors[4] < 6e-7


def test_a_trial_that_is_not_a_number_is_rejected():
    """y' = -1/(2 y) until y = 0.1: a step that jumps past the root of y^2 = 1 - t sees the log of a negative."""
    system = FunctionSystem(lambda t, y: -0.5 / np.exp(np.log(y)), 1)
    memory = {"h_next": np.array([3.0])}
    y, _, stats = advance(system, DormandPrince(), 0.0, 0.99, np.array([1.0]), memory)
    assert stats.rejected > 0
    assert y[0] == pytest.approx(0.1, rel=1e-3)


def test_a_singularity_stops_the_control():
    system = FunctionSystem(lambda t, y: y * y, 1)  # infinite at t = 1
    with pytest.raises(Diverged, match="no step at t = 1 s") as caught:
        advance(system, DormandPrince(), 0.0, 2.0, np.array([1.0]), {})
    assert caught.value.time == pytest.approx(1.0, abs=1e-3)


def test_a_run_that_overflows_diverges():
    """A step multiplies v by (w h)^4 / 24, here 1e158, and the next cannot hold it."""
    system = oscillators([1e40], [0.0])
    y, _, _ = advance(system, fixed("rk4"), 0.0, 1.0, np.array([1e-100, 0.0]), {})
    y, _, _ = advance(system, fixed("rk4"), 1.0, 2.0, y, {})
    with pytest.raises(Diverged, match="no longer finite after a step of rk4 from t = 2 s") as caught:
        advance(system, fixed("rk4"), 2.0, 3.0, y, {})
    assert caught.value.time == 2.0


def test_prepare_sees_the_clock_and_the_step_of_each_island():
    seen = []

    def prepare(clock, h, y):
        seen.append((clock.copy(), h.copy()))
        return y + np.array([0.0, 0.0, 1.0, 0.0])

    system = oscillators([0.0, 0.0], [0.0, 0.0])
    y, _, _ = advance(system, fixed("rk4"), 0.0, 1.0, np.zeros(4), {}, clock=np.array([0.0, 0.5]), prepare=prepare)
    np.testing.assert_array_equal(seen, [([0.0, 0.5], [1.0, 0.5])])
    np.testing.assert_allclose(y, [1.0, 0.0, 1.0, 0.0], rtol=1e-14)


def test_the_step_before_the_end_is_not_forgotten():
    """Cutting a run into frames costs a step at most for each frame, not a new start."""
    start = np.array([1.0, 0.0])
    whole = advance(pendulum(), DormandPrince(), 0.0, 10.0, start, {})[2].steps
    y, memory, steps = start, {}, 0
    for k in range(20):
        y, memory, stats = advance(pendulum(), DormandPrince(), 0.5 * k, 0.5 * (k + 1), y, memory)
        steps += stats.steps
    assert steps <= whole + 20


def test_a_step_cut_short_by_the_end_does_not_shorten_the_next():
    _, memory, _ = advance(pendulum(), DormandPrince(), 0.0, 1.0, np.array([1.0, 0.0]), {})
    _, later, _ = advance(pendulum(), DormandPrince(), 1.0, 1.0 + 1e-9, np.array([1.0, 0.0]), memory)
    assert later["h_next"][0] >= memory["h_next"][0] > 0.01


def test_after_a_rejection_the_step_does_not_grow():
    solver, system = DormandPrince(), pendulum()
    start = solver.start(system)
    step = solver.step(system, 0.0, np.array([1.0, 0.0]), 1e-3, start)
    h = np.array([1e-3])
    _, free = solver.control.judge(step, h, h, system.islands, start)
    _, held = solver.control.judge(step, h, h, system.islands, {**start, "rejected": np.array([True])})
    assert free["h_next"][0] == pytest.approx(10.0 * h[0], rel=1e-12)
    assert held["h_next"][0] == h[0]
    assert not held["rejected"][0]


def test_the_last_piece_lands_on_the_end_to_the_bit():
    """t0 + (t1 - t0) misses t1 by a rounding for many t; no second step is made for it."""
    ends = [(k / 7.0, (k + 1.0) / 3.0) for k in range(200)]
    assert any(start + (end - start) < end for start, end in ends)
    for start, end in ends:
        assert advance(pendulum(), fixed("euler"), start, end, np.array([1.0, 0.0]), {})[2].steps == 1


def bouncing(e=0.8):
    """Two balls with gravity; what `correct` does when one passes the floor inside a step."""
    system = FunctionSystem(lambda t, y: [y[2], y[3], -9.81, -9.81], 4, 2, None, False, [0, 1, 0, 1])
    hits = [[], []]

    def correct(step, h):
        y, clock, reset = step.y1.copy(), np.full(2, np.nan), np.zeros(2, bool)
        for i in np.flatnonzero((h > 0.0) & (y[:2] < 0.0)):
            x, v = step.y0[i], step.y0[i + 2]
            fall = (v + np.sqrt(v * v + 2.0 * 9.81 * x)) / 9.81
            theta = min(fall / h[i], 1.0)
            clock[i] = np.broadcast_to(step.t, 4)[i] + theta * h[i]
            y[i], y[i + 2] = 0.0, -e * step.dense(theta)[i + 2]
            hits[i].append(clock[i])
            reset[i] = True
        return y, clock, reset

    return system, correct, hits


@pytest.mark.parametrize("name", ["leapfrog", "rk4", "dopri5", "bdf2"])
def test_correct_sets_islands_back_and_lands_on_the_end(name):
    """Balls from 1 m and 0.5 m: impacts at sqrt(2 h/g), then 2 e v/g later. BDF2 is exact to its order only."""
    system, correct, hits = bouncing()
    solver = SOLVERS[name]()
    y, memory = np.array([1.0, 0.5, 0.0, 0.0]), {}
    for k in range(30):
        y, memory, _ = advance(system, solver, k / 30.0, (k + 1) / 30.0, y, memory, correct=correct)
    rtol = 1e-9 if name != "bdf2" else 0.05
    for height, times in zip((1.0, 0.5), hits, strict=True):
        fall = np.sqrt(2.0 * height / 9.81)
        np.testing.assert_allclose(times[:1], [fall], rtol=rtol)
        if len(times) > 1:
            np.testing.assert_allclose(times[1], fall * 2.6, rtol=rtol)
    if name != "bdf2":
        assert len(hits[1]) == 2


def test_reset_starts_the_memory_of_one_island_anew():
    system, solver = oscillators([1.0, 2.0], [0.0, 0.0]), fixed("bdf2")

    def correct(step, h):
        return step.y1, np.full(2, np.nan), np.array([True, False])

    _, memory, _ = advance(system, solver, 0.0, 0.1, np.array([1.0, 1.0, 0.0, 0.0]), {}, correct=correct)
    np.testing.assert_array_equal(memory["h_before"], [np.inf, 0.1, np.inf, 0.1])


def test_rejected_islands_stand_still_for_correct():
    """A neighbour whose trial is rejected has h = 0 and its old state in what `correct` sees."""
    system, seen = oscillators([1.0, 50.0], [0.0, 0.0]), []

    def correct(step, h):
        if (h == 0.0).any():
            still = np.tile(h == 0.0, 2)
            seen.append((step.y1[still] == step.y0[still]).all() and (step.dense(0.5)[still] == step.y0[still]).all())
        return step.y1, np.full(2, np.nan), np.zeros(2, bool)

    memory = {**DormandPrince().start(system), "h_next": np.array([0.1, 0.5])}
    _, _, stats = advance(system, DormandPrince(), 0.0, 1.0, np.array([1.0, 1.0, 0.0, 0.0]), memory, correct=correct)
    assert stats.rejected > 0
    assert seen
    assert all(seen)


def test_an_island_that_is_always_set_back_diverges():
    system = pendulum()

    def correct(step, h):
        return step.y0, np.array([0.0]), np.array([False])

    with pytest.raises(Diverged, match="set back"):
        advance(system, fixed("euler"), 0.0, 1.0, np.array([1.0, 0.0]), {}, correct=correct)


@pytest.mark.parametrize(
    "change", [{"t1": -1.0}, {"clock": np.array([0.0, 0.0])}, {"clock": np.array([2.0])}, {"clock": np.array([np.nan])}]
)
def test_wrong_clocks_are_refused(change):
    with pytest.raises(InvalidInput):
        advance(pendulum(), fixed("rk4"), 0.0, **{"t1": 1.0, "y": np.array([1.0, 0.0]), "memory": {}, **change})


@pytest.mark.parametrize("name", ["symplectic_euler", "leapfrog", "yoshida4"])
def test_splitting_refuses_first_order_systems(name):
    system = FunctionSystem(lambda t, y: -y, 2)
    with pytest.raises(InvalidInput, match=f"^{name} needs x'' = f/m, .*rk4$"):
        fixed(name).step(system, 0.0, np.ones(2), 0.1, {})


@pytest.mark.parametrize("name", ["symplectic_euler", "leapfrog", "yoshida4"])
def test_splitting_does_not_drift_what_the_system_holds(name):
    """A pinned entry (x' = 0 although v is not) keeps its bits, and one led by hand goes where it is led."""
    system = FunctionSystem(lambda t, y: [0.0, 0.5, y[5], 0.0, 0.0, -y[2]], 6, 2, None, False)
    y = np.array([0.1 + 0.2, 0.0, 1.0, 3.0, 7.0, 0.0])
    y1 = fixed(name).step(system, 0.0, y, 0.1, {}).y1
    assert y1[[0, 3, 4]].tobytes() == y[[0, 3, 4]].tobytes()
    assert y1[1] == pytest.approx(0.05, rel=1e-14)


def test_names():
    assert list(SOLVERS) == [
        *("euler", "symplectic_euler", "midpoint", "heun", "rk4", "leapfrog", "yoshida4", "bs32", "dopri5"),
        *("implicit_euler", "implicit_midpoint", "bdf2", "xpbd"),
    ]
    assert find_solver("Backward-Euler") is SOLVERS["implicit_euler"]
    assert all(find_solver(alias).name == name for alias, name in ALIASES.items())
    with pytest.raises(InvalidInput, match="did you mean 'leapfrog'"):
        find_solver("leapfrogg")


@pytest.mark.parametrize(
    ("solver", "arguments"),
    [
        (DormandPrince, {"rtol": -1.0}),
        (DormandPrince, {"rtol": 0.0, "atol": 0.0}),
        (SOLVERS["leapfrog"], {"passes": 0}),
        (SOLVERS["yoshida4"], {"passes": 1.5}),
    ],
)
def test_arguments_are_checked(solver, arguments):
    with pytest.raises(InvalidInput, match=next(iter(arguments))):
        solver(**arguments)
