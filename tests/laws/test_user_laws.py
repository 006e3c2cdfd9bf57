"""Laws of the user's own, as typed at a prompt; changing, copying and following births and deaths."""

import copy
import pickle

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.forces import Angles, Drag, Field, Gravitation, Gravity, Magnetic, Springs, Vortex, Wind
from pointmass.laws.arrays import ArrayForce, array_force
from pointmass.laws.elements import element_force, spring_force
from pointmass.laws.unary import unary_force, velocity_field
from pointmass.particles import Particles
from pointmass.system import ParticleSystem
from pointmass.tracing import functions as fn

X = np.array([[0.1, 0.2, 0.3], [1, 0, 0], [2, 1, 0], [3, 1, 1]], dtype=float)
V = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
STRENGTH = 3.0


def particles(dtype=np.float64):
    return Particles(X, V, charge=[1.0, 2.0, 3.0, 4.0], dtype=dtype)


def force_of(force, t=0.0):
    system = ParticleSystem(particles(), [force])
    system.deriv_eval(t)
    system.jacobian(t, system.get_state())
    return system.particles.f.copy()


def test_the_law_of_the_readme():
    @unary_force
    def swirl(x, v, m, t, strength=1.0):
        """Turns about z."""
        return -strength * x[1], strength * x[0], 0.0

    force = swirl(strength=2.0)
    np.testing.assert_allclose(force_of(force), np.stack([-2 * X[:, 1], 2 * X[:, 0], 0 * X[:, 0]], axis=1))
    assert force.name == "swirl"
    assert swirl.__doc__ == "Turns about z."
    assert repr(force) == "swirl(strength=2.0)"
    assert not force.velocity_dependent


def test_closures_vectors_and_numpy():
    wind = np.array([1.0, 2.0, 3.0])

    @unary_force
    def law(x, v, m, t, k=2.0, push=(0.0, 1.0, 0.0)):
        return -k * v + STRENGTH * np.array(push) + wind * np.sqrt(x[0] ** 2 + 1)

    want = -5 * V + STRENGTH * np.array([1, 0, 0]) + wind * np.sqrt(X[:, :1] ** 2 + 1)
    np.testing.assert_allclose(force_of(law(k=5.0, push=(1, 0, 0))), want)
    np.testing.assert_allclose(force_of(law(k=5.0, push=lambda t: (fn.cos(t), 0, t))), want)
    np.testing.assert_allclose(force_of(law(k="charge", push=("1", "0", "t")))[3], -4 * V[3] + want[3] + 5 * V[3])


def test_where_of_vectors():
    """Component by component; a number stands for three of it."""
    right = X[:, :1] > 1

    for law, want in (
        (lambda x, v, m, t: fn.where(x[0] > 1, x, -2 * v), np.where(right, X, -2 * V)),
        (lambda x, v, m, t: fn.where(x[0] > 1, (1.0, m, t), 0.0), np.where(right, [1.0, 1.0, 0.0], 0.0)),
        (lambda x, v, m, t: fn.where(x[0] > 1, np.ones(3), np.array(v)), np.where(right, 1.0, V)),
        (lambda x, v, m, t: fn.where([c > 0.5 for c in x], x, v), np.where(X > 0.5, X, V)),
        (lambda x, v, m, t: fn.where(True, x, v), X),
    ):
        np.testing.assert_array_equal(force_of(unary_force(law)()), want)


def test_parameters_without_defaults():
    @unary_force
    def law(x, v, m, t, k, g):
        return k * g

    for g in ((1, 2, 3), [1, 2, 3], lambda t: (1.0, 2.0, 3.0 + t), np.tile([1.0, 2, 3], (4, 1))):
        np.testing.assert_allclose(force_of(law(k=2.0, g=g)), np.tile([2.0, 4, 6], (4, 1)))


