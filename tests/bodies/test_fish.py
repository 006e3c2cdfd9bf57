"""The artificial fish: its graph, its skin, its rest, and how it swims."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.fish import FACES, GRAPH, MASSES, NODES, RINGS, SHARE, WET
from pointmass.controllers.swimmers import SEGMENTS, SIDES, SWIMS, TURNS
from pointmass.errors import InvalidInput
from pointmass.skin import subdivided

DT = 1 / 960
MIRROR = np.concatenate([[0], RINGS[:, [1, 0, 3, 2]].ravel(), [21, 22]])  # the node on the other side
FLIPPED = np.concatenate([[0], RINGS[:, [3, 2, 1, 0]].ravel(), [22, 21]])  # and that above or below


def simulation(count=1, **arguments):
    body = pm.fish(count, [(0.0, 0.0, 1.0 * k) for k in range(count)], detail=0, **arguments)
    system = pm.ParticleSystem(body.particles, body.forces)
    return pm.Simulation(system, dt=DT)


def put(sim, beat, turn, frequency=2.0):
    muscles = next(f for f in sim.system.forces if isinstance(f, pm.Muscles))
    count = len(muscles.ids) // 12
    muscles.put(
        offset=np.tile(-turn * SIDES * TURNS, count),
        amplitude=np.tile(beat * SIDES * SWIMS, count),
        frequency=np.full(12 * count, frequency),
        phase=np.tile(-0.5 * np.pi * SEGMENTS, count),
    )


def middle(x):
    return (MASSES[:, None] * x.reshape(-1, NODES, 3)).sum(axis=1) / MASSES.sum()


def test_the_graph_has_the_published_counts():
    assert {family: len(ends) for family, ends in GRAPH.items()} == {"cross": 46, "muscles": 12, "other": 33}
    ends = np.sort(np.concatenate(list(GRAPH.values())), axis=1)
    assert len(np.unique(ends, axis=0)) == 91
    assert np.array_equal(np.unique(ends), np.arange(NODES))
    body = pm.fish(3, [(0, 0, 0), (0, 1, 0), (0, 2, 0)])
    assert len(body.particles) == 3 * NODES
    assert [len(f.ids) for f in body.forces] == [3 * 46, 3 * 12, 3 * 33, 3 * 78, 3]
    k = [f.parameters["k_s"].components[0].value for f in body.forces[:3]]
    np.testing.assert_allclose(np.array(k) / k[0], np.array([38, 28, 30]) / 38)
    np.testing.assert_allclose(body.particles.m[:NODES] / body.particles.m[0], MASSES / 1.1)


def test_a_fish_is_closed_and_as_heavy_as_the_water_in_it():
    edges = np.concatenate([FACES[:, [0, 1]], FACES[:, [1, 2]], FACES[:, [2, 0]]])
    assert {tuple(e) for e in edges} == {(b, a) for a, b in edges}
    assert len(np.unique(edges, axis=0)) == len(edges)
    wet = {tuple(sorted(f)) for f in WET.tolist()}
    assert {tuple(sorted(MIRROR[f])) for f in WET} == wet == {tuple(sorted(FLIPPED[f])) for f in WET}
    assert SHARE.sum() == len(FACES)
    assert NODES - len(edges) // 2 + len(FACES) == 2  # Euler: no holes
    body = pm.fish(length=0.4, density=900.0)
    a, b, c = np.moveaxis(body.particles.x[body.triangles], 1, 0)
    volume = (a * np.cross(b, c)).sum() / 6
    assert volume > 0  # normals look outwards
    assert body.particles.m.sum() == pytest.approx(900.0 * volume, rel=1e-12)
    assert np.ptp(body.particles.x[:, 0]) == pytest.approx(0.4)


def test_heads_look_where_they_should_and_are_upright():
    headings = [(0, 0, 1), (1, 0.5, -1)]
    x = pm.fish(2, [(0, 0, 0), (3, 0, 0)], headings).particles.x.reshape(2, NODES, 3)
    ahead = x[:, 0] - 0.5 * (x[:, 21] + x[:, 22])
    np.testing.assert_allclose(ahead / 0.3, headings / np.linalg.norm(headings, axis=1)[:, None], atol=1e-12)
    up = x[:, 5] - x[:, 8]
    assert (up[:, 1] > 0).all()
    assert ((np.cross(ahead, up) * (x[:, 6] - x[:, 5])).sum(axis=1) > 0).all()  # node 6 is on the right


def test_a_fish_that_does_nothing_stays_where_it_is():
    sim = simulation(upright=0.0)
    start = sim.system.particles.x.copy()
    sim.run(10.0)
    np.testing.assert_allclose(sim.system.particles.x, start, atol=1e-12)


def test_a_fish_that_is_bent_comes_to_rest():
    sim = simulation(upright=0.0)
    p = sim.system.particles
    p.x = p.x + 0.1 * p.x[:, :1] ** 2 * np.array([0.0, 0.3, 1.0]) / 0.15
    energies = [sim.quantities()["energy"]]
    for _ in range(20):
        sim.run(0.25)
        energies.append(sim.quantities()["energy"])
    assert (np.diff(energies) < 0).all()
    assert energies[-1] < 1e-3 * energies[0]


def test_it_swims_straight():
    sim = simulation()
    for k in range(20):  # the beat begins gently: a sudden one would push the fish aside
        put(sim, 0.01 * (k + 1), 0.0)
        sim.run(0.05)
    begin = middle(sim.system.particles.x)[0]
    sim.run(5.0)
    way = middle(sim.system.particles.x)[0] - begin
    assert way[0] / 0.3 > 2.0  # lengths in ten beats
    assert np.hypot(way[1], way[2]) < 0.02 * way[0]


def test_a_right_turn_is_a_left_turn_in_a_mirror():
    left, right = simulation(), simulation()
    put(left, 0.2, 0.2)
    put(right, -0.2, -0.2)
    for sim in (left, right):
        sim.run(2.0)
    x, y = left.system.particles.x, right.system.particles.x[MIRROR] * (1, 1, -1)
    np.testing.assert_allclose(x, y, atol=1e-9)
    axis = x[0] - x[13:17].mean(axis=0)
    assert np.degrees(np.arctan2(-axis[2], axis[0])) > 30.0  # to the left, seen from above


def test_many_fish_do_what_each_does_alone():
    alone, many = simulation(), simulation(9)
    for sim in (alone, many):
        put(sim, 0.2, 0.1)
        sim.run(0.5)
    x = many.system.particles.x.reshape(9, NODES, 3)
    np.testing.assert_allclose(x[0], alone.system.particles.x, atol=1e-12)
    shifted = x - np.arange(9.0)[:, None, None] * (0.0, 0.0, 1.0)
    np.testing.assert_allclose(shifted, np.broadcast_to(shifted[:1], shifted.shape), atol=1e-9)
    assert np.ptp(alone.system.particles.x[:, 2]) > 0.05


def test_a_skin_is_smooth_and_goes_with_its_fish():
    weights, faces = subdivided(np.eye(NODES), FACES)
    assert len(faces) == 4 * len(FACES)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert (weights >= 0).all()
    particles = pm.fish(2, [(0, 0, 0), (0, 0, 1)], detail=2).particles
    skin = particles.surfaces["fish"].skin
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0, atol=1e-12)
    corners = skin.corners(particles.x[particles.rows(skin.nodes)])
    assert len(corners) == 2 * len(skin.weights)
    assert skin.all_faces().max() == len(corners) - 1
    np.testing.assert_allclose(
        corners[: len(skin.weights)] + np.float32((0, 0, 1)), corners[len(skin.weights) :], atol=1e-6
    )
    particles.remove([3])
    assert len(particles.surfaces["fish"].skin.nodes) == 1
    frame = pm.Simulation(pm.ParticleSystem(particles, []), look=pm.Look()).frame()
    assert [d.name for d in frame.drawables[:2]] == ["fish", "fish eyes"]


def test_what_a_fish_cannot_be():
    for arguments, message in [
        ({"count": 0}, "count = 0 is not allowed"),
        ({"count": 2, "places": [(0, 0, 0)] * 3}, "places has 3 points for 2 fish"),
        ({"headings": (0, 1, 0)}, "not straight up or down"),
        ({"length": -1.0}, "length = -1"),
        ({"detail": 9}, "detail = 9 is not allowed: it must be at most 3"),
    ]:
        with pytest.raises(InvalidInput, match=message):
            pm.fish(**arguments)
