"""Hinges: angles of closed form, forces that move and turn nothing as a whole, and the period of a flap."""

import numpy as np
import pytest

import pointmass as pm

EDGE, LEFT = [[0, 0, 0], [0, 2.0, 0]], [-1.0, 0.3, 0]
RNG = np.random.default_rng(11)


def flap(angle, reach=1.5):
    """Corners of a hinge that is folded by an angle."""
    return np.array([*EDGE, LEFT, [reach * np.cos(angle), 0.8, reach * np.sin(angle)]])


def value(corners):
    particles = pm.Particles(corners)
    return pm.Hinges([(0, 1, 2, 3)]).values(particles, particles.x)[0]


@pytest.mark.parametrize("angle", [-3.1, -np.pi / 2, -0.4, -1e-7, 0.0, 1e-7, 0.4, np.pi / 2, 3.1])
def test_angles_of_closed_form(angle):
    corners = flap(angle)
    assert value(corners) == pytest.approx(angle, abs=1e-15, rel=1e-14)
    assert value(corners[[1, 0, 2, 3]]) == pytest.approx(-angle, abs=1e-15, rel=1e-14)
    assert value(corners[[0, 1, 3, 2]]) == pytest.approx(-angle, abs=1e-15, rel=1e-14)
    turn, _ = np.linalg.qr(RNG.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    assert value(3 * corners @ turn.T + 1) == pytest.approx(angle, abs=1e-14)


def test_force_is_minus_the_gradient_and_moves_and_turns_nothing():
    for seed in range(20):
        p = pm.Particles(np.random.default_rng(seed).uniform(-1, 1, (4, 3)))
        system = pm.ParticleSystem(p, [pm.Hinges([(0, 1, 2, 3)], 2.0, rest=0.3)])
        f = system.deriv_eval()[12:].reshape(4, 3)
        size = np.abs(f).max()
        assert np.abs(f.sum(axis=0)).max() < 1e-13 * size
        assert np.abs(np.cross(p.x, f).sum(axis=0)).max() < 1e-13 * size
        step = 1e-6
        for k in range(12):
            there = []
            for way in (step, -step):
                p.x.flat[k] += way
                there.append(system.energy().potential)
                p.x.flat[k] -= way
            assert f.flat[k] == pytest.approx((there[1] - there[0]) / (2 * step), abs=1e-6 * size)


def test_rest_is_measured_at_the_start():
    p = pm.Particles([*flap(0.7), [0, 1, 5]])
    system = pm.ParticleSystem(p, [pm.Hinges([(0, 1, 2, 3)], 2.0)])
    assert np.abs(system.deriv_eval()).max() < 1e-14
    p.x[3] = flap(1.0)[3]
    assert system.energy().potential == pytest.approx(0.09, rel=1e-12)


def test_a_flap_swings_with_its_period():
    """m d^2 theta'' = -k theta, with everything but the free corner held, which flies off only to second order."""
    m, reach, k, angle = 0.2, 1.5, 0.9, 1e-3
    p = pm.Particles(flap(angle, reach), m=m)
    p.pin([0, 1, 2])
    period = 2 * np.pi * reach * np.sqrt(m / k)
    sim = pm.Simulation(
        pm.ParticleSystem(p, [pm.Hinges([(0, 1, 2, 3)], k, rest=0.0)]), "rk4", period / 200, compiled=False
    )
    sim.step(50)
    assert abs(p.x[3, 2]) < 10 * angle**2 * angle * reach + 1e-7 * reach
    sim.step(50)
    assert p.x[3, 2] == pytest.approx(-angle * reach, rel=10 * angle**2)


def test_a_triangle_without_area_bends_nothing():
    for corners in (np.zeros((4, 3)), [*EDGE, [0, 0.5, 0], [1, 0, 0]]):
        system = pm.ParticleSystem(pm.Particles(corners), [pm.Hinges([(0, 1, 2, 3)], rest=0.4)])
        assert np.isfinite(system.deriv_eval()).all()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.Hinges([(0, 1, 2)]), "needs 4 particle ids"),
        (lambda: pm.Hinges([(0, 1, 2, 1)]), "joins particle 1 with itself"),
        (lambda: pm.Hinges([(0, 1, 2, 3)], k_s=-1), "k_s = -1"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says):
        make()