def test_velocity_fields():
    @velocity_field
    def rotation(x, t, W=1.0):
        return -W * x[1], W * x[0], 0.0

    system = ParticleSystem(particles(), [rotation(W=2.0)])
    assert system.order == 1
    np.testing.assert_allclose(
        system.deriv_eval().reshape(-1, 3), np.stack([-2 * X[:, 1], 2 * X[:, 0], 0 * X[:, 0]], 1)
    )
    np.testing.assert_allclose(force_of(Wind(rotation(W=2.0), k=0.5)), 0.5 * (system.deriv_eval().reshape(-1, 3) - V))


def test_springs_and_elements():
    @spring_force
    def rubber(x1, v1, x2, v2, t, k=50.0, rest=1.0):
        d = x1 - x2
        return -k * fn.maximum(fn.length(d) - rest, 0.0) * fn.inverse(fn.length(d)) * d

    d = X[0] - X[3]
    pull = -80 * (np.linalg.norm(d) - 1) * d / np.linalg.norm(d)
    f = force_of(rubber(pairs=[(0, 3)], k=80.0))
    np.testing.assert_allclose(f, [pull, 0 * pull, 0 * pull, -pull])

    @element_force(3)
    def middle(x1, v1, x2, v2, x3, v3, t, k=2.0):
        bend = 0.5 * (x1 + x3) - x2
        return -0.5 * k * bend, k * bend

    @element_force(3)
    def middle_all(x1, v1, x2, v2, x3, v3, t, k=2.0):
        bend = 0.5 * (x1 + x3) - x2
        return -0.5 * k * bend, k * bend, -0.5 * k * bend

    f = force_of(middle(elements=[(0, 1, 2), (1, 2, 3)]))
    np.testing.assert_allclose(f, force_of(middle_all(elements=[(0, 1, 2), (1, 2, 3)])), atol=1e-15)
    np.testing.assert_allclose(f.sum(axis=0), 0, atol=1e-15)


def law_of(function, **values):
    return lambda: force_of(unary_force(function)(**values))


def spring_of(function, **values):
    return lambda: force_of(spring_force(function)(**{"pairs": [(0, 1)], **values}))


def with_if(x, v, m, t):
    if x[0] > 0:
        return 1.0, 0.0, 0.0
    return 0.0, 0.0, 0.0


