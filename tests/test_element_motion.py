"""What springs, joints and other elements do by themselves, against closed forms."""

import numpy as np
import pytest

import pointmass as pm


def spring_pair(k_s, k_d, m, pinned=()):
    """Two masses on a spring in a direction of its own."""
    p = pm.Particles([[0.3, -0.2, 0.7], [1.1, 0.4, 1.5]], m=m)
    p.pin(list(pinned))
    return pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=k_s, k_d=k_d, family="link")])


@pytest.mark.parametrize(("m", "pinned"), [((0.5, 0.5), ()), ((0.2, 3.0), ()), ((1.0, 0.7), (0,))])
def test_a_spring_between_two_masses(m, pinned):
    """w^2 = k_s (1/m1 + 1/m2), zeta = k_d / (2 sqrt(k_s mu)); symplectic Euler: w h < 2 (sqrt(1 + zeta^2) - zeta)."""
    mu = m[1] if pinned else m[0] * m[1] / (m[0] + m[1])
    omega, zeta = np.sqrt(80.0 / mu), 0.6 / (2 * np.sqrt(80.0 * mu))
    (table,) = spring_pair(80.0, 0.6, m, pinned).stability("symplectic_euler").elements
    assert (table.force, table.family, table.ids.tolist()) == ("springs", "link", [[0, 1]])
    assert table.frequency[0] == pytest.approx(omega, rel=1e-12)
    assert table.damping_ratio[0] == pytest.approx(zeta, rel=1e-12)
    limit = 2 * (np.sqrt(1 + zeta**2) - zeta) / omega
    assert table.largest_safe_dt[0] == pytest.approx(limit, rel=1e-6)
    assert table.share(limit / 2)[0] == pytest.approx(0.5, rel=1e-6)
    assert table.share_together(limit / 2)[0] == pytest.approx(0.5, rel=1e-6)
    assert table.part[0] == pytest.approx(1.0, rel=1e-9)


def test_a_damper_without_a_spring():
    """Its rate is k_d/mu, and Euler's limit 2 mu/k_d."""
    report = spring_pair(0.0, 0.6, (1.0, 1.0)).stability("euler")
    (table,) = report.elements
    assert (table.frequency[0], table.damping_ratio[0]) == (0.0, np.inf)
    assert table.largest_safe_dt[0] == pytest.approx(2 * 0.5 / 0.6, rel=1e-6)
    assert report.carriers()[0].part == pytest.approx(1.0, rel=1e-9)


def test_two_pinned_ends_do_not_swing():
    (table,) = spring_pair(10.0, 0.1, (1.0, 1.0), (0, 1)).stability("leapfrog").elements
    assert (table.frequency[0], table.largest_safe_dt[0], table.share(1.0)[0]) == (0.0, np.inf, 0.0)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_straight_joint_is_as_stiff_as_one_that_is_hardly_bent(dtype):
    """Its slope is (1, -2, 1)/L across: w^2 = 6 k_s / (m L^2), though exactly at 0 it has no force at all.

    It bends in two planes equally fast, and is damped in one of them: what is found is one of them or between.
    """
    p = pm.Particles(0.25 * np.arange(3.0)[:, None] * [0.6, 0.0, 0.8], m=0.4, dtype=dtype)
    report = pm.ParticleSystem(p, [pm.Angles([(0, 1, 2)], k_s=2.0, k_d=0.01)]).stability("leapfrog")
    (table,) = report.elements
    omega = np.sqrt(6 * 2.0 / 0.4) / 0.25
    tolerance = 1e-6 if dtype == np.float64 else 5e-3  # the bend, and the rounding of positions relative to it
    assert table.frequency[0] == pytest.approx(omega, rel=tolerance)
    assert -1e-3 < table.damping_ratio[0] < 1.01 * (0.01 / 2.0 * omega / 2)
    assert report.frequency == pytest.approx(omega, rel=tolerance)
    assert str(report.carriers()[0]) == "angle 0 (particles 0-1-2)"
    assert p.x.tolist() == pm.Particles(0.25 * np.arange(3.0)[:, None] * [0.6, 0.0, 0.8], dtype=dtype).x.tolist()


def test_a_law_that_also_holds_on_to_a_place():
    """Not only the difference counts: stiffness [[k + a, -k], [-k, k]] along x."""

    @pm.spring_force
    def anchored(x1, v1, x2, v2, t, k=30.0):
        return -k * (x1[0] - x2[0]), 0.0, 0.0

    @pm.element_force(2)
    def moored(x1, v1, x2, v2, t, k=30.0, a=50.0):
        pull = -k * (x1[0] - x2[0])
        return pull - a * x1[0], 0.0, 0.0, -pull, 0.0, 0.0

    p = pm.Particles([[0, 0, 0], [1, 0, 0]], m=[2.0, 3.0])
    tables = pm.ParticleSystem(p, [anchored(pairs=[(0, 1)]), moored(pairs=[(0, 1)])]).stability("leapfrog").elements
    alone = [np.array([[30.0, -30.0], [-30.0, 30.0]]), np.array([[80.0, -30.0], [-30.0, 30.0]])]
    root = 1 / np.sqrt([2.0, 3.0])
    for table, stiffness in zip(tables, alone, strict=True):
        omega = np.sqrt(np.linalg.eigvalsh(stiffness * root[:, None] * root).max())
        assert table.frequency[0] == pytest.approx(omega, rel=1e-12)


