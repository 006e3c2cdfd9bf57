"""Snakes and worms: counts, and how they come on."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.gaits import GAITS
from pointmass.errors import InvalidInput

DT = 1 / 2400


def crawling(body, dt=DT, forces=(), **kwargs):
    system = pm.ParticleSystem(body.particles, [*body.forces, *forces])
    return pm.Simulation(system, dt=dt, compiled=True, **kwargs)


def middle(sim):
    p = sim.system.particles
    return (p.m[:, None] * p.x).sum(axis=0) / p.m.sum()


def velocity(body, periods, frequency, dt=DT):
    """Mean velocity of the middle over whole periods, after two at the start [m/s]."""
    sim = crawling(body, dt, [pm.Gravity()])
    sim.run(2 / frequency)
    begin = middle(sim), sim.t
    sim.run(periods / frequency)
    return (middle(sim) - begin[0]) / (sim.t - begin[1])


@pytest.mark.parametrize("build", [pm.snake, pm.worm])
@pytest.mark.parametrize(("segments", "masses", "springs"), [(3, 16, 60), (10, 44, 186)])
def test_counts(build, segments, masses, springs):
    """W01, with at least three segments: 4 (S + 1) masses and 18 S + 6 springs, all different."""
    body = build(segments)
    pairs = np.concatenate([f.ids for f in body.forces if isinstance(f, pm.Springs)])
    assert len(body.particles) == masses
    assert len(np.unique(np.sort(pairs, axis=1), axis=0)) == len(pairs) == springs
    lengths = np.linalg.norm(body.particles.x[pairs[:, 0]] - body.particles.x[pairs[:, 1]], axis=1)
    cell = (1.2 if build is pm.snake else 0.6) / segments
    assert lengths.max() == pytest.approx(max(math.hypot(cell, 0.05), 0.05 * math.sqrt(2)))


def test_a_ratchet_advances_by_its_stroke():
    """W02: two masses of which neither slides back advance by the whole stroke, 2 A, in a cycle."""
    mass, period, stroke = 0.01, 1.0, 0.2
    c = 100 * mass / period
    particles = pm.Particles([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], m=mass)
    k_s = 1000 * c / period
    muscle = pm.Muscles([(0, 1)], k_s, 2 * math.sqrt(k_s * mass / 2), 1.0, amplitude=stroke)

    class Ratchet(pm.Constraint):
        """Miller's: who would slide back stays where it is."""

        def bind(self, system):
            pass

        def enforce(self, system, step):
            p = system.particles
            back = p.v[:, 0] < 0
            p.x[back], p.v[back] = step.x[back], 0

    system = pm.ParticleSystem(particles, [muscle, pm.Drag(c)])
    sim = pm.Simulation(system, dt=1e-3, constraints=[Ratchet()])
    sim.run(5 * period)
    before = middle(sim)[0]
    sim.run(period)
    assert middle(sim)[0] - before == pytest.approx(2 * stroke, rel=0.01)


@pytest.mark.parametrize("gait", GAITS)
def test_without_friction_or_in_treacle_nobody_comes_on(gait):
    """W03, W04: internal forces move no centre of mass, and neither does viscous friction that is the same for all."""
    for ground in ([], [pm.Drag(0.05)]):
        body = pm.snake(6, gait=gait)
        body.forces[:] = [f for f in body.forces if not isinstance(f, pm.Scales)]
        sim = crawling(body, forces=ground)
        start = middle(sim)
        sim.run(4.0)
        assert np.ptp(sim.system.particles.x - start, axis=0).max() > 0
        np.testing.assert_allclose(middle(sim), start, atol=1e-9)


