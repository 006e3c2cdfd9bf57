"""Children where particles hit surfaces, and of those who are taken away early: by a surface or in a zone."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.solvers import SOLVERS

G = 9.81
both = pytest.mark.parametrize("compiled", [False, True])


def drops(heights=(1.0,), speed=0.0, **keywords):
    """Balls that fall from heights, all at once, beside each other."""
    given = {"lifetime": 10.0, "speed": speed, "direction": (0, -1, 0), "cone": 0, "rate": 0, "bursts": [(0, 1)]}
    given |= keywords
    return [pm.PointEmitter((k, y, 0), name=f"drop {k}", **given) for k, y in enumerate(heights)]


def splash(of="drop 0", **keywords):
    given = {"on": "impact", "count": 1, "cone": 0, "speed": 2.0, "inherit": 0.0, "direction": "normal"}
    return pm.PointEmitter(of=of, **(given | keywords))


def simulation(emitters, colliders, solver="leapfrog", dt=1 / 60, compiled=False, forces=None, **keywords):
    forces = [pm.Gravity()] if forces is None else forces
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), forces, colliders)
    return pm.Simulation(system, solver, dt, emitters=emitters, seed=3, compiled=compiled, **keywords)


def children(sim):
    p = sim.system.particles
    return p.id >= 2**62


def state(sim):
    p = sim.system.particles
    return [p.id.copy(), p.x.copy(), p.v.copy(), p.age.copy()]


def assert_equal(one, two):
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


# ------------------------------------------------------------------------------------------------------ when and where


@both
@pytest.mark.usefixtures("plain")
def test_a_splash_starts_at_the_time_and_place_of_the_impact(compiled):
    sim = simulation([*drops(), splash(speed=3.0)], [pm.Plane(restitution=0)], compiled=compiled)
    hit = np.sqrt(2 / G)
    sim.step(int(hit * 60))
    assert len(sim.system.particles) == 1
    for _ in range(20):
        sim.step()
        p, late = sim.system.particles, sim.t - hit
        born = children(sim)
        np.testing.assert_allclose(p.x[born], [[0, 3 * late - G * late**2 / 2, 0]], atol=1e-12)
        np.testing.assert_allclose(p.v[born], [[0, 3 - G * late, 0]], atol=1e-12)
        np.testing.assert_allclose(p.age[born], late, atol=1e-12)


def test_several_impacts_within_one_step():
    """A ball between two walls that hits one or the other every 0.1 s, with steps of 0.25 s."""
    walls = [pm.Plane(restitution=1), pm.Plane((0, 1, 0), (0, -1, 0), restitution=1)]
    ball = drops([0.5], speed=10.0)
    sim = simulation([*ball, splash(speed=0.0, count=1)], walls, dt=0.25, forces=[])
    sim.step(8)
    p, born = sim.system.particles, children(sim)
    times = 0.05 + 0.1 * np.arange(20)
    np.testing.assert_allclose(np.sort(sim.t - p.age[born]), times, atol=1e-9)
    np.testing.assert_allclose(p.x[born][np.argsort(-p.age[born]), 1], [0, 1] * 10, atol=1e-9)


def test_they_go_along_the_normal_of_what_was_hit_and_inherit_what_the_parent_has_then():
    normal = np.array([0.6, 0.8, 0])
    slope = pm.Plane(normal=normal, restitution=0.5, friction=0.1)
    sim = simulation([*drops(speed=4.0), splash(inherit=1.0, speed=2.0)], [slope], forces=[], dt=0.1)
    sim.step(4)
    v = np.array([0, -4.0, 0])
    v_n = (v @ normal) * normal
    v_t = v - v_n
    after = v_t * (1 - 0.1 * 1.5 * np.linalg.norm(v_n) / np.linalg.norm(v_t)) - 0.5 * v_n
    p, born = sim.system.particles, children(sim)
    np.testing.assert_allclose(p.v[~born], [after], atol=1e-12)
    np.testing.assert_allclose(p.v[born], [after + 2 * normal], atol=1e-12)
    np.testing.assert_allclose(p.x[born], [(0.4 - 0.25) * (after + 2 * normal)], atol=1e-9)


def test_only_fast_impacts_count_relative_to_the_surface():
    """A ball that keeps half of its speed at each bounce, on a floor that comes up at 1 m/s."""

    def count(above):
        floor = pm.Plane((0, "t", 0), restitution=0.5)
        sim = simulation([*drops(speed=3.0), splash(above=above, speed=5.0)], [floor], dt=0.02)
        sim.step(70)
        return children(sim).sum()

    t = (-4 + np.sqrt(16 + 2 * G)) / G
    first = 4 + G * t
    for k in range(4):
        assert count(0.99 * first / 2**k) == k + 1
        assert count(1.01 * first / 2**k) == k


def test_how_many_is_drawn_for_each_impact():
    floor = pm.Plane(restitution=1.0)
    ball = [pm.BoxEmitter((0, 1, 0), name="a", rate=0, bursts=[(0, 400)], speed=0, lifetime=9, sides=(9, 0, 9))]
    sim = simulation([*ball, splash("a", count=pm.Spread(3, 2), lifetime=0.01)], [floor], dt=1 / 50)
    counts = []
    for _ in range(110):
        sim.step()
        counts.append(children(sim).sum())
    bounces = np.array(counts)[np.array(counts) > 0]
    assert len(bounces) == 2
    np.testing.assert_allclose(bounces, 1200, atol=4 * np.sqrt(400 * 1.5))
    assert bounces[0] != bounces[1]


# --------------------------------------------------------------------------------------------------------------- bits


def rain(compiled=False, solver="leapfrog", contact="swept", rate=150, response="bounce", dt=1 / 50, dtype=None):
    """Rain on a ball that moves and on a floor; splashes of splashes, and a trail."""
    emitters = [
        splash("splash", count=pm.Spread(2, 1), speed=pm.Spread(1, 0.5), cone=50, lifetime=0.2, above=1.0),
        pm.BoxEmitter(
            (0, 1.5, 0), name="rain", sides=(2, 0, 2), rate=rate, speed=3, cone=5, direction=(0, -1, 0), lifetime=1.0
        ),
        splash("rain", name="splash", count=3, speed=pm.Spread(2, 0.5), cone=60, lifetime=0.5, inherit=0.3, above=0.5),
        pm.PointEmitter(of="splash", on="trail", rate=10, speed=0, lifetime=0.1),
    ]
    ball = pm.Sphere(("0.3*sin(5*t)", 0.5, 0), radius=0.3, restitution=0.6, friction=0.2)
    floor = pm.Plane(restitution=0.2, friction=0.5, contact=contact, response=response)
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity(), pm.Drag(0.002)], [ball, floor])
    return pm.Simulation(system, solver, dt, emitters=emitters, seed=3, compiled=compiled)


@pytest.mark.parametrize("contact", ["swept", "discrete"])
@pytest.mark.usefixtures("plain")
def test_both_paths_give_the_same_bits_in_any_spans_and_at_any_frame_rate(contact):
    n = 30
    slow = rain(contact=contact, rate=60)
    slow.step(n)
    assert children(slow).sum() > 30
    for counts in ([n], [1, 7, 12, 2, 8]):
        fast = rain(True, contact=contact, rate=60)
        for count in counts:
            fast.step(count)
        assert_equal(state(slow), state(fast))
    for fps in (24, 60):
        for compiled in (False, True):
            seen = rain(compiled, contact=contact, rate=60)
            frames = list(seen.frames(int(0.6 * fps) + 1, fps))
            assert np.isfinite(frames[-1].positions).all()
            seen.step(n - seen.steps)
            assert_equal(state(slow), state(seen))


def test_compiled_kernels_give_the_bits_of_the_reference_path_at_any_frame_rate():
    """At 24, 60 and 240 frames a second, with splashes of splashes: the same at all common times, every 12th of one."""
    slow = rain(dt=1 / 120)
    common = []
    for _ in range(12):
        slow.step(10)
        common.append(state(slow))
    assert children(slow).sum() > 300
    for fps in (24, 60, 240):
        fast = rain(True, dt=1 / 120)
        looks = list(fast.frames(fps + 1, fps))[:: fps // 12]
        assert_equal(common[-1], state(fast))
        for look, (ids, x, v, _) in zip(looks[1:], common, strict=True):
            assert_equal([look.ids, look.positions, look.velocities], [ids, x, v])


@pytest.mark.parametrize("name", sorted(SOLVERS))
@pytest.mark.usefixtures("plain")
def test_every_solver_takes_them(name):
    ends = []
    for compiled in (False, True):
        sim = rain(compiled, name, rate=20)
        sim.step(25)
        ends.append(state(sim))
    assert (ends[0][0] >= 2**62).sum() > 5
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_allclose(ends[0][1], ends[1][1], atol=1e-9)


@both
@pytest.mark.usefixtures("plain")
def test_beside_particles_that_act_on_each_other(compiled):
    """Three drops beside two balls on a spring; one hits the floor in the step of its birth."""
    heights = np.array([1.5, 1.0, 0.03])
    emitters = [*drops(heights, speed=3), *(splash(f"drop {k}") for k in range(3))]
    p = pm.Particles([[5, 3, 0], [6, 3, 0]])
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)], 10.0)], [pm.Plane(restitution=0)])
    sim = pm.Simulation(system, "leapfrog", 1 / 60, emitters=emitters, compiled=compiled)
    for steps in (10, 12):
        sim.step(steps)
        late = sim.t - (np.sqrt(9 + 2 * G * heights) - 3) / G
        y = (2 * late - G * late**2 / 2)[late > 0]
        np.testing.assert_allclose(np.sort(p.x[children(sim)][:, 1]), np.sort(y), atol=1e-9)


@both
@pytest.mark.usefixtures("plain")
def test_of_particles_that_act_on_each_other(compiled):
    """Two balls of which each is the other's neighbour by law; what it does is nothing, so they fall freely."""
    emitters = [*drops([1.0, 0.6]), splash(), splash("drop 1")]
    forces = [pm.Gravity(), pm.SoftSphere(k_s=0.0)]
    sim = simulation(emitters, [pm.Plane(restitution=0)], compiled=compiled, forces=forces)
    sim.step(32)
    late = sim.t - np.sqrt(2 * np.array([1.0, 0.6]) / G)
    p, born = sim.system.particles, children(sim)
    assert born.sum() == 2
    np.testing.assert_allclose(np.sort(p.age[born]), late, atol=1e-4)
    # the newborn have come along a straight line from where their step began, and felt its whole pull
    np.testing.assert_allclose(
        np.sort(p.x[born][:, 1]), np.sort(2 * late - G * late**2 / 2), atol=G / 60 * late.max() + G / 60**2
    )