@pytest.mark.parametrize(
    ("use", "hint"),
    [
        (law_of(with_if), "use pm.where"),
        (law_of(lambda x, v, m, t: (x[0], x[1])), "must return 3 numbers, but returned 2"),
        (law_of(lambda x, v, m, t: None), "returned nothing"),
        (law_of(lambda x, v, m, t: abs(x) * v), "use pm.length(v)"),
        (law_of(lambda x, v, m, t: (x @ v) * v), "use pm.dot(a, b)"),
        (law_of(lambda x, v, m, t: (x @ (1.0, 0.0, 0.0)) * v), "use pm.dot(a, b)"),
        (law_of(lambda x, v, m, t: x**2), "use pm.dot(v, v)"),
        (law_of(lambda x, v, m, t: 2**x), "use pm.dot(v, v)"),
        (law_of(lambda x, v, m, t: 1 / x), "divide by pm.length(v)"),
        (law_of(lambda x, v, m, t: m / x), "divide by pm.length(v)"),
        (law_of(lambda x, v, m, t: x / v), "divide by pm.length(v)"),
        (law_of(lambda x, v, m, t: x % 2), "divide by pm.length(v)"),
        (law_of(lambda x, v, m, t: fn.where(x > 0, 1.0, 0.0) * v), "compare pm.length(v)"),
        (law_of(lambda x, v, m, t: fn.where(x == v, 1.0, 0.0) * v), "compare pm.length(v)"),
        (law_of(lambda x, v, m, t: fn.where(m < x, 1.0, 0.0) * v), "compare pm.length(v)"),
        (law_of(lambda x, v, m, t: v if x else x), "use pm.where"),
        (law_of(lambda x, v, m, t: x and v), "use pm.where"),
        (law_of(lambda x, v, m, t: fn.where(x[0] > 0, x, (1.0, 2.0))), "three numbers"),
        (
            law_of(lambda x, v, m, t: fn.length(m) * v),
            "three numbers is wanted, such as x or (1.0, 0.0, 0.0), not a number",
        ),
        (law_of(lambda x, v, m, t: fn.cross(x, 2)), "not a number"),
        (law_of(lambda x, v, m, t: x + 1), "not a number"),
        (law_of(lambda x, v, m, t: (float("nan"), 0, 0)), "computes with nan"),
        (law_of(lambda x, v, m, t: (fn.sqrt(-1.0), 0, 0)), "computes with nan"),
        (law_of(lambda x, v, m, t: (x[0] * np.nan, 0, 0)), "computes with nan"),
        (law_of(lambda x, v, m, t: (np.inf, 0, 0)), "returns inf"),
        (law_of(lambda x, v, m, t: (x[0] / 0, 0, 0)), "divides by zero"),
        (law_of(lambda x, v, m, t: (x[0] % 0, 0, 0)), "divides by zero"),
        (spring_of(lambda x1, v1, x2, v2, t: (float("nan"), 0, 0)), "computes with nan"),
        (law_of(lambda x, v, t, k=1.0: (k, 0, 0)), "must take (x, v, m, t)"),
        (law_of(lambda x, v, m: (m, 0, 0)), "must take (x, v, m, t)"),
        (law_of(lambda *everything: (1, 0, 0)), "must take (x, v, m, t)"),
        (law_of(lambda x, v, m, t, **more: (1, 0, 0)), "without * and **"),
        (law_of(lambda x, v, m, t, on=1.0: (on, 0, 0)), "parameter 'on'"),
        (law_of(lambda x, v, m, t, k: (k, 0, 0)), "needs k"),
        (law_of(lambda x, v, m, t, k=1.0: (k, 0, 0), q=2.0), "has no parameter q: its parameters are k"),
        (law_of(lambda x, v, m, t, k=1.0: (k, 0, 0), k=float("nan")), "k = nan"),
        (law_of(lambda x, v, m, t, k=1.0: (k, 0, 0), k=[1.0, 2.0]), "2 values for 4 particles"),
        (law_of(lambda x, v, m, t, k=1.0: (k, 0, 0), k="chrage"), "did you mean 'charge'"),
        (lambda: unary_force(3), "must be a function"),
        (lambda: unary_force(np.sin), "must take"),
        (lambda: unary_force(lambda x, v, m, t: x)(1.0), "0 arguments without a name"),
        (spring_of(lambda x1, v1, x2, v2, t: 3.0 * x1[0]), "three numbers for the first particle, but returned 1"),
        (spring_of(lambda x1, v1, x2, v2, t: None), "returned nothing"),
        (spring_of(lambda x1, x2, t: x1), "must take (x1, v1, x2, v2, t)"),
        (spring_of(lambda x1, v1, x2, v2, t, k=1.0: k * x1, k="charge"), "may depend on t, not on ['charge']"),
        (spring_of(lambda x1, v1, x2, v2, t: x1, pairs=[(0, 9)]), "joins particle 9, which does not exist"),
        (spring_of(lambda x1, v1, x2, v2, t: x1, pairs=[(1, 1)]), "joins particle 1 with itself"),
        (spring_of(lambda x1, v1, x2, v2, t: x1, pairs=[(0.0, 1.0)]), "needs 2 particle ids"),
        (spring_of(lambda x1, v1, x2, v2, t: x1, pairs=[(0, 1), (2,)]), "needs 2 particle ids"),
        (spring_force(lambda x1, v1, x2, v2, t: x1), "needs 'pairs'"),
        (lambda: element_force(1), "at least 2"),
        (lambda: force_of(array_force(lambda x, v, m, t: x @ x)), "failed: ValueError"),
        (lambda: force_of(array_force(lambda x, v, m, t: x[:2])), "must return an array of shape (4, 3), not (2, 3)"),
        (lambda: force_of(array_force(lambda x, v, m, t: None)), "must return an array"),
    ],
)
def test_mistakes_are_one_sentence(use, hint):
    with pytest.raises(InvalidInput) as error:
        use()
    assert hint in str(error.value)
    assert "\n" not in str(error.value)


