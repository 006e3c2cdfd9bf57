"""Particles that come from particles: at a death, at a birth, along a trail, whatever the spans and the frames."""

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.solvers import SOLVERS

G = 9.81
NAMES = ("x", "v", "age")


def rocket(**keywords):
    given = {"rate": 3, "speed": pm.Spread(8, 1), "lifetime": pm.Spread(0.5, 0.2), "name": "rocket"}
    return pm.PointEmitter(**{**given, **keywords})


def display(rate=3):
    """Rockets with trails; shells; shells inside shells, each with a flash at its birth."""
    return [
        pm.SphereEmitter(of="shell", on="death", count=pm.Spread(4, 2), speed=2, direction="normal", lifetime=0.2),
        rocket(rate=rate),
        pm.PointEmitter(of="rocket", on="trail", rate="300*t", bursts=[(0.1, 3)], speed=0.3, cone=180, lifetime=0.1),
        pm.PointEmitter(of="rocket", count=pm.Spread(6, 2), cone=180, name="shell", lifetime=pm.Spread(0.1, 0.05)),
        pm.PointEmitter(of="shell", on="birth", count=1.5, speed=0, lifetime=0.05),
    ]


def simulation(emitters, solver="leapfrog", dt=1 / 120, compiled=False, forces=None):
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), forces or [pm.Gravity((0, -G, 0)), pm.Drag(0.002)])
    return pm.Simulation(system, solver, dt, emitters=emitters, seed=7, compiled=compiled)


def end(sim):
    p = sim.system.particles
    return [p.id.copy(), *(getattr(p, name).copy() for name in NAMES)]


def assert_equal(one, two):
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


# --------------------------------------------------------------------------------------------------------------- where


def test_a_child_at_the_death_goes_on_as_its_parent():
    """With the whole velocity of its parent, and none of its own: nine generations on one parabola."""
    chain = [rocket(rate=0, bursts=[(0.1, 1)], speed=9, cone=0, lifetime=0.0731, name="0")]
    chain += [
        pm.PointEmitter(of=str(k), on="death", count=1, speed=0, lifetime=0.0731, name=str(k + 1)) for k in range(9)
    ]
    sim = simulation(chain, dt=1 / 60, forces=[pm.Gravity((0, -G, 0))])
    for _ in range(52):
        sim.step()
        p, t = sim.system.particles, sim.t - 0.1
        if 0 < t < 10 * 0.0731:
            np.testing.assert_allclose(p.x, [[0, 9 * t - G * t * t / 2, 0]], atol=1e-12)
            np.testing.assert_allclose(p.v, [[0, 9 - G * t, 0]], atol=1e-12)
            np.testing.assert_allclose(p.age, math.fmod(t, 0.0731), atol=1e-12)
    assert len(sim.system.particles) == 0


def test_a_trail_lies_on_the_path_of_its_parent():
    flying = rocket(rate=0, bursts=[(0.1, 1)], speed=9, cone=0, lifetime=0.7)
    trail = pm.PointEmitter(of="rocket", on="trail", rate=333, speed=0, inherit=0, start=0.05, stop=0.65, mass=1e9)
    sim = simulation([flying, trail], dt=1 / 60, forces=[pm.Gravity((0, -G, 0))])
    sim.step(54)
    p = sim.system.particles
    k = np.arange(200)
    a = 0.05 + k / 333  # age of the rocket
    fall = sim.t - (0.1 + a)
    assert len(p) == 200
    np.testing.assert_allclose(p.x[:, 1], 9 * a - G * a * a / 2 - G * fall * fall / 2, atol=1e-11)


def test_children_at_a_birth_start_where_their_parent_does():
    emitters = [pm.BoxEmitter(rate=40, speed=2, name="a"), pm.PointEmitter(of="a", on="birth", count=2, speed=0)]
    sim = simulation(emitters, dt=1 / 60, forces=[pm.Gravity((0, -G, 0))])
    sim.step(60)
    p = sim.system.particles
    parents, children = p.x[p.id < 2**62], p.x[p.id >= 2**62]
    order = np.lexsort(children.T)
    assert len(children) == 2 * len(parents)
    np.testing.assert_allclose(children[order], np.repeat(parents, 2, axis=0)[np.lexsort(np.repeat(parents, 2, 0).T)])


def test_in_a_flow_children_lie_on_the_streamline():
    emitters = [
        rocket(rate=0, bursts=[(0.01, 1)], speed=0, lifetime=5),
        pm.PointEmitter(of="rocket", on="trail", rate=50, speed=0),
    ]
    sim = simulation(emitters, "rk4", 1 / 100, forces=[pm.Flow((1, 2, 0))])
    sim.step(100)
    np.testing.assert_allclose(sim.system.particles.x, [[0.99, 1.98, 0]] * 51, atol=1e-12)


# --------------------------------------------------------------------------------------------------------------- bits


@pytest.mark.parametrize("name", ["leapfrog", "rk4", "bdf2", "dopri5"])
def test_any_cut_and_any_frame_rate_give_the_same_bits(name):
    whole = simulation(display(), name)
    whole.step(120)
    assert len(whole.system.particles) > 25
    cut = simulation(display(), name)
    for count in (1, 7, 20, 2, 50, 40):
        cut.step(count)
    assert_equal(end(whole), end(cut))
    for fps in (24, 60, 240):
        seen = simulation(display(), name)
        for _ in seen.frames(fps + 1, fps):
            pass
        assert_equal(end(whole), end(seen))


