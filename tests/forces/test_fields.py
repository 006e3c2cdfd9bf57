"""Field, Flow and Wind: their arguments, and what users get to read when those do not fit."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.forces import FORCES, Drag, Field, Flow, Gravity, Vortex, Wind, find_force
from pointmass.laws.force import Force
from pointmass.laws.grid import Grid
from pointmass.laws.unary import velocity_field
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

SCALAR = Grid(np.zeros((2, 2, 2, 1)))
VECTOR = Grid(np.ones((2, 2, 2, 3)), outside="clamp")


def use(force):
    system = ParticleSystem(Particles([[1.0, 2, 3]], [[4.0, 5, 6]], 2.0, charge=7.0), [force])
    system.deriv_eval(0.5)
    return system.particles.f[0]


def test_registry():
    assert all(issubclass(f, Force) and f.__doc__ for f in FORCES.values())
    assert find_force("quadratic_drag") is FORCES["quadratic_drag"]
    with pytest.raises(InvalidInput, match="unknown force 'gravty': did you mean 'gravity'"):
        find_force("gravty")


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        (Field(("x", "vy", "m*t")), [1, 5, 1]),
        (Field((1, 2.5)), [1, 2.5, 0]),
        (Field((np.int64(-1), np.float32(2.5))), [-1, 2.5, 0]),
        (Field(("charge*k", "k**2", "radius + age"), constants={"k": 3}), [21, 9, 0]),
        (Field(("(-x)**n", "0", "0"), constants={"n": 3}), [-1, 0, 0]),
        (Field(("k*x", "0", "0"), constants={"k": "charge*t"}), [3.5, 0, 0]),
        (Field(("k*x", "0", "0"), constants={"k": lambda t: t}), [0.5, 0, 0]),
        (Field(potential="charge*x*y"), [-14, -7, 0]),
        (Field(potential="3"), [0, 0, 0]),
        (Field(grid=VECTOR, scale="2*t"), [1, 1, 1]),
        (Wind(Flow(("t", "charge", "x"))), 0.1 * np.array([0.5 - 4, 7 - 5, 1 - 6])),
        (Wind(Flow(grid=VECTOR, scale=2.0), k=1.0), [-2, -3, -4]),
        (
            Wind([Flow(("t", "charge", "x")), (1, 2, "t"), Flow(("1", "0", "0"))]),
            0.1 * np.array([2.5 - 4, 9 - 5, 1.5 - 6]),
        ),
        (Wind(lambda t: (t, 0.0, 0.0), k=2.0), [-7, -10, -12]),
    ],
)
def test_values(force, expected):
    np.testing.assert_allclose(use(force), expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (Field, "exactly one of force"),
        (lambda: Field(("x", "y", "z"), potential="x"), "exactly one of force"),
        (lambda: Field("x"), "three formulas"),
        (lambda: Field(("x",)), "three formulas"),
        (lambda: Field(("x", "y", None)), "formulas and numbers, not None"),
        (lambda: Field(("x", "y", "z.real")), "may use numbers"),
        (lambda: Field(potential=("x", "y", "z")), "one formula"),
        (lambda: Field(("x", "chrge", "0")), "unknown name in force: 'chrge': did you mean 'charge'?"),
        (lambda: Field(potential="vx"), "unknown name in potential: 'vx'"),
        (lambda: Flow(("vx", "0", "0")), "unknown name in velocity: 'vx'"),
        (Flow, "either velocity"),
        (lambda: Flow(("x", "y", "z"), grid=VECTOR), "either velocity"),
        (lambda: Field(("k*x", "0", "0"), constants={"k": float("nan")}), "k = nan"),
        (lambda: Field((float("nan"), 0, 0)), "force = nan is not allowed: it must be finite"),
        (lambda: Flow((0, 10**400, 0)), "velocity = inf is not allowed"),
        (lambda: Flow((0, 1j, 0)), "velocity must be made of formulas and numbers, not 1j"),
        (lambda: Field(("log(-1)", "0", "0")), "not finite: log(-1) = nan"),
        (lambda: Field(potential="9**9**9**9"), "not finite: 9**9**9 = inf"),
        (lambda: Field(("k*x", "0", "0"), constants={"x": 1.0}), "another meaning"),
        (lambda: Field(("k*x", "0", "0"), constants={"sin": 1.0}), "another meaning"),
        (lambda: Field(("k*x", "0", "0"), constants=[1.0]), "values by name"),
        (lambda: Field(("x", "0", "0"), scale=2.0), "belongs to a grid"),
        (lambda: Field(grid=SCALAR), "it must have 3"),
        (lambda: Field(grid=VECTOR, constants={"k": 1.0}), "belong to formulas"),
        (lambda: Field(grid=3.0), "must be a Grid or the path"),
        (lambda: Wind("3"), "three numbers or formulas"),
        (lambda: Wind(Vortex), "must be three numbers or a velocity field"),
        (lambda: Wind(Gravity()), "must be three numbers or a velocity field"),
        (lambda: Wind(Vortex(on=[0])), "give `on` to Wind"),
        (lambda: Wind([Vortex(), Gravity()]), "must be three numbers or a velocity field"),
        (lambda: Wind([Vortex(), (1, 2, 3, 4)]), "velocity1"),
        (lambda: Wind(Flow(("nobody", "0", "0"))), "unknown name in velocity: 'nobody'"),
        (lambda: Vortex(axis=(0, 0, 0)), "must be a direction"),
        (lambda: Drag(q=1.0), "has no parameter 'q': known are k, on, enabled"),
    ],
)
def test_mistakes_are_one_sentence(make, hint):
    with pytest.raises(InvalidInput) as error:
        use(make())
    assert hint in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_known_is_listed():
    with pytest.raises(InvalidInput) as error:
        use(Field(("kk*x", "0", "0"), constants={"spring": 1.0}))
    for name in ("x", "vz", "m", "t", "charge", "radius", "age", "spring", "sin", "pi"):
        assert f" {name}," in str(error.value) or str(error.value).endswith(f" {name}")


def test_a_flow_and_a_force_do_not_add():
    with pytest.raises(InvalidInput, match=r"flow is a velocity field .* Wind"):
        ParticleSystem(Particles([[0, 0, 0]]), [Gravity(), Flow(("1", "0", "0"))])


def test_wind_keeps_the_parameters_of_its_field_apart():
    @velocity_field
    def stream(x, t, k=2.0, speed=(1.0, 0.0, 0.0)):
        return k * speed

    wind = Wind(stream(k="t", speed=("charge", 0, 0)), k=3.0)
    assert list(wind.parameters) == ["k", "velocity_k", "velocity_speed"]
    np.testing.assert_allclose(use(wind), 3 * (np.array([0.5 * 7, 0, 0]) - [4, 5, 6]))
    np.testing.assert_allclose(
        ParticleSystem(Particles([[1.0, 2, 3]], charge=1.0), [wind]).jacobian(0.0, np.zeros(6)).toarray()[3:, 3:],
        -3 * np.eye(3),
    )


def test_wind_in_a_vortex_has_its_jacobian():
    system = ParticleSystem(Particles([[0.3, 0.1, 0]], charge=1.0), [Wind(Vortex(2.0, eps=0.2), k=0.5)])
    y = system.get_state()
    exact = system.jacobian(0.0, y).toarray()
    near = np.stack(
        [(system.deriv_eval(0.0, y + d) - system.deriv_eval(0.0, y - d)) / 2e-6 for d in 1e-6 * np.eye(6)], 1
    )
    np.testing.assert_allclose(exact, near, atol=1e-7)


def test_columns_of_the_field_in_a_wind_follow_removal():
    wind = Wind(Vortex([1.0, 2.0, 3.0], eps=0.1), k=1.0)
    x = np.array([[1.0, 0, 0]] * 3)
    system = ParticleSystem(Particles(x), [wind])
    before = system.deriv_eval().reshape(2, 3, 3)
    system.remove([1])
    np.testing.assert_array_equal(system.deriv_eval().reshape(2, 2, 3), before[:, [0, 2]])


def test_a_potential_without_a_value_has_no_force_either():
    system = pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Field(potential="sqrt(x - 5)")])
    with pytest.raises(pm.Diverged, match="field"):
        pm.Simulation(system).step()


@pytest.mark.parametrize(("name", "why"), [("a b", "one word"), ("sin", "another meaning"), ("x", "another meaning")])
def test_the_name_of_a_constant_is_a_free_word(name, why):
    with pytest.raises(InvalidInput, match=why):
        Field(("x", "0", "0"), constants={name: 1.0})