# ------------------------------------------------------------------------------------------------ arrays


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_array_forces(dtype):
    @array_force
    def spin(x, v, m, t):
        return np.cross([0, 1, 0], x)

    system = ParticleSystem(particles(dtype), [spin, array_force(lambda x, v, m, t: [0, m.sum() * t, 0])])
    system.deriv_eval(2.0)
    np.testing.assert_allclose(system.particles.f, np.cross([0, 1, 0], X) + np.array([0, 8, 0]), rtol=1e-6)
    assert system.particles.f.dtype == dtype
    assert spin.name == "spin"
    assert spin.velocity_dependent


def test_coupled_array_forces():
    @array_force(coupled=True, constants={"k": 2.0})
    def gather(x, v, m, t, k):
        return k * (x.mean(axis=0) - x)

    system = ParticleSystem(particles(), [gather])
    assert system.island_of_particle.tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(system.deriv_eval()[12:].reshape(-1, 3), 2 * (X.mean(axis=0) - X))
    with pytest.raises(InvalidInput, match="implicit solvers need a law"):
        system.jacobian(0.0, system.get_state())


def test_jacobian_of_an_array_force():
    slow = ParticleSystem(particles(), [ArrayForce(lambda x, v, m, t: -0.3 * v + np.sin(x), on=[0, 2])])
    fast = ParticleSystem(particles(), [Field(("sin(x) - 0.3*vx", "sin(y) - 0.3*vy", "sin(z) - 0.3*vz"), on=[0, 2])])
    y = slow.get_state()
    np.testing.assert_allclose(slow.jacobian(0.0, y).toarray(), fast.jacobian(0.0, y).toarray(), atol=1e-9)


# ------------------------------------------------------------------------------------------------ changes


def test_set_changes_the_force_and_its_arguments():
    force = Drag(k=0.1)
    system = ParticleSystem(particles(), [force])
    traced = force.traced
    force.set(k=0.3)
    np.testing.assert_allclose(system.deriv_eval()[12:].reshape(-1, 3), -0.3 * V)
    assert force.arguments == {"k": 0.3}
    assert force.traced is traced
    force.set(k="0.1*charge")
    np.testing.assert_allclose(system.deriv_eval()[12:].reshape(-1, 3), -0.1 * V * [[1], [2], [3], [4]])


@pytest.mark.parametrize(
    ("values", "hint"),
    [
        ({"k": -1}, "at least 0"),
        ({"k": [1, 2]}, "2 values for 4 particles"),
        ({"k": "chrage"}, "did you mean"),
        ({"c": 1}, "has no parameter 'c'"),
        ({"on": [0]}, "k can be set"),
    ],
)
def test_set_refuses_and_keeps_what_was(values, hint):
    force = Drag(k=0.3)
    system = ParticleSystem(particles(), [force])
    with pytest.raises(InvalidInput) as error:
        force.set(**values)
    assert hint in str(error.value)
    assert force.arguments == {"k": 0.3}
    np.testing.assert_allclose(system.deriv_eval()[12:].reshape(-1, 3), -0.3 * V)


