"""Where particles die, and what happens when there are too many."""

import numpy as np
import pytest

import pointmass as pm


def simulation(emitters=(), n=0, compiled=False, **keywords):
    rng = np.random.default_rng(0)
    p = pm.Particles(rng.uniform(-2, 2, (n, 3)), rng.normal(size=(n, 3)))
    return pm.Simulation(pm.ParticleSystem(p), "leapfrog", 0.05, emitters=emitters, compiled=compiled, **keywords)


@pytest.mark.parametrize(
    ("zone", "inside"),
    [
        (pm.SphereZone((1, 0, 0), 0.8), lambda x, t: np.linalg.norm(x - [1, 0, 0], axis=1) < 0.8),
        (pm.SphereZone(radius=2, outside=True), lambda x, t: np.linalg.norm(x, axis=1) > 2),
        (pm.BoxZone(size=(1, 2, 3)), lambda x, t: (np.abs(x) < [0.5, 1, 1.5]).all(axis=1)),
        (pm.BoxZone(("t", 0, 0), (4, 4, 4), outside=True), lambda x, t: (np.abs(x - [t, 0, 0]) > 2).any(axis=1)),
        (pm.HalfSpaceZone((0, "t - 1", 0), (0, 2, 0)), lambda x, t: x[:, 1] < t - 1),
    ],
)
def test_who_enters_a_zone_dies_at_the_end_of_the_step(zone, inside):
    free, zoned = simulation(n=200), simulation(n=200, zones=[zone])
    alive = np.ones(200, bool)
    for _ in range(30):
        free.step()
        zoned.step()
        alive &= ~inside(free.system.particles.x, free.t)
        p = zoned.system.particles
        np.testing.assert_array_equal(p.id, np.flatnonzero(alive))
        np.testing.assert_array_equal(p.x, free.system.particles.x[alive])
    assert 0 < alive.sum() < 200


def fountain(**keywords):
    emitters = [
        pm.PointEmitter(rate=100, lifetime=1, name="a"),
        pm.PointEmitter(of="a", on="trail", rate=5, lifetime=1),
    ]
    return simulation(emitters, n=3, **keywords)


def ids(sim):
    return set(sim.system.particles.id.tolist())


def test_nobody_is_born_when_it_is_full():
    free, full = fountain(), fountain(max_particles=60)
    seen = set()
    for _ in range(100):
        free.step()
        full.step()
        seen |= ids(free)
        assert len(ids(full)) <= 60
        assert ids(full) <= seen  # children of the unborn are not born either
        assert {0, 1, 2} <= ids(full)
    assert len(ids(full)) > 50


def test_the_oldest_dies_when_it_is_full():
    full = simulation([pm.PointEmitter(rate=99)], n=3, max_particles=60, when_full="oldest dies")
    for _ in range(40):
        full.step()
        p = full.system.particles
        born = np.ceil(99 * full.t)
        assert len(p) == min(60, 3 + born)
        assert {0, 1, 2} <= ids(full)
        np.testing.assert_allclose(p.age[3:], full.t - np.arange(born)[3 - len(p) :] / 99, atol=1e-12)


@pytest.mark.parametrize("when_full", ["no birth", "oldest dies"])
def test_the_bits_do_not_depend_on_frames(when_full):
    ends = []
    for fps in (7, 20, 60):
        sim = fountain(max_particles=60, when_full=when_full, zones=[pm.HalfSpaceZone((0, -1, 0))])
        for _ in sim.frames(2 * fps + 1, fps):
            pass
        ends.append(sim.system.particles)
    for p in ends:
        np.testing.assert_array_equal(p.id, ends[0].id)
        np.testing.assert_array_equal(p.x, ends[0].x)


def test_in_a_scene_file_and_back():
    scene = pm.Scene(
        emitters=[pm.PointEmitter()],
        zones=[pm.SphereZone(radius=3, outside=True), pm.HalfSpaceZone((0, "sin(t)", 0))],
        max_particles=40,
        when_full="oldest dies",
    )
    assert pm.Scene.from_toml(scene.to_toml()) == scene
    sim = scene.simulation()
    assert (sim.max_particles, sim.when_full, len(sim.zones)) == (40, "oldest dies", 2)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.SphereZone(radius=-1), "radius = -1"),
        (lambda: pm.BoxZone(size=(1, 0, 1)), "size = "),
        (lambda: pm.HalfSpaceZone(normal=(0, 0, 0)), "normal = "),
        (lambda: pm.SphereZone(("x", 0, 0)), "center may depend on t"),
        (lambda: simulation(max_particles=0), "max_particles = 0"),
        (lambda: simulation(when_full="explode"), "unknown value of when_full: 'explode'"),
        (lambda: simulation(zones=[pm.Sphere()]), "zones must be zones"),
        (lambda: pm.Scene(emitters=[pm.PointEmitter()], when_full="x"), "unknown value of when_full"),
        (lambda: pm.Scene(emitters=[pm.PointEmitter()], max_particles=1.5), r"max_particles = 1\.5"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says):
        make()