@both
@pytest.mark.usefixtures("plain")
def test_in_a_flow(compiled):
    emitters = [*drops([1.0], speed=0), splash("drop 0", speed=0)]
    sim = simulation(emitters, [pm.Plane()], "rk4", 0.09, compiled, [pm.Flow((0, -2, 0))])
    sim.step(7)
    born = children(sim)
    np.testing.assert_allclose(sim.system.particles.age[born], [0.13], atol=1e-9)
    np.testing.assert_allclose(sim.system.particles.x[born][:, 1], 0, atol=1e-3)


# ------------------------------------------------------------------------------------------------- taken away early


@both
@pytest.mark.parametrize("on", ["death", "impact"])
@pytest.mark.usefixtures("plain")
def test_whom_a_surface_kills_has_children(compiled, on):
    """At its death, the end of the step, where it hit; or at the impact itself."""
    sim = simulation(
        [*drops(), pm.PointEmitter(of="drop 0", on=on, count=5, cone=0, speed=3, inherit=0)],
        [pm.Plane(response="kill")],
        compiled=compiled,
    )
    hit = np.sqrt(2 / G)
    sim.step(40)
    born = np.ceil(hit * 60) / 60 if on == "death" else hit
    late = sim.t - born
    p = sim.system.particles
    assert len(p) == 5
    np.testing.assert_allclose(p.x, [[0, 3 * late - G * late**2 / 2, 0]] * 5, atol=1e-9)
    np.testing.assert_allclose(p.age, late, atol=1e-9)


