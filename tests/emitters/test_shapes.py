"""Emitters of all shapes: where, when, in which direction, and with which numbers particles are born."""

import copy
import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.emitters.chance import Quantity
from pointmass.emitters.schedule import Curve

N = 20_000
SHAPES = [
    pm.PointEmitter,
    pm.LineEmitter,
    pm.Nozzle,
    pm.SphereEmitter,
    lambda **k: pm.SphereEmitter(where="volume", **k),
    pm.BoxEmitter,
    lambda **k: pm.BoxEmitter(where="surface", **k),
]


def born(emitter, until=N, seed=0, stream="s"):
    return emitter.births(0.0, until, seed, stream)


def nothing(forces=(), **attributes):
    return pm.ParticleSystem(pm.Particles(np.zeros((0, 3)), **attributes), list(forces))


def steps_of(x):
    return np.linalg.norm(np.diff(x, axis=0), axis=1)


def nearest(x):
    apart = np.linalg.norm(x[:, None] - x, axis=2) + 1e9 * np.eye(len(x))
    return apart.min(axis=1)


# --------------------------------------------------------------------------------------------------------------- where


def test_places_on_a_line():
    x = born(pm.LineEmitter((1, 2, 3), (0, 4, 3), rate=1)).x - [1, 2, 3]
    along = x @ np.array([0, 0.8, 0.6])
    np.testing.assert_allclose(x, np.outer(along, [0, 0.8, 0.6]), atol=1e-12)
    assert np.abs(along).max() <= 2.5
    assert along.var() == pytest.approx(25 / 12, rel=0.03)


@pytest.mark.parametrize("where", ["surface", "volume"])
def test_places_of_a_sphere(where):
    x = born(pm.SphereEmitter(radius=2, where=where, rate=1)).x
    r = np.linalg.norm(x, axis=1)
    if where == "surface":
        np.testing.assert_allclose(r, 2, rtol=1e-12)
    else:  # (r/R)^3 is uniform
        assert np.abs(np.sort((r / 2) ** 3) - (np.arange(N) + 0.5) / N).max() < 2 / math.sqrt(N)
    assert np.abs(x.mean(axis=0)).max() < 4 * 2 / math.sqrt(3 * N)
    np.testing.assert_allclose((x**2).mean(axis=0), (r**2).mean() / 3, rtol=0.04)


def test_places_in_a_box():
    x = born(pm.BoxEmitter(sides=(1, 2, 0), rate=1)).x
    assert (np.abs(x).max(axis=0) <= [0.5, 1, 0]).all()
    np.testing.assert_allclose(x.var(axis=0), [1 / 12, 4 / 12, 0], rtol=0.04)


def test_places_on_a_box_are_even_over_its_area():
    x = born(pm.BoxEmitter(sides=(1, 2, 3), rate=1, where="surface")).x
    faces = np.abs(x) > np.array([0.5, 1, 1.5]) * (1 - 1e-12)
    assert (faces.sum(axis=1) == 1).all()
    areas = np.array([2 * 3, 3 * 1, 1 * 2])
    share = areas / areas.sum()
    assert np.abs(faces.mean(axis=0) - share).max() < 4 * math.sqrt(0.25 / N)
    for axis in range(3):
        sides = np.sign(x[faces[:, axis], axis])
        assert abs(sides.mean()) < 4 / math.sqrt(len(sides))


@pytest.mark.parametrize("make", SHAPES)
def test_normals_are_unit_vectors_and_point_outwards(make):
    emitter = make(rate=1, speed=1, cone=0)
    u = np.random.default_rng(1).random((1000, 4))
    place, normal = emitter.spot(u)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=1e-12)
    assert (np.einsum("ij,ij->i", place, normal) >= -1e-12).all()


@pytest.mark.parametrize("make", [m for m in SHAPES if m is not pm.Nozzle])
def test_along_the_normal(make):
    emitter = make(rate=1, speed=3, cone=0, direction="normal")
    b = born(emitter, 500)
    np.testing.assert_allclose(np.linalg.norm(b.v, axis=1), 3, rtol=1e-12)
    if make is pm.SphereEmitter:
        np.testing.assert_allclose(b.v / 3, b.x / 0.5, atol=1e-12)


def test_a_cone_around_the_normal():
    b = born(pm.SphereEmitter(rate=1, speed=1, cone=30, direction="normal"))
    cosine = np.einsum("ij,ij->i", b.v, b.x) / 0.5
    edge = math.cos(math.radians(30))
    assert cosine.min() >= edge - 1e-12
    assert cosine.mean() == pytest.approx((1 + edge) / 2, abs=4 * (1 - edge) / math.sqrt(12 * N))