def test_kernels_give_the_bits_of_the_reference_path_in_any_spans():
    slow = simulation(display(20))
    slow.step(120)
    for spans in ([120], [1, 7, 20, 2, 50, 40]):
        fast = simulation(display(20), compiled=True)
        for count in spans:
            fast.step(count)
        assert_equal(end(slow), end(fast))
    for fps in (24, 240):
        fast = simulation(display(20), compiled=True)
        frames = list(fast.frames(fps + 1, fps))
        assert_equal(end(slow), end(fast))
        assert len(frames[-1].ids) == len(slow.system.particles)
    looks = [list(simulation(display(20), compiled=c).frames(70, fps=77)) for c in (False, True)]  # between steps
    for one, two in zip(*looks, strict=True):
        np.testing.assert_array_equal(one.ids, two.ids)
        np.testing.assert_array_equal(one.positions, two.positions)


def test_where_particles_act_on_each_other():
    def run(counts):
        p = pm.Particles([[3, 0, 0], [4, 0, 0]])
        system = pm.ParticleSystem(p, [pm.Springs([(0, 1)], 10.0), pm.Gravity((0, -G, 0))])
        sim = pm.Simulation(system, "leapfrog", 1 / 120, emitters=display(), seed=7, compiled=False)
        for count in counts:
            sim.step(count)
        return end(sim)

    alone = simulation(display(), forces=[pm.Gravity((0, -G, 0))])
    alone.step(120)
    joined = run([120])
    assert_equal(joined, run([50, 70]))
    others = joined[0] > 1
    assert_equal([column[others] for column in joined], end(alone))


def test_a_look_between_two_steps_sees_children_that_are_born():
    sim = simulation(display(30), dt=1 / 20)
    for frame in sim.frames(60, fps=77):
        assert np.isfinite(frame.positions).all()
        assert len(np.unique(frame.ids)) == len(frame.ids)


# ---------------------------------------------------------------------------------------------------------- the others


def test_ids_are_never_used_again():
    sim, seen = simulation(display(30)), set()
    before = set()
    for _ in range(120):
        sim.step()
        now = set(sim.system.particles.id.tolist())
        assert not (now - before) & seen
        seen |= now
        before = now
    assert len(seen) > 300


def test_a_parent_that_was_taken_away_has_no_children():
    sim = simulation([rocket(rate=0, bursts=[(0, 2)], lifetime=0.5), pm.PointEmitter(of="rocket", count=10)])
    sim.step(30)
    sim.system.remove([0])
    sim.step(60)
    assert len(sim.system.particles) == 10


def test_a_parent_that_goes_astray_is_named():
    @pm.unary_force
    def blow_up(x, v, m, t):
        return pm.exp(40 * t) * x[0], 0.0, 0.0

    emitters = [rocket(rate=0, bursts=[(0, 1)], lifetime=9, cone=90), pm.PointEmitter(of="rocket", on="trail")]
    sim = simulation(emitters, forces=[blow_up()], dt=0.1)
    with pytest.raises(pm.Diverged, match="blow_up"):
        sim.step(100)
    assert np.isfinite(sim.system.get_state()).all()
    assert 0 < sim.steps < 100


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_every_solver_takes_them(name):
    sim = simulation(display(), name, 1 / 30)
    sim.step(40)
    assert len(sim.system.particles) > 20


def test_as_a_scene_file():
    scene = pm.Scene(emitters=display(), forces=[pm.Gravity()])
    again = pm.Scene.from_toml(scene.to_toml())
    assert scene == again
    a, b = (s.simulation() for s in (scene, again))
    for sim in (a, b):
        sim.engine.wanted = False
        sim.step(200)
    assert_equal(end(a), end(b))


@pytest.mark.parametrize(
    ("emitters", "says"),
    [
        (
            lambda: [pm.PointEmitter(of="shel"), rocket(name="shell")],
            "unknown name of an emitter in of: 'shel': did you",
        ),
        (lambda: [pm.PointEmitter(of="a", name="b"), pm.PointEmitter(of="b", name="a")], "goes round in a circle"),
        (lambda: [pm.PointEmitter(of="a", name="a")], "goes round in a circle"),
        (lambda: [rocket(), rocket()], "name = 'rocket' is that of 2 emitters"),
        (lambda: [pm.PointEmitter(of="a", rate=3)], "rate means nothing with on = 'death': give count"),
        (lambda: [pm.PointEmitter(of="a", on="trail", count=3)], "count means nothing with on = 'trail'"),
        (lambda: [pm.PointEmitter(on="trail")], "on means nothing without the name of an emitter in of"),
        (lambda: [pm.PointEmitter(of="a", on="impct")], "unknown value of on: 'impct': did you mean 'impact'"),
        (lambda: [pm.PointEmitter(of="a", on="impact", rate=3)], "rate means nothing with on = 'impact': give count"),
        (lambda: [pm.PointEmitter(of="a", on="birth", above=3)], "above means nothing with on = 'birth': it is for"),
        (lambda: [pm.PointEmitter(of="a", on="impact", above=-1)], "above = -1"),
        (lambda: [pm.PointEmitter(of="a", count=-1)], "count = -1"),
        (lambda: [pm.PointEmitter(of=3)], "of must be the name of an emitter"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(emitters, says):
    with pytest.raises(pm.InvalidInput, match=says):
        simulation(emitters())
