"""The particle system: the four verbs of the lecture, islands, the Jacobian, energies."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pointmass.errors import InvalidInput
from pointmass.forces import Angles, Drag, Flow, Gravitation, Gravity, Harmonic, Springs, Vortex, Wind
from pointmass.laws.arrays import array_force
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

RNG = np.random.default_rng(11)
X, V, M = RNG.standard_normal((6, 3)), RNG.standard_normal((6, 3)), RNG.uniform(0.5, 2, 6)


def body(dtype=np.float64):
    forces = [
        Gravity(),
        Drag(k=0.2),
        Springs([(0, 1), (1, 2), (3, 4)], k_s=5.0, k_d=0.1, rest=0.7),
        Angles([(0, 1, 2)], k_s=2.0, rest=0.3),
        Wind(Vortex("sin(t)")),
    ]
    return ParticleSystem(Particles(X, V, M, dtype=dtype), forces)


def flow():
    return ParticleSystem(Particles(X), [Flow(("-y", "x", "sin(t)")), Vortex()])


@pytest.mark.parametrize(("system", "per_particle"), [(body(), 6), (flow(), 3)])
def test_four_verbs(system, per_particle):
    assert system.dim == per_particle * 6
    y = system.get_state()
    assert y.shape == (system.dim,)
    system.set_state(y.copy(), 1.5)
    np.testing.assert_array_equal(system.get_state(), y)
    assert system.t == 1.5
    first, second = system.deriv_eval(0.3, y), system.deriv_eval(0.3, y)
    np.testing.assert_array_equal(first, second)
    assert first is not second
    np.testing.assert_array_equal(system.deriv_eval(), system.deriv_eval(1.5, y))
    np.testing.assert_array_equal(system.get_state(), y)


def test_the_state_is_a_copy():
    system = body()
    y = system.get_state()
    before = y.copy()
    system.particles.x += 1
    np.testing.assert_array_equal(y, before)
    system.set_state(y)
    y += 1
    np.testing.assert_array_equal(system.get_state(), before)


def test_set_then_get_is_bit_identical():
    system = body()
    y = np.frombuffer(RNG.bytes(8 * system.dim), np.float64)
    y = np.where(np.isfinite(y), y, 0.0)
    system.set_state(y)
    np.testing.assert_array_equal(system.get_state().view(np.int64), (y + 0.0).view(np.int64))


def test_derivative_is_v_and_f_over_m():
    system = body()
    dy = system.deriv_eval(0.0)
    np.testing.assert_array_equal(dy[:18], V.ravel())
    np.testing.assert_allclose(dy[18:], (system.particles.f / M[:, None]).ravel(), rtol=4e-16)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_precision_stays(dtype):
    system = body(dtype)
    assert system.get_state().dtype == dtype
    assert system.deriv_eval(0.5).dtype == dtype
    assert system.particles.f.dtype == dtype
    system.set_state(np.zeros(system.dim))
    assert system.particles.x.dtype == dtype


def test_pinned_particles_stay():
    system = body()
    system.particles.pin([0, 3])
    y = system.get_state()
    y[18:] = 5.0
    dy = system.deriv_eval(0.2, y).reshape(2, 6, 3)
    assert (dy[:, [0, 3]] == 0).all()
    assert (dy[:, [1, 2, 4, 5]] != 0).all()
    system.set_state(y)
    assert (system.particles.v[[0, 3]] == 0).all()
    assert np.isinf(system.inertia.reshape(6, 3)[[0, 3]]).all()
    rows = system.jacobian(0.0, y).toarray().reshape(2, 6, 3, 36)
    assert (rows[:, [0, 3]] == 0).all()
    carried = flow()
    carried.particles.pin([1])
    assert (carried.deriv_eval().reshape(6, 3)[1] == 0).all()


def test_another_integrator_drives_it():
    system = ParticleSystem(Particles([[1.0, 0, 0]], m=2.0), [Harmonic(k_s=8.0)])
    solution = solve_ivp(system.deriv_eval, (0, 1), system.get_state(), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(solution.y[:, -1], [np.cos(2), 0, 0, -2 * np.sin(2), 0, 0], atol=1e-7)


@pytest.mark.parametrize("system", [body(), flow()])
def test_jacobian(system):
    y, h = system.get_state(), 1e-6
    near = np.stack(
        [(system.deriv_eval(0.3, y + d) - system.deriv_eval(0.3, y - d)) / (2 * h) for d in h * np.eye(system.dim)], 1
    )
    exact = system.jacobian(0.3, y).toarray()
    np.testing.assert_allclose(exact, near, atol=1e-6 * max(1, np.abs(near).max()))


def test_islands():
    system = body()
    assert system.island_of_particle.tolist() == [0, 0, 0, 1, 1, 2]
    assert system.islands.tolist() == np.tile(np.repeat([0, 0, 0, 1, 1, 2], 3), 2).tolist()
    system.forces[2].enabled = False
    assert system.island_of_particle.tolist() == [0, 0, 0, 1, 2, 3]  # the joint 0-1-2 remains
    system.remove([1])
    assert system.island_of_particle.tolist() == [0, 1, 2, 3, 4]
    system.add(X[:2])
    assert len(set(system.island_of_particle)) == 7
    coupled = ParticleSystem(Particles(X), [Gravitation(eps=0.1, on=[1, 3, 5])])
    assert coupled.island_of_particle.tolist() == [0, 1, 2, 1, 3, 1]


def test_islands_with_clocks_of_their_own():
    system = body()
    y = system.get_state()
    times = np.array([0.1, 0.5, 0.9])[system.islands]
    mixed = system.deriv_eval(times, y)
    for island, t in enumerate((0.1, 0.5, 0.9)):
        mine = system.islands == island
        np.testing.assert_array_equal(mixed[mine], system.deriv_eval(t, y)[mine])


def test_energy():
    masses = Particles([[0, 2.0, 0], [3, 2, 0]], [[1, 0, 0], [0, 2, 0]], [1.0, 2.0])
    system = ParticleSystem(masses, [Gravity(), Drag(), Springs([(0, 1)], k_s=10.0, rest=2.0), Gravity((0, -1, 0))])
    energy = system.energy()
    assert energy.kinetic == pytest.approx(0.5 + 4)
    assert energy.by_force == pytest.approx({"gravity": 9.81 * 6 + 6, "springs": 5.0})
    assert energy.without == ("drag",)
    assert energy.total == pytest.approx(4.5 + 9.81 * 6 + 11)
    assert system.stretch() == pytest.approx(0.5)
    np.testing.assert_allclose(system.momentum(), [1, 4, 0])
    np.testing.assert_allclose(system.angular_momentum(), [0, 0, -2 + 12])
    masses.pin([1])
    assert system.energy().kinetic == pytest.approx(0.5)


def test_energy_is_kept_by_what_has_one():
    system = ParticleSystem(
        Particles(X, V, M), [Gravity(), Springs([(0, 1), (1, 2)], 5.0, rest=0.7), Gravitation(eps=0.3)]
    )
    before = system.energy().total
    y = solve_ivp(system.deriv_eval, (0, 2), system.get_state(), method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    system.set_state(y, 2.0)
    assert system.energy().total == pytest.approx(before, rel=1e-8)


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (
            lambda: ParticleSystem(Particles(X), ["gravity"]),
            "forces must be forces, such as pm.Gravity(), not 'gravity'",
        ),
        (lambda: ParticleSystem(Particles(X), [Gravity]), "forces must be forces"),
        (lambda: ParticleSystem(Particles(X), [], [Gravity()]), "colliders must be colliders"),
        (lambda: ParticleSystem(Particles(X), [Gravity(), Flow(("0", "0", "0"))]), "Wind(velocity=...)"),
        (lambda: ParticleSystem(Particles(X), [Springs([(0, 6)])]), "particle 6, which does not exist"),
        (lambda: ParticleSystem(Particles(np.zeros((0, 3))), [Springs([(0, 1)])]), "which does not exist"),
        (lambda: ParticleSystem(Particles(X), [Drag(on="smoke")]), "unknown group of particles 'smoke'"),
        (lambda: body().deriv_eval(0.0, np.zeros(5)), "the state must have shape (36,), not (5,)"),
        (lambda: body().set_state(np.zeros(37)), "the state must have shape (36,)"),
    ],
)
def test_refused(make, hint):
    with pytest.raises(InvalidInput) as error:
        make()
    assert hint in str(error.value)


def test_velocity_dependence():
    p = Particles(X)
    assert not ParticleSystem(p, [Gravity(), Springs([(0, 1)], k_d=0.0)]).forces[0].velocity_dependent
    assert ParticleSystem(p, [Gravity(), Drag()]).velocity_dependent
    assert not ParticleSystem(p, [Gravity(), Drag(enabled=False), Gravitation()]).velocity_dependent


def test_nothing_at_all():
    empty = ParticleSystem(Particles(np.zeros((0, 3))))
    assert empty.dim == 0
    assert empty.deriv_eval().shape == (0,)
    assert empty.energy().total == 0
    assert empty.islands.shape == (0,)
    alone = ParticleSystem(Particles(X, V))
    np.testing.assert_array_equal(alone.deriv_eval(), [*V.ravel(), *np.zeros(18)])


def test_a_numpy_force_in_a_system():
    @array_force
    def lift(x, v, m, t):
        return np.stack([0 * m, 9.81 * m, 0 * m], axis=1)

    floating = ParticleSystem(Particles(X, V, M), [Gravity(), lift])
    np.testing.assert_allclose(floating.deriv_eval()[18:], 0, atol=1e-12)


def test_a_refused_birth_leaves_the_system_as_it_was() -> None:
    system = ParticleSystem(Particles([[0, 0, 0], [1, 0, 0]]), [Gravity(), Drag(k=np.array([1.0, 2.0]))])
    with pytest.raises(InvalidInput, match="2 values for 3 particles"):
        system.add([[2, 0, 0]])
    assert len(system.particles) == 2
    assert system.deriv_eval(0.0, system.get_state()).shape == (12,)


@pytest.mark.parametrize(
    ("force", "hint"),
    [
        (Drag([1.0, 2.0]), "force drag: k has 2 values for 6 particles"),
        (Gravity(on="nobody"), "force gravity: unknown group of particles 'nobody'"),
        (Springs([(0, 9)]), "force springs: springs 0 joins particle 9"),
    ],
)
def test_an_error_says_which_force(force, hint):
    with pytest.raises(InvalidInput) as error:
        ParticleSystem(Particles(X), [force])
    assert str(error.value).startswith(hint)


def test_an_error_in_a_run_says_which_force():
    system = ParticleSystem(Particles(X), [Harmonic("1 - t")])
    system.set_state(system.get_state(), 2.0)
    for question in (system.deriv_eval, system.energy, lambda: system.jacobian(2.0, system.get_state())):
        with pytest.raises(InvalidInput, match=r"force harmonic: at t = 2 s, k_s = -1\.0 is not allowed"):
            question()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_particle_is_divided_into_parts_at_its_place(dtype):
    """Each with its share of the mass, in the same groups and under the same forces; momentum stays."""
    particles = Particles(X, V, M, radius=0.1, lifetime=2.0, dtype=dtype, charge=np.arange(6.0))
    particles.tag("odd", [1, 3, 5])
    particles.age[:] = 0.5
    system = ParticleSystem(particles, [Gravity(on="odd"), Drag(k=0.2, on=[3]), Springs([(3, 4)], 1.0)])
    momentum = system.momentum()
    ids = system.divide(3, np.array([0.5, 0.3, 0.2]))
    assert ids.tolist() == [6, 7]
    np.testing.assert_allclose(particles.m[[3, 6, 7]], M[3] * np.array([0.5, 0.3, 0.2]), rtol=1e-6)
    np.testing.assert_allclose(system.momentum(), momentum, rtol=1e-6)
    for column in (particles.x, particles.v, particles.age, particles.lifetime, particles.radius):
        assert (column[[6, 7]] == column[3]).all()
    assert particles.attributes["charge"][6:].tolist() == [3, 3]
    assert particles.groups["odd"].tolist() == [False, True] * 3 + [True, True]
    assert np.flatnonzero(system.forces[1].on).tolist() == [3, 6, 7]
    assert system.forces[2].ids.tolist() == [[3, 4]]
    particles.pin([0])
    system.divide(0, np.array([0.5, 0.5]))
    assert particles.pinned.tolist() == [True] + [False] * 7 + [True]


def test_elements_are_made_anew_from_old_ones():
    springs = Springs([(0, 1), (1, 2), (3, 4)], [10.0, 20.0, 30.0], 0.5, [1.0, 2.0, 3.0])
    system = ParticleSystem(Particles(X), [springs])
    springs.parameters["k_d"].each(3, "springs")
    springs.remake(np.array([[0, 5], [3, 4], [2, 4]]), np.array([0, 2, 2]), np.array([1.0, 0.25, 0.75]))
    settings = springs.settings(system.particles, 0.0, np.arange(3))
    assert settings["k_s"][0].tolist() == [10.0, 7.5, 22.5]
    assert settings["k_d"][0].tolist() == [0.5, 0.125, 0.375]
    assert settings["rest"][0].tolist() == [1.0, 3.0, 3.0]
    assert system.island_of_particle.tolist() == [0, 1, 2, 2, 2, 0]
    with pytest.raises(InvalidInput, match="k_s of springs is not allowed to be a function of t"):
        Springs([(0, 1)], "1 + t").parameters["k_s"].each(1, "springs")