# ---------------------------------------------------------------------------------------------------------------- when


@settings(max_examples=30, deadline=None)
@given(
    rate=st.sampled_from(["50*(1+sin(7*t))", "where(t < 0.4, 0, 200)", "300*t", "max(0, 100 - 300*t)", "0"]),
    cuts=st.lists(st.floats(0, 1), max_size=8),
    shape=st.sampled_from(SHAPES),
)
def test_all_schedules_are_the_same_however_time_is_cut(rate, cuts, shape):
    def emitter():
        where = ("cos(3*t)", "t", "sin(3*t)")
        bursts = [(0.25, 7), (0.5, 3)]
        return shape(position=where, rate=rate, per_distance=20, bursts=bursts, stop=1.25, lifetime=pm.Normal(1, 1))

    t = [-0.5, *(-0.5 + 2 * np.sort(cuts)), 1.5]
    one, some = emitter(), emitter()
    whole = one.births(t[0], t[-1], 3, "s")
    parts = [some.births(a, b, 3, "s") for a, b in pairwise(t)]
    for name in ("time", "number", "x", "v", "lifetime"):
        np.testing.assert_array_equal(getattr(whole, name), np.concatenate([getattr(p, name) for p in parts]))
    assert len(np.unique(whole.number)) == len(whole.number)
    assert (np.diff(whole.time) >= 0).all()
    assert len(whole.time) > 10 + 20 * math.sqrt(10) * 1.25 - 2


def test_a_rate_that_changes_is_integrated():
    """N(t) = 100 (t + (1 - cos 10 t)/10): births where it is a whole number."""
    t = born(pm.Nozzle(rate="100*(1 + sin(10*t))"), 5.0).time
    np.testing.assert_allclose(100 * (t + (1 - np.cos(10 * t)) / 10), np.arange(len(t)), atol=0.01)
    assert len(t) == math.ceil(100 * (5 + (1 - math.cos(50)) / 10))


def test_a_rate_that_is_linear_is_inverted_exactly():
    t = born(pm.Nozzle(rate=lambda t: 200 * t), 3.0).time
    np.testing.assert_allclose(t, np.sqrt(np.arange(900) / 100), atol=1e-12)


def test_a_rate_that_is_zero_for_a_while():
    t = born(pm.Nozzle(rate="where(t < 2, 0, 100)"), 3.0).time
    assert t.min() >= 2 - 1 / 1024
    np.testing.assert_allclose(np.diff(t)[1:], 0.01, rtol=1e-9)


def test_a_rate_that_is_constant_in_time_is_steady():
    curve = Curve(lambda t: np.full(np.shape(t), 130.0), 0.25, math.inf)
    k = np.arange(curve.counts(np.array([4.0]))[0])
    np.testing.assert_allclose(curve.times(k), 0.25 + k / 130, atol=1e-12)


def test_bursts():
    b = born(pm.PointEmitter(rate=0, bursts=[(0.5, 200), (1.0, 50)], speed=2, cone=180))
    np.testing.assert_array_equal(b.time, np.repeat([0.5, 1.0], [200, 50]))


def test_births_per_metre():
    t = born(pm.PointEmitter(("3*t*t", 0, 0), per_distance=10, speed=0), 2.0)
    np.testing.assert_allclose(t.x[:, 0], np.arange(120) / 10, atol=1e-9)


# ------------------------------------------------------------------------------------------------------------ movement


def test_place_and_velocity_are_those_of_the_birth_time():
    e = pm.PointEmitter(("2*cos(3*t)", "t", "2*sin(3*t)"), rate=70, speed=0, inherit=0.5)
    b = born(e, 2.0)
    t = b.time
    np.testing.assert_allclose(b.x, np.stack([2 * np.cos(3 * t), t, 2 * np.sin(3 * t)], axis=1), atol=1e-12)
    velocity = np.stack([-6 * np.sin(3 * t), 1 + 0 * t, 6 * np.cos(3 * t)], axis=1)
    np.testing.assert_allclose(b.v, 0.5 * velocity, atol=1e-12)