def test_set_of_vectors_constants_springs_and_inner_fields():
    gravity = Gravity()
    gravity.set(g=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(force_of(gravity)[0], [1, 2, 3])
    field = Field(("k*x", "0", "0"), constants={"k": 1.0})
    field.set(k=5.0)
    np.testing.assert_allclose(force_of(field)[:, 0], 5 * X[:, 0])
    assert field.arguments["constants"] == {"k": 5.0}
    springs = Springs([(0, 1)])
    assert np.abs(force_of(springs)).max() < 1e-14
    springs.set(rest=0.5, k_s=10.0)
    assert np.linalg.norm(force_of(springs)[0]) == pytest.approx(10 * (np.linalg.norm(X[0] - X[1]) - 0.5))
    wind = Wind(Vortex(circulation="t"), k=1.0)
    before = force_of(wind, t=1.0) + V
    wind.flows[0].set(circulation=2.0)
    np.testing.assert_allclose(force_of(wind, t=1.0) + V, 2 * before, atol=1e-15)
    with pytest.raises(InvalidInput, match="another kind of value"):
        wind.set(velocity=(1, 0, 0))


def everything():
    return [
        Springs([(0, 1), (1, 2), (2, 3)], k_s=[1.0, 2.0, 3.0], k_d=0.1),
        Angles([(0, 1, 2), (1, 2, 3)], rest=1.0),
        Drag(on=[0, 2]),
        Drag(k="0.1*charge", on=np.array([True, False, True, True])),
        Magnetic(),
        Gravitation(eps=0.1, on=[1, 2, 3]),
        Wind(Vortex("sin(t)")),
        Field(potential="charge*x**2"),
    ]


def test_removal_equals_having_never_been_there():
    system = ParticleSystem(particles(), everything())
    system.remove([1])
    left = [0, 2, 3]
    other = ParticleSystem(
        Particles(X[left], V[left], charge=[1.0, 3.0, 4.0]),
        [
            Springs([(1, 2)], k_s=[3.0], k_d=0.1, rest=np.linalg.norm(X[2] - X[3])),
            Drag(on=[0, 1]),
            Drag(k="0.1*charge", on=[0, 1, 2]),
            Magnetic(),
            Gravitation(eps=0.1, on=[1, 2]),
            Wind(Vortex("sin(t)")),
            Field(potential="charge*x**2"),
        ],
    )
    np.testing.assert_array_equal(system.deriv_eval(0.5), other.deriv_eval(0.5))


def test_births_leave_selections_and_springs_alone():
    system = ParticleSystem(particles(), everything())
    before = system.deriv_eval(0.5).reshape(2, -1, 3)
    system.add([[5.0, 5, 5]], [[1.0, 2, 3]], charge=[2.0])
    after = system.deriv_eval(0.5).reshape(2, -1, 3)
    np.testing.assert_array_equal(after[:, :4], before)
    alone = ParticleSystem(
        Particles([[5.0, 5, 5]], [[1.0, 2, 3]], charge=2.0),
        [Magnetic(), Wind(Vortex("sin(t)")), Field(potential="charge*x**2")],
    )
    np.testing.assert_array_equal(after[:, 4], alone.deriv_eval(0.5).reshape(2, 3))


def test_removal_then_birth():
    system = ParticleSystem(particles(), [Drag(k=1.0, on=[3]), Springs([(0, 1)])])
    system.remove([0])
    system.add(X[:1], V[:1])
    assert system.forces[0].on.tolist() == [False, False, True, False]
    np.testing.assert_array_equal(system.deriv_eval()[12:].reshape(-1, 3), [[0] * 3, [0] * 3, -V[3], [0] * 3])


def test_particles_removed_behind_the_back_of_a_spring():
    system = ParticleSystem(particles(), [Springs([(0, 1)])])
    system.particles.remove([3])
    system.deriv_eval()
    system.particles.remove([0])
    with pytest.raises(InvalidInput, match="springs 0 joins particle 0, which does not exist"):
        system.deriv_eval()


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_copies(clone):
    system = ParticleSystem(particles(), everything())
    want = system.deriv_eval(0.5)
    other = clone(system)
    np.testing.assert_array_equal(other.deriv_eval(0.5), want)
    other.forces[2].set(k=9.0)
    np.testing.assert_array_equal(system.deriv_eval(0.5), want)


def test_a_force_belongs_to_the_particles_it_is_asked_about():
    springs = Springs([(0, 1)], rest=0.1)
    first, second = ParticleSystem(particles(), [springs]), ParticleSystem(Particles(2 * X), [springs])
    a, b = first.deriv_eval(), second.deriv_eval()
    assert not (a[12:] == b[12:]).all()
    np.testing.assert_array_equal(first.deriv_eval(), a)