@both
@pytest.mark.usefixtures("plain")
def test_who_dies_in_a_zone_has_children(compiled):
    """Where it is at the end of that step, with its velocity; they have a step to leave the zone."""
    emitters = [*drops([1.0]), pm.PointEmitter(of="drop 0", count=5, cone=0, speed=9.0, inherit=0.5)]
    sim = simulation(emitters, [], compiled=compiled, zones=[pm.HalfSpaceZone((0, 0.5, 0))])
    dead = np.ceil(np.sqrt(1 / G) * 60) / 60
    sim.step(30)
    late, p = sim.t - dead, sim.system.particles
    assert len(p) == 5
    v = 9 - 0.5 * G * dead
    np.testing.assert_allclose(p.x[:, 1], 1 - G * dead**2 / 2 + v * late - G * late**2 / 2, atol=1e-12)
    sim.step(90)
    assert len(sim.system.particles) == 0  # they fell into it again


@both
@pytest.mark.usefixtures("plain")
def test_who_stays_in_a_zone_dies_with_all_its_generations(compiled):
    chain = [pm.PointEmitter(of=str(k), count=2, cone=0, speed=0, name=str(k + 1)) for k in range(3)]
    emitters = [pm.PointEmitter((0, 0.01, 0), rate=0, bursts=[(0, 3)], speed=0, name="0"), *chain]
    sim = simulation(emitters, [], dt=0.1, compiled=compiled, zones=[pm.HalfSpaceZone()])
    counts = []
    for _ in range(6):
        sim.step()
        counts.append(len(sim.system.particles))
    assert counts == [6, 12, 24, 0, 0, 0]