@pytest.mark.parametrize("dt", [1 / 24, 1 / 60])
def test_no_clumps_from_an_emitter_that_circles_three_times_a_second(dt):
    """Distances along the trail are those of particles that leave a continuous path, each after its own flight."""
    w, rate, g = 6 * math.pi, 400, 9.81
    e = pm.PointEmitter((f"cos({w}*t)", 0, f"sin({w}*t)"), rate=rate, speed=0, inherit=0.1)
    system = nothing([pm.Gravity((0, -g, 0))])
    sim = pm.Simulation(system, "leapfrog", dt, emitters=[e], compiled=False)
    sim.step(round(1 / dt))
    t = np.arange(len(system.particles)) / rate
    flight = sim.t - t
    circle, way = (
        np.stack([np.cos(w * t), 0 * t, np.sin(w * t)], 1),
        np.stack([-np.sin(w * t), 0 * t, np.cos(w * t)], 1),
    )
    exact = circle + 0.1 * w * flight[:, None] * way - 0.5 * g * np.outer(flight**2, [0, 1, 0])
    for apart in (steps_of, nearest):
        np.testing.assert_allclose(apart(system.particles.x), apart(exact), rtol=0.05)


# ------------------------------------------------------------------------------------------------------------- numbers


def test_S01_counts_with_a_half_range_are_rounded_by_chance():
    counts = Quantity("count", pm.Spread(100, 30), at_least=0).whole(0, "s", np.arange(100_000))
    assert counts.mean() == pytest.approx(100, abs=0.25)
    assert counts.std() == pytest.approx(math.sqrt(300 + 1 / 6), rel=0.01)


def test_a_normal_distribution_keeps_to_what_is_allowed():
    free, cut = (Quantity("speed", pm.Normal(1, 2), **k).draw(0, "s", np.arange(N)) for k in ({}, {"at_least": 0}))
    assert free.mean() == pytest.approx(1, abs=4 * 2 / math.sqrt(N))
    assert free.std() == pytest.approx(2, rel=0.02)
    assert cut.min() >= 0
    np.testing.assert_array_equal(cut[free >= 0], free[free >= 0])
    phi, tail = math.exp(-1 / 8) / math.sqrt(2 * math.pi), 0.5 * math.erfc(-0.5 / math.sqrt(2))
    assert cut.mean() == pytest.approx(1 + 2 * phi / tail, rel=0.02)  # of the truncated distribution


def test_attributes_of_particles():
    e = pm.BoxEmitter(rate=1000, attributes={"temperature": pm.Spread(900, 50), "charge": 2.0}, mass=pm.Spread(2, 1))
    scene = pm.Scene(emitters=[e], forces=[pm.Drag("0.001*temperature")])
    p = scene.simulation().system.particles
    assert len(p) == 0
    sim = scene.simulation()
    sim.step(20)
    p = sim.system.particles
    assert p.attributes["charge"].tolist() == [2.0] * len(p)
    assert 850 <= p.attributes["temperature"].min() < p.attributes["temperature"].max() <= 950
    assert np.ptp(p.m) > 1


def test_S03_burst_without_drag():
    e = pm.PointEmitter((0, 5, 0), rate=0, bursts=[(0.123, 300)], speed=7, cone=180)
    sim = pm.Simulation(nothing([pm.Gravity((0, -9.81, 0))]), "leapfrog", 1 / 60, emitters=[e], compiled=False)
    sim.step(60)
    t = sim.t - 0.123
    r = np.linalg.norm(sim.system.particles.x - [0, 5 - 9.81 * t * t / 2, 0], axis=1)
    np.testing.assert_allclose(r, 7 * t, rtol=1e-12)


def test_S04_burst_with_linear_drag():
    tau, e = 0.5, pm.PointEmitter(rate=0, bursts=[(0.123, 100)], speed=7, cone=180, mass=0.01)
    sim = pm.Simulation(nothing([pm.Drag(0.01 / tau)]), "rk4", 1 / 60, emitters=[e], compiled=False)
    sim.step(60)
    t = sim.t - 0.123
    r = np.linalg.norm(sim.system.particles.x, axis=1)
    np.testing.assert_allclose(r, 7 * tau * (1 - math.exp(-t / tau)), rtol=1e-6)


def test_S07_the_same_seed_twice():
    def run(seed):
        e = pm.SphereEmitter(rate="200*t", speed=pm.Normal(3, 1), direction="normal", lifetime=pm.Spread(0.3, 0.1))
        sim = pm.Simulation(nothing([pm.Gravity()]), emitters=[e], seed=seed, compiled=False)
        sim.step(200)
        return sim.system.get_state()

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.array_equal(run(1), run(2))


# ---------------------------------------------------------------------------------------------------------- as a scene