def test_a_chain_of_equal_links_is_at_the_edge_everywhere():
    """Alone sqrt(2 k/m), in a long chain 2 sqrt(k/m): the neighbours count, and the sums at each particle find it."""
    body = pm.chain(60, mass=60.0, k_s=40.0, damping_ratio=0.0, pinned="none")
    m = body.particles.m[0]
    report = pm.ParticleSystem(body.particles, body.forces).stability("leapfrog")
    (table,) = report.elements
    np.testing.assert_allclose(table.frequency, np.sqrt(2 * 40.0 / m), rtol=1e-9)
    assert table.share_together(report.largest_safe_dt).max() == pytest.approx(1.0, rel=1e-9)
    assert table.share_together(report.largest_safe_dt).min() > 0.99
    assert table.share(report.largest_safe_dt).max() == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert report.largest_safe_dt == pytest.approx(2 / (2 * np.sqrt(40.0 / m)), rel=1e-3)


def test_who_carries_the_fastest_motion():
    """One link is a hundred times stiffer: the motion is its own, and it is named with its particles."""
    x = np.arange(9.0)[:, None] * [1, 0, 0]
    stiffness = np.where(np.arange(8) == 5, 1000.0, 10.0)
    links = pm.Springs([(i, i + 1) for i in range(8)], k_s=stiffness, family="shear")
    report = pm.ParticleSystem(pm.Particles(x), [pm.Gravity(), links]).stability("rk4")
    first, *others = report.carriers(8)
    assert str(first) == "spring 5 of family shear (particles 5-6)"
    assert (first.force, first.number, first.particles) == ("springs", 5, (5, 6))
    assert first.part > 0.98
    assert [e.number for e in others][:2] in ([4, 6], [6, 4])
    assert report.elements[0].part.sum() == pytest.approx(1.0, rel=1e-9)
    assert "spring 5 of family shear" in str(report)
    assert "largest safe dt of rk4: 0.06" in str(report)


def test_parts_leave_out_what_other_forces_carry():
    """A mass on a spring of 30 N/m and in an attractor of 10 N/m: three quarters of the energy are the spring's."""
    p = pm.Particles([[0, 0, 0], [1, 0, 0]])
    p.pin([0])
    report = pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=30.0), pm.Harmonic(k_s=10.0)]).stability("leapfrog")
    assert report.elements[0].part[0] == pytest.approx(0.75, rel=1e-9)


def test_islands_that_are_alike_name_springs_of_one():
    pairs = [(3 * i + j, 3 * i + j + 1) for i in range(100) for j in range(2)]
    x = np.arange(300.0)[:, None] * [1, 0, 0]
    report = pm.ParticleSystem(pm.Particles(x), [pm.Springs(pairs, k_s=7.0)]).stability("leapfrog")
    first, second = report.carriers()
    assert first.part == pytest.approx(0.5, abs=1e-5)
    assert {*first.particles} & {*second.particles}


def test_no_elements_that_act():
    system = spring_pair(10.0, 0.1, (1.0, 1.0))
    system.forces[0].enabled = False
    assert system.stability("leapfrog").elements == ()
    assert "any" in str(system.stability("leapfrog"))
    assert "nothing swings" in str(system.stability("leapfrog"))


@pytest.mark.parametrize(("solver", "share"), [("implicit_euler", 0.0), ("dopri5", 0.0), ("euler", np.inf)])
def test_solvers_that_take_any_step_or_none(solver, share):
    (table,) = spring_pair(80.0, 0.0, (1.0, 1.0)).stability(solver).elements
    assert (table.share(1.0)[0], table.share_together(1.0)[0]) == (share, share)


def test_elements_that_the_solver_relaxes_limit_no_step():
    """XPBD takes springs of any stiffness, and a law that is no constraint as symplectic Euler does."""

    @pm.spring_force
    def rod(x1, v1, x2, v2, t, k=30.0):
        return -k * (x1 - x2)

    system = spring_pair(1e8, 0.0, (1.0, 1.0))
    report = system.stability("xpbd")
    assert (report.largest_safe_dt, report.elements[0].share(1.0)[0]) == (np.inf, 0.0)
    assert report.frequency == pytest.approx(np.sqrt(2e8), rel=1e-9)
    system = pm.ParticleSystem(system.particles, [*system.forces, rod(pairs=[(0, 1)], k=50.0)])
    report = system.stability("xpbd")
    assert report.largest_safe_dt == pytest.approx(2 / np.sqrt(2 * 50.0), rel=1e-6)
    assert [t.share(0.1)[0] for t in report.elements] == pytest.approx([0.0, 0.5], rel=1e-6)


def test_each_of_many_springs_has_its_own_figures():
    """Random springs between random masses: more damping ratios than are tried, so limits are interpolated."""
    rng = np.random.default_rng(3)
    pairs = np.stack([2 * np.arange(500), 2 * np.arange(500) + 1], axis=1)
    m, k_s, k_d = rng.uniform(0.2, 3.0, 1000), rng.uniform(5, 500, 500), rng.uniform(0, 20, 500)
    system = pm.ParticleSystem(pm.Particles(rng.normal(size=(1000, 3)), m=m), [pm.Springs(pairs, k_s=k_s, k_d=k_d)])
    (table,) = system.stability("symplectic_euler").elements
    mu = m[::2] * m[1::2] / (m[::2] + m[1::2])
    omega, zeta = np.sqrt(k_s / mu), k_d / (2 * np.sqrt(k_s * mu))
    np.testing.assert_allclose(table.frequency, omega, rtol=1e-9)
    np.testing.assert_allclose(table.damping_ratio, zeta, rtol=1e-6)
    np.testing.assert_allclose(table.largest_safe_dt, 2 * (np.sqrt(1 + zeta**2) - zeta) / omega, rtol=2e-3)