@pytest.mark.parametrize(("waves", "expected"), [(1, 0.0286), (3, 0.0395), (10, 0.0408)])
def test_a_wave_in_a_viscous_medium_drives_the_other_way(waves, expected):
    """W05: points that move by b sin k(x - V t) across, with twice the drag across, in balance at each instant."""
    points, instants, steepness = 40 * waves + 1, 64, 0.3
    x = np.linspace(0, 1, points)  # of the body, in body lengths
    k = 2 * np.pi * waves
    b = steepness / k
    moved, turned = np.zeros(2), 0.0
    for phase in 2 * np.pi * (np.arange(instants) + 0.5) / instants:
        y, rise = b * np.sin(k * x - phase), -b * k * np.cos(k * x - phase)  # for V = 1
        places = np.stack([x - x.mean(), y, 0 * x], axis=1)
        particles = pm.Particles(places)
        links = np.stack([np.arange(points - 1), np.arange(1, points)], axis=1)
        system = pm.ParticleSystem(particles, [pm.SlenderDrag(links, 1.0, 2.0)])
        motions = np.zeros((4, points, 3))
        motions[0, :, 1] = rise
        motions[1, :, 0] = motions[2, :, 1] = 1.0
        motions[3, :, 0], motions[3, :, 1] = -places[:, 1], places[:, 0]
        balance = []
        for v in motions:
            f = system.deriv_eval(0.0, np.concatenate([places.ravel(), v.ravel()]))[3 * points :].reshape(-1, 3)
            balance.append([f[:, 0].sum(), f[:, 1].sum(), (places[:, 0] * f[:, 1] - places[:, 1] * f[:, 0]).sum()])
        drive, *answers = np.array(balance)
        u = np.linalg.solve(np.array(answers).T, -drive)
        turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
        period = 1 / waves / instants
        moved += turn @ u[:2] * period
        turned += u[2] * period
    assert moved[0] < 0  # the wave runs along +x
    assert np.hypot(*moved) * waves == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("gait", "frequency", "along", "across"),
    [
        ("serpentine", 1.0, 0.25, 0),
        ("rectilinear", 1.0, 0.08, 0),
        ("sidewinding", 1.0, 0, 0.2),
        ("concertina", 0.6, 0.08, 0),
    ],
)
def test_each_gait_goes_its_way(gait, frequency, along, across):
    """Its direction; and its speed is that of steps four times as fine, within 15 %."""
    found = velocity(pm.snake(gait=gait), 4, frequency)
    fine = velocity(pm.snake(gait=gait), 4, frequency, DT / 4)
    assert np.hypot(*found[[0, 2]]) == pytest.approx(np.hypot(*fine[[0, 2]]), rel=0.15)
    if along:
        assert found[0] > along
        assert abs(found[2]) < 0.5 * found[0]
    else:
        assert abs(found[2]) > max(across, 2 * abs(found[0]))


def test_a_worm_crawls_and_scales_turned_round_take_it_back():
    one = velocity(pm.worm(), 4, 0.8)
    other = velocity(pm.worm(forward=0.5, backward=0.1), 4, 0.8)
    assert one[0] > 0.04
    assert other[0] < -0.02


def test_friction_that_is_alike_in_all_directions_gives_a_snake_little_way():
    found = velocity(pm.snake(forward=0.3, backward=0.3, sideways=0.3), 4, 1.0)
    assert abs(found[0]) < 0.25 * velocity(pm.snake(), 4, 1.0)[0]


@pytest.mark.parametrize(("arguments", "problem"), [
    ({"segments": 0}, "segments"),
    ({"gait": "gallop"}, "gait"),
    ({"amplitude": 0.7}, "amplitude = 0.7 is not allowed"),
    ({"segments": 6, "waves": 4.0}, "waves = 4 is not allowed: 6 segments have at most 3"),
    ({"mass": 0.0}, "mass"),
])  # fmt: skip
def test_impossible_snakes_are_refused(arguments, problem):
    with pytest.raises(InvalidInput, match=problem):
        pm.snake(**arguments)


def test_the_skin_is_a_closed_tube_around_the_body():
    body = pm.snake(8)
    skin = body.particles.surfaces["snake"].skin
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1, atol=1e-12)
    corners = skin.corners(body.particles.x[skin.nodes]).astype(np.float64)
    a, b, c = corners[skin.faces].transpose(1, 0, 2)
    volume = float((a * np.cross(b, c)).sum() / 6)
    full = math.pi * 0.05**2 / 2 * 1.2
    assert 0.5 * full < volume < full  # outwards, and thinner at both ends
    assert corners[:, 0].max() == pytest.approx(0.6 + 0.7 * 0.15)  # the head is beyond the first ring
    assert np.abs(np.hypot(corners[:, 1] - 0.025, corners[:, 2])).max() <= 0.025 * math.sqrt(2) * 1.01


def test_the_box_around_the_masses_is_closed_and_faces_outwards():
    body = pm.snake(8)
    a, b, c = body.particles.x[body.triangles].transpose(1, 0, 2)
    assert float((a * np.cross(b, c)).sum() / 6) == pytest.approx(0.05**2 * 1.2)