def test_in_a_scene_file_and_back():
    text = """
    [[emitters]]
    type = "sphere"
    position = ["cos(t)", "2", "sin(t)"]
    rate = "100*(1 + sin(t))"
    bursts = [[0.5, 100]]
    speed = { mean = 5.0, sd = 0.5 }
    lifetime = { mean = 2.0, half_range = 0.5 }
    attributes = { temperature = { mean = 900, half_range = 100 }, charge = 1.0 }
    direction = "normal"
    where = "volume"
    """
    one = pm.Scene.from_toml(text)
    again = pm.Scene.from_toml(one.to_toml())
    written = pm.SphereEmitter(
        ("cos(t)", "2", "sin(t)"),
        rate="100*(1 + sin(t))",
        bursts=[(0.5, 100)],
        speed=pm.Normal(5, 0.5),
        lifetime=pm.Spread(2, 0.5),
        attributes={"temperature": pm.Spread(900, 100), "charge": 1.0},
        direction="normal",
        where="volume",
    )
    assert one == again == pm.Scene(emitters=[written])
    a, b = (s.emitters[0].births(0, 1, 0, "s") for s in (again, pm.Scene(emitters=[written])))
    np.testing.assert_array_equal(a.v, b.v)
    np.testing.assert_array_equal(a.columns["temperature"], b.columns["temperature"])


def test_copies_have_the_same_births():
    one = pm.BoxEmitter(("t", 0, 0), rate="100*(1 + t)", per_distance=30, bursts=[(0.5, 9)], mass=pm.Spread(1, 0.5))
    whole = one.births(0, 1, 0, "s")
    for other in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        again = other.births(0, 1, 0, "s")
        np.testing.assert_array_equal(again.time, whole.time)
        np.testing.assert_array_equal(again.x, whole.x)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.PointEmitter(rate=0), "rate = 0 is not allowed alone"),
        (lambda: pm.PointEmitter(rate="t - 1"), r"at t = 0 s, rate = -1\.0 is not allowed"),
        (lambda: pm.PointEmitter(rate="charge"), "rate may depend on t"),
        (lambda: pm.PointEmitter(("x", 0, 0)), "position may depend on t"),
        (lambda: pm.PointEmitter(direction="up"), "direction = 'up'"),
        (lambda: pm.Nozzle(direction="normal"), "direction = 'normal' is not allowed for a nozzle"),
        (lambda: pm.PointEmitter(per_distance=3), "per_distance needs a position that moves"),
        (lambda: pm.PointEmitter(per_distance=-3), "per_distance = -3"),
        (lambda: pm.PointEmitter(bursts=[(1, 5), (1, 5)]), "bursts must be in order of time"),
        (lambda: pm.PointEmitter(bursts=[(1, 2.5)]), r"bursts has the count 2\.5"),
        (lambda: pm.PointEmitter(bursts=[(-1, 2)]), "bursts has the time -1 s"),
        (lambda: pm.PointEmitter(bursts=[3, 4]), "bursts must have shape"),
        (lambda: pm.PointEmitter(bursts=3), "bursts must be pairs"),
        (lambda: pm.PointEmitter(attributes=3), "attributes must be numbers by name"),
        (lambda: pm.PointEmitter(speed=pm.Spread(1, 2)), "speed = 1 \\+- 2 is not allowed"),
        (lambda: pm.PointEmitter(speed=pm.Normal(1, -2)), "sd of speed = -2"),
        (lambda: pm.PointEmitter(lifetime=pm.Normal(-1, 2)), "mean of lifetime = -1"),
        (lambda: pm.PointEmitter(mass={"mean": 3}), "mass = {'mean': 3} is not allowed"),
        (lambda: pm.PointEmitter(inherit=math.nan), "inherit = nan"),
        (lambda: pm.PointEmitter(attributes={"x": 1}), "particle attribute 'x'"),
        (lambda: pm.LineEmitter(extent=(0, 0, 0)), "extent = "),
        (lambda: pm.SphereEmitter(where="edge"), "unknown value of where: 'edge'"),
        (lambda: pm.SphereEmitter(radius=-1), "radius = -1"),
        (lambda: pm.BoxEmitter(sides=(0, 0, 1)), "sides = "),
        (lambda: pm.PointEmitter(rate="1/t"), "rate"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_rate_that_goes_wrong_later_says_when():
    sim = pm.Simulation(nothing(), emitters=[pm.PointEmitter(rate="1 - t")], dt=0.1, compiled=False)
    with pytest.raises(pm.InvalidInput, match=r"at t = 1\.\d+ s, rate = -"):
        sim.step(100)


def test_a_scene_file_says_what_a_number_may_be():
    with pytest.raises(pm.InvalidInput, match=r"emitters\.0\.speed = .* is not allowed: it must be a number, or {"):
        pm.Scene.from_toml('[[emitters]]\ntype = "point"\nspeed = { mean = 3 }\n')
