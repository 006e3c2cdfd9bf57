"""Strands against closed forms: pendulum, hanging chain, cantilever, torsion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ellipk, roots_laguerre

import pointmass as pm

G = 9.81


@pytest.mark.parametrize(("degrees", "factor"), [(10, 1.001907), (90, 1.180341), (120, 1.372881)])
def test_pendulum_period_with_amplitude(degrees: float, factor: float) -> None:
    """T = 2 pi sqrt(L/g) (2/pi) K(sin^2(theta/2)).

    The link hangs 1e-4 longer than it is, and at most 3 times that at speed: half of it is in T. Leapfrog's error of
    the period is (w h)^2 / 24 = 4e-7, that of the straight line through the crossing less.
    """
    angle = math.radians(degrees)
    body = pm.chain(1, 1.0, direction=(math.sin(angle), -math.cos(angle), 0), k_s=1e4 * G, damping_ratio=0.05)
    system = pm.ParticleSystem(body.particles, [pm.Gravity(), *body.forces])
    sim = pm.Simulation(system, "leapfrog", 1e-3, compiled=False)
    x = [float(system.particles.x[1, 0])]
    while x[-1] > 0:
        sim.step()
        x.append(float(system.particles.x[1, 0]))
    quarter = (sim.steps - 1 + x[-2] / (x[-2] - x[-1])) * sim.dt
    assert 2 / math.pi * ellipk(math.sin(angle / 2) ** 2) == pytest.approx(factor, rel=1e-6)
    assert 4 * quarter == pytest.approx(2 * math.pi / math.sqrt(G) * factor, rel=5e-4)


@pytest.mark.parametrize("n", [2, 5])
def test_frequencies_of_a_hanging_chain(n: int) -> None:
    """w^2 = g/l times the roots of the Laguerre polynomial L_n, of small swings to the side.

    Links of k_s = 1e6 m g / l are longer by n 1e-6 at most.
    """
    link = 0.3
    k_s = 1e6 * G / link
    body = pm.chain(n, n * link, direction=(0, -1, 0), mass=float(n), k_s=k_s, damping_ratio=0.0)
    p = body.particles
    p.x[1:, 1] -= np.cumsum(np.arange(n, 0, -1) * G / k_s)  # it hangs
    system = pm.ParticleSystem(p, [pm.Gravity(), *body.forces])
    assert np.abs(system.deriv_eval()[system.dim // 2 :]).max() < 1e-8
    pull = system.jacobian(0.0, system.get_state()).toarray()[3 * (n + 1) :, : 3 * (n + 1)]
    squares = np.sort(np.linalg.eigvals(-pull[3::3, 3::3]).real)
    np.testing.assert_allclose(squares * link / G, np.sort(roots_laguerre(n)[0]), rtol=1e-5)


def sag(links: int, bend: float) -> float:
    """How far the tip of a clamped straight strand of 0.2 m sinks, by implicit steps until it is at rest."""
    x = np.stack([0.2 / links * (np.arange(links + 2) - 1.0), np.zeros(links + 2), np.zeros(links + 2)], axis=1)
    body = pm.hair(curves=x[None], bend=bend, stretch=10.0)
    system = pm.ParticleSystem(body.particles, [pm.Gravity(), *body.forces])
    pm.Simulation(system, pm.ImplicitEuler(), 0.1, compiled=False).step(40)
    assert np.abs(system.particles.v).max() < 1e-9
    return -float(system.particles.x[-1, 1])


LINE = 1300 * math.pi * 4e-5**2  # kg/m


@pytest.mark.parametrize("links", [10, 20])
def test_H03_sag_of_a_cantilever(links: int) -> None:
    """m g l^2 / k_b N (N + 1)(N + 2)(3 N + 1) / 24: the moments of the weights at each joint.

    At a sag of 0.8% the shortening of the arms is of the order (sag/S)^2.
    """
    bend = 1e2 / 8 * LINE * G * 0.2**3
    link = 0.2 / links
    k_b = bend / link
    wanted = LINE * link * G * link**2 / k_b * links * (links + 1) * (links + 2) * (3 * links + 1) / 24
    assert sag(links, bend) == pytest.approx(wanted, rel=1e-3)
    assert wanted / 0.2 < 0.015


def test_bend_does_not_depend_on_the_number_of_points() -> None:
    """The sum tends to w S^4 / (8 EI), with an error of (10/3)/N; two of them extrapolate it."""
    bend = 1e2 / 8 * LINE * G * 0.2**3
    coarse, fine = sag(10, bend), sag(20, bend)
    error = [10 / (3 * n) for n in (10, 20)]
    limit = (fine * error[0] - coarse * error[1]) / (error[0] - error[1])
    assert limit == pytest.approx(LINE * G * 0.2**4 / (8 * bend), rel=0.03)  # what is left is (10/3N)^2 / 4


def bent(torsion: float, bend: float = 0.9, link: float = 0.01) -> np.ndarray:
    """A strand of four points, shape (1, 4, 3)."""
    c, s = math.cos(bend), math.sin(bend)
    edges = [[c, -s, 0], [1, 0, 0], [c, s * math.cos(torsion), s * math.sin(torsion)]]
    return link * np.cumsum([[0, 0, 0], *edges], axis=0)[None]


@pytest.mark.parametrize("torsion", [-0.6, 0.0, 0.5])
def test_torsional_stiffness(torsion: float) -> None:
    """E = GJ / (2 l) (psi - psi_0)^2: the second derivative, by differences of the energy of the volumes."""
    twist, link, h = 3e-9, 0.01, 1e-3
    body = pm.hair(curves=bent(torsion), twist=twist)
    volumes = body.forces[-1]
    assert isinstance(volumes, pm.Volumes)
    volumes.bind(body.particles)
    energies = [volumes.energy(body.particles, 0.0, bent(torsion + d)[0], body.particles.v) for d in (-h, 0.0, h)]
    second = (energies[0] - 2 * energies[1] + energies[2]) / h**2
    assert energies[1] == pytest.approx(0.0, abs=1e-30)
    assert second == pytest.approx(twist / link, rel=2e-3)  # the next term is of the order h^2 / cos^2


@pytest.mark.parametrize("held", [True, False])
def test_a_hanging_curl_keeps_its_turns_and_its_hand_by_its_volumes(held: bool) -> None:
    """At rest after 2 s in air. Bends alone let it hang as a flat zigzag.

    Weight against stiffness is w S^3 / EI = 11 for 0.1 m of hair: about 1% off, as a helix is a soft spring along its
    axis with bends of 50 degrees that are hardly changed.
    """
    for turns in (16.0, -16.0):
        body = pm.hair(1, 12, 0.1, style="curly", curl_turns=turns, jitter=0.0, cap=1.0, crown=(0, -1, 0))
        volumes = next(f for f in body.forces if isinstance(f, pm.Volumes))
        volumes.enabled = held
        system = pm.ParticleSystem(body.particles, [pm.Gravity(), pm.Drag(2e-6), *body.forces])
        before = volumes.values(system.particles, system.particles.x)
        pm.Simulation(system, "symplectic_euler", 1 / 4000, compiled=True).run(2.0)
        after = volumes.values(system.particles, system.particles.x)
        assert (np.sign(before) == np.sign(turns)).all()
        if held:
            np.testing.assert_allclose(after, before, rtol=0.03)
            assert system.stretch() < 0.02
        else:
            assert (after[1:] / before[1:] < 0.01).all()