def test_among_particles_that_push_each_other_nobody_has_children_twice():
    """Newborn balls turn the steps of others from their rehearsals; at the zone's edge that makes the difference."""
    emitters = [
        pm.PointEmitter((0, 1, 0), rate=300, speed=2, direction=(0, -1, 0), cone=5, size=0.06, mass=0.01, name="a"),
        pm.PointEmitter(of="a", count=1, speed=2, inherit=0, lifetime=0.05, attributes={"child": 1.0}),
    ]
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity(), pm.SoftSphere(k_s=200.0)])
    zones = [pm.HalfSpaceZone((0, 0.9, 0))]
    sim = pm.Simulation(system, "leapfrog", 1 / 240, emitters=emitters, zones=zones, compiled=False)
    p, before, parents, born = system.particles, set(), set(), set()
    for _ in range(120):
        sim.step()
        child = p.attributes["child"] > 0
        born |= set(p.id[child].tolist())
        now = set(p.id[~child].tolist())
        parents |= before - now
        before = now
    assert len(parents) > 80
    assert len(born) == len(parents)


def test_both_paths_and_any_frame_rate_agree_on_the_dead():
    def run(compiled, fps):
        sim = rain(compiled, response="kill", rate=60)
        emitters = [*sim.emitters, pm.PointEmitter(of="rain", on="death", count=2, speed=3, cone=30, lifetime=0.3)]
        zones = [pm.SphereZone((0.5, 0.9, 0), 0.4)]
        sim = pm.Simulation(sim.system, "leapfrog", 1 / 60, emitters=emitters, zones=zones, compiled=compiled)
        list(sim.frames(fps + 1, fps))
        return state(sim)

    first = run(False, 60)
    assert (first[0] >= 2**62).sum() > 50
    for fps in (24, 60):
        assert_equal(first, run(True, fps))


def test_as_a_scene_file():
    scene = pm.Scene(emitters=[*drops(), splash(above=0.5)], forces=[pm.Gravity()], colliders=[pm.Plane()])
    assert pm.Scene.from_toml(scene.to_toml()) == scene
