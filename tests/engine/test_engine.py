"""Compiled spans against the reference path, step by step: the same bits for single particles and small islands."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import store
from pointmass.engine.engine import Engine
from pointmass.engine.forces import tiled
from pointmass.engine.island import Span
from pointmass.engine.kernels import grow_old
from pointmass.engine.reference import ReferenceEngine
from pointmass.forces import FORCES
from pointmass.solvers import SOLVERS

DT = 1 / 64
GRID = np.random.default_rng(4).standard_normal((3, 3, 4, 1, 3))
PLACE = {"origin": (-1, -1, -1), "spacing": (0.7, 0.6, 0.9)}


@pm.unary_force
def own(x, v, m, t, strength=0.7, axis=(0.0, 1.0, 0.0)):
    """A law of a user's own, with every function that laws may call."""
    pull = pm.where(x[0] > 0, pm.exp(-x[0] * x[0]), pm.log(2 - x[0]))
    turn = pm.cross(axis, v)
    return (
        pull + strength * turn[0],
        pm.absolute(pm.atan2(x[1], 1.5)) ** 1.3 + turn[1],
        pm.sin(3 * t) * pm.minimum(m, 1.0) + turn[2],
    )


@pm.element_force(3)
def corner(x1, v1, x2, v2, x3, v3, t, k=2.0):
    """Three particles that like to be on a line."""
    d = x1 - 2.0 * x2 + x3
    return -k * d, 2.0 * k * d, -k * d


LAWS: dict[str, list[Callable[[], pm.Force]]] = {
    "gravity": [lambda: pm.Gravity(("sin(t)", -9.81, "charge"))],
    "drag": [
        lambda: pm.Drag("0.3*charge"),
        lambda: pm.Drag(np.linspace(0.1, 0.8, 8)),
        lambda: pm.Drag(lambda t: 1 + t),
    ],
    "quadratic_drag": [lambda: pm.QuadraticDrag(0.4, on=[0, 2, 5])],
    "attractor": [lambda: pm.Attractor(2.0, center=lambda t: (t, t * t, 0.0), eps=0.3)],
    "line_attractor": [lambda: pm.LineAttractor(b=(0, "t", 1), power=1.5, reach=1.5)],
    "ring_attractor": [lambda: pm.RingAttractor(strength="charge", power=2.0)],
    "surface_attractor": [lambda: pm.SurfaceAttractor([pm.Sphere(("t", 0, 0)), pm.Plane()])],
    "cushion": [lambda: pm.Cushion([pm.Sphere(("t", 0, 0)), pm.Plane()], 20.0, 0.5, 0.3)],
    "harmonic": [lambda: pm.Harmonic(4.0, center=("cos(t)", 0, 1), k_d=0.2)],
    "magnetic": [lambda: pm.Magnetic((0.1, 0.2, 1.0))],
    "wind": [lambda: pm.Wind(("3*sin(t)", 0, 0)), lambda: pm.Wind([pm.Vortex(2.0, eps=0.2), ("t", 1, 0)])],
    "field": [
        lambda: pm.Field(("-k*x", "sin(t)*y", "-z**3"), constants={"k": 2.0}),
        lambda: pm.Field(potential="0.5*k*x**2 + charge*y", constants={"k": 2.0}),
        lambda: pm.Field(grid=pm.Grid(GRID, times=[0, 0.1, 0.2], outside="zero", **PLACE)),
        lambda: pm.Field(grid=pm.Grid(GRID[0], outside="wrap", **PLACE), scale="1 + t"),
    ],
    "springs": [
        lambda: pm.Springs([(0, 1), (1, 2), (5, 2), (6, 7)], 20.0, [0.5, 0.1, 0.2, 0.3], rest="1 + 0.2*sin(9*t)")
    ],
    "muscles": [lambda: pm.Muscles([(0, 1), (1, 2), (6, 7)], 20.0, 0.1, amplitude=0.2, phase=[0.0, 1.0, 2.0])],
    "scales": [lambda: pm.Scales([(0, 1), (1, 2), (6, 7)], 0.3, [20.0, 5.0, 9.0], creep=0.1)],
    "slender_drag": [lambda: pm.SlenderDrag([(0, 1), (1, 2), (6, 7)], 0.3, [0.5, 0.6, 0.7])],
    "plate_wind": [lambda: pm.PlateWind([(0, 1, 2), (2, 5, 6)], [pm.Vortex(2.0, eps=0.2), (1, "t", 0)])],
    "water": [lambda: pm.Water([(0, 1, 2), (2, 5, 6)], 2.0, [pm.Vortex(2.0, eps=0.2), (1, "t", 0)])],
    "fins": [lambda: pm.Fins([(0, 1, 2, 3), (2, 5, 6, 4)], [1.0, 2.5], 0.4, 2.0, 0.1, (1, "t", 0))],
    "angles": [lambda: pm.Angles([(0, 1, 2), (2, 5, 1)], 2.0, 0.1, rest=0.5)],
    "hinges": [lambda: pm.Hinges([(0, 1, 2, 3), (2, 5, 1, 4)], 2.0, 0.1)],
    "volumes": [lambda: pm.Volumes([(0, 1, 2, 3), (2, 5, 1, 6)], 2.0, 0.1, rest=0.5)],
    "bulk": [lambda: pm.Bulk([(0, 1, 2, 3), (2, 5, 1, 6)], 2.0, 0.1, rest=0.5)],
    "own": [lambda: own(strength="charge"), lambda: corner(elements=[(0, 1, 2), (5, 6, 7)])],
    "flow": [
        lambda: pm.Flow(("-y", "x + 0.2*sin(t)", "0")),
        lambda: pm.Flow(grid=pm.Grid(GRID[0], outside="clamp", **PLACE)),
    ],
    "vortex": [lambda: pm.Vortex(2.0, eps=0.3)],
    "vortex_line": [lambda: pm.VortexLine((0, -1, 0), (0, 1, 0.2), eps=0.2)],
    "vortex_ring": [lambda: pm.VortexRing(eps=0.2)],
    "gust": [pm.Gust],
    "flutter": [pm.Flutter],
    "diffusion": [pm.Diffusion],
    "buoyancy": [lambda: pm.Buoyancy("300*charge")],
    "curl_noise": [lambda: pm.CurlNoise(rate=0, octaves=1)],
    "gravitation": [lambda: pm.Gravitation(0.5, eps=0.4), lambda: pm.Gravitation("1 + t", eps=0.4, on=[1, 2, 6])],
    "lennard_jones": [lambda: pm.LennardJones(0.1, 0.3)],
    "soft_sphere": [lambda: pm.SoftSphere(50.0, 0.3, radius=0.4)],
    "flocking": [lambda: pm.Flocking(1.5, 0.6, "2 + t", 1.0, 0.5, 200.0, 3.0)],
    "flee": [lambda: pm.Flee([0, 1, 5], 4.0, 1.5, 300.0)],
    "seek": [lambda: pm.Seek(("t", 1, 0), 2.0, 1.5, 0.5, limit=1.0)],
    "avoid": [lambda: pm.Avoid([pm.Sphere(("t", 0, 0), radius=0.3), pm.Plane((0, -2, 0))], 4.0)],
    "cruise": [lambda: pm.Cruise(1.5, 2.0, limit="1 + charge")],
    "point_vortices": [lambda: pm.PointVortices("charge", eps=0.3)],
}
SUMMED_APART = (
    "gravitation",
    "lennard_jones",
    "soft_sphere",
    "point_vortices",
    "flocking",
    "flee",
)  # in blocks, not one by one
NOISY = ("curl_noise", "gust", "flutter", "diffusion")  # long programs: their kernels are slow in plain Python
SOLVERS_OF = {
    name: [kind()] + ([kind(adaptive=False)] if name in ("bs32", "dopri5") else []) for name, kind in SOLVERS.items()
}
READY = [s for several in SOLVERS_OF.values() for s in several if not s.implicit]
CASES = [pytest.param(make, id=f"{name}-{k}") for name, several in LAWS.items() for k, make in enumerate(several)]


def cloud(dtype: Any = np.float64, seed: int = 7) -> pm.Particles:
    rng = np.random.default_rng(seed)
    x, v = rng.uniform(-1, 1, (8, 3)), rng.uniform(-1, 1, (8, 3))
    particles = pm.Particles(x, v, rng.uniform(0.5, 2, 8), charge=rng.uniform(0.5, 1.5, 8), dtype=dtype)
    particles.pin([4])
    return particles


def system(*forces: Callable[[], pm.Force], **options: Any) -> pm.ParticleSystem:
    return pm.ParticleSystem(cloud(**options), [make() for make in forces])


def both(make: Callable[[], pm.ParticleSystem], solver: Any, steps: int, cuts: tuple[int, ...] = ()) -> list[Any]:
    """The system after steps on the reference path, and after spans of kernels."""
    slow, fast = make(), make()
    reference = ReferenceEngine(slow, solver)
    for k in range(steps):
        reference.step(k * DT, (k + 1) * DT)
    engine = Engine(fast, solver, wanted=True)
    assert engine.compiled, engine.missing()
    for a, b in itertools.pairwise((0, *cuts, steps)):
        assert engine.run(Span(0.0, DT, a, b - a), None, look_inside=False)
    return [slow, fast]


def same(a: pm.ParticleSystem, b: pm.ParticleSystem) -> None:
    if any(force.name in SUMMED_APART for force in a.forces):
        np.testing.assert_allclose(a.particles.x, b.particles.x, rtol=0, atol=1e-13)
        np.testing.assert_allclose(a.particles.v, b.particles.v, rtol=0, atol=1e-13 * np.abs(a.particles.v).max())
        return
    np.testing.assert_array_equal(a.particles.x, b.particles.x)
    np.testing.assert_array_equal(a.particles.v, b.particles.v)


def test_every_force_has_a_kernel_or_a_reason() -> None:
    assert set(FORCES) == set(LAWS) - {"own"}


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("solver", READY, ids=repr)
@pytest.mark.parametrize("law", CASES)
def test_every_law_under_every_solver(law: Callable[[], pm.Force], solver: Any) -> None:
    if law().order == 1 and solver.name in ("symplectic_euler", "leapfrog", "yoshida4"):
        pytest.skip("the method is for x'' = f/m")
    if law().name in NOISY and solver.name not in ("heun", "leapfrog"):
        pytest.skip("noise is the same to all solvers")
    same(*both(lambda: system(law), solver, steps=3, cuts=(1,)))


PAIRWISE = [  # every law and every solver once, compiled
    (("gravity", "springs", "own"), "symplectic_euler", np.float64),
    (("drag", "attractor", "magnetic"), "rk4", np.float64),
    (("harmonic", "angles", "field"), "leapfrog", np.float64),
    (("wind", "quadratic_drag", "springs"), "dopri5", np.float64),
    (("flow", "vortex"), "bs32", np.float64),
    (("gravity", "drag", "field"), "yoshida4", np.float32),
    (("springs", "own"), "midpoint", np.float32),
    (("gravitation", "soft_sphere", "angles"), "leapfrog", np.float64),
    (("point_vortices", "flow"), "heun", np.float64),
]


@pytest.mark.parametrize(("laws", "name", "dtype"), PAIRWISE)
def test_compiled(laws: tuple[str, ...], name: str, dtype: Any) -> None:
    makers = [make for law in laws for make in LAWS[law]]
    slow, fast = both(lambda: system(*makers, dtype=dtype), SOLVERS[name](), steps=100, cuts=(7, 64))
    if dtype == np.float64:
        same(slow, fast)
    else:
        np.testing.assert_allclose(fast.particles.x, slow.particles.x, rtol=1e-3, atol=1e-3)
        assert fast.particles.x.dtype == np.float32


def large(n: int = 1000) -> pm.ParticleSystem:
    """Single particles, and chains of three, in an order that mixes them."""
    rng = np.random.default_rng(3)
    particles = pm.Particles(rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3)))
    links = rng.permutation(n)[: 3 * (n // 9)].reshape(-1, 3)
    springs = pm.Springs(np.concatenate([links[:, :2], links[:, 1:]]), 30.0, 0.2, rest=0.5)
    return pm.ParticleSystem(particles, [pm.Gravity(), pm.Drag(0.1), springs])


def net(dtype: Any = np.float64, n: int = 300) -> pm.ParticleSystem:
    """One island in random order, of elements of two and of three particles, and forces before, between and behind."""
    rng = np.random.default_rng(3)
    particles = pm.Particles(rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3)), dtype=dtype)
    particles.pin([0, 7])
    way = rng.permutation(n)
    ring = np.stack([way, np.roll(way, 1)], axis=1)
    threes = np.stack([way, np.roll(way, 1), np.roll(way, 2)], axis=1)
    forces = [
        corner(elements=threes[::3]),
        pm.Gravity(),
        pm.Springs(ring, 30.0, 0.2, rest=rng.uniform(0.1, 0.9, n)),
        pm.Angles(threes, 2.0, 0.1, rest="0.5 + t"),
        pm.Drag(0.1),
        pm.Springs(ring[::2, ::-1], 3.0),
    ]
    return pm.ParticleSystem(particles, forces)


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4(), pm.Yoshida4()], ids=repr)
def test_tiles_of_a_large_island(solver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pointmass.engine.engine.LARGE", 100)
    monkeypatch.setattr("numba.get_num_threads", lambda: 3)
    same(*both(net, solver, steps=2))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_compiled_tiles(dtype: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pointmass.engine.engine.LARGE", 100)
    monkeypatch.setattr("numba.get_num_threads", lambda: 3)
    slow, fast = both(lambda: net(dtype), pm.Leapfrog(), steps=50, cuts=(20,))
    if dtype == np.float64:
        same(slow, fast)
    else:
        np.testing.assert_allclose(fast.particles.x, slow.particles.x, rtol=1e-3, atol=1e-3)


def test_an_element_between_tiles_is_in_each_of_them() -> None:
    rng = np.random.default_rng(2)
    places, cuts = rng.integers(0, 100, (500, 3)), np.array([0, 30, 64, 100])
    found = tiled(places, cuts, np.zeros(3, np.int64))
    for tile in range(3):
        mine = found.order[found.start[tile] : found.start[tile + 1]]
        touched = ((places >= cuts[tile]) & (places < cuts[tile + 1])).any(axis=1)
        np.testing.assert_array_equal(mine, np.flatnonzero(touched))
    np.testing.assert_array_equal(found.nodes.reshape(-1, 3), places[found.order])


def test_batches_of_any_size_and_any_order_of_islands() -> None:
    whole = both(large, pm.SymplecticEuler(), steps=20)
    same(*whole)
    rows = np.random.default_rng(5).permutation(1000)[:400]
    some = large()
    keep = np.zeros(1000, bool)
    islands = some.island_of_particle
    keep[np.isin(islands, islands[rows])] = True
    some.remove(~keep)
    sim = pm.Simulation(some, pm.SymplecticEuler(), DT, compiled=True)
    sim.step(20)
    np.testing.assert_array_equal(some.particles.x, whole[1].particles.x[keep])


def test_a_knob_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = pm.Simulation(system(*LAWS["harmonic"], *LAWS["quadratic_drag"]), dt=DT, compiled=True)
    sim.step(3)
    monkeypatch.setattr(store, "load", lambda *text: pytest.fail("a kernel was made"))
    harmonic, drag = sim.system.forces
    before = sim.system.particles.x.copy()
    harmonic.set(k_s=9.0)
    drag.set(c=3.0)
    sim.step(3)
    slow = pm.Simulation(system(*LAWS["harmonic"], *LAWS["quadratic_drag"]), dt=DT)
    slow.step(3)
    np.testing.assert_array_equal(slow.system.particles.x, before)
    slow.system.forces[0].set(k_s=9.0)
    slow.system.forces[1].set(c=3.0)
    slow.step(3)
    same(slow.system, sim.system)


def test_a_force_is_switched_off_and_on() -> None:
    sims = [pm.Simulation(system(*LAWS["springs"], *LAWS["gravity"]), dt=DT, compiled=c) for c in (False, True)]
    for sim in sims:
        sim.step(2)
        sim.system.forces[0].enabled = False
        sim.step(2)
        sim.system.forces[0].enabled = True
        sim.system.forces[1].enabled = False
        sim.step(2)
    same(*(sim.system for sim in sims))


def test_births_and_deaths_and_frames_between_steps() -> None:
    def run(compiled: bool) -> list[pm.Frame]:
        start = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity(), pm.Drag(0.01)])
        nozzle = pm.Nozzle(rate=300, speed=3, lifetime=pm.Spread(0.3, 0.2))
        sim = pm.Simulation(start, pm.RK4(), 1 / 100, emitters=[nozzle], compiled=compiled)
        return list(sim.frames(12, fps=24))

    for slow, fast in zip(run(False), run(True), strict=True):
        np.testing.assert_array_equal(slow.ids, fast.ids)
        np.testing.assert_array_equal(slow.positions, fast.positions)
        np.testing.assert_array_equal(slow.velocities, fast.velocities)


def test_divergence_is_explained_as_on_the_reference_path() -> None:
    def run(compiled: bool) -> tuple[str, int, Any]:
        chain = pm.chain(6)
        stiff = pm.ParticleSystem(chain.particles, [pm.Gravity(), pm.Springs([(k, k + 1) for k in range(5)], 1e5)])
        sim = pm.Simulation(stiff, pm.RK4(), 1 / 50, compiled=compiled)
        with pytest.raises(pm.Diverged) as caught:
            sim.step(5000)
        return str(caught.value), sim.steps, stiff.particles.x

    slow, fast = run(False), run(True)
    assert slow[:2] == fast[:2]
    np.testing.assert_array_equal(slow[2], fast[2])


def test_a_parameter_that_is_no_longer_allowed_says_when() -> None:
    sim = pm.Simulation(system(lambda: pm.Drag("0.1 - t")), dt=DT, compiled=True)
    with pytest.raises(pm.InvalidInput, match=r"at t = 0\.1"):
        sim.step(100)
    assert 0 < sim.steps < 10


def test_age_is_the_same_in_spans() -> None:
    one, many = (pm.Simulation(system(*LAWS["gravity"]), dt=0.01, compiled=True) for _ in range(2))
    one.step(7)
    for _ in range(7):
        many.step()
    same(one.system, many.system)
    np.testing.assert_array_equal(one.system.particles.age, many.system.particles.age)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_ages_grow_as_step_by_step(dtype: Any) -> None:
    for start in (np.full(5000, 0.3), np.random.default_rng(1).uniform(0, 1, 5000), np.repeat([0.1, 0.2], 2500)):
        age, lived = start.astype(dtype), np.random.default_rng(2).uniform(0, 0.1, 37).astype(dtype)
        wanted = age.copy()
        for more in lived:
            wanted += more
        grow_old(age, lived)
        np.testing.assert_array_equal(age, wanted)


def test_laws_that_read_the_age() -> None:
    slow, fast = (
        pm.Simulation(system(lambda: pm.Drag("0.1 + age")), pm.RK4(), DT, compiled=compiled)
        for compiled in (False, True)
    )
    slow.step(5)
    fast.step(5)
    assert fast.engine.compiled
    same(slow.system, fast.system)


def test_a_numpy_force_runs_and_says_that_it_is_slow() -> None:
    force = pm.array_force(lambda x, v, m, t: -x)
    with pytest.warns(UserWarning, match="this run is not compiled, because force .* is a NumPy function"):
        sim = pm.Simulation(pm.ParticleSystem(cloud(), [force]), dt=DT, compiled=True)
    assert not sim.engine.compiled
    sim.step(3)
    assert sim.steps == 3


def test_a_copy_is_prepared_in_a_thread_while_the_run_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    running = pm.Simulation(system(*LAWS["gravity"]), dt=DT, compiled=True)
    other = pm.Simulation(system(*LAWS["gravity"], lambda: pm.Drag(0.2)), dt=DT, compiled=True)
    before = other.system.particles.x.copy()
    thread = threading.Thread(target=other.prepare)
    thread.start()
    while thread.is_alive():
        running.step(4)
    np.testing.assert_array_equal(other.system.particles.x, before)
    monkeypatch.setattr(store, "load", lambda *text: pytest.fail("a kernel was made"))
    other.step(3)
    assert running.steps > 0
    assert other.steps == 3


def test_lanes_of_single_particles_are_vectors() -> None:
    if not pytest.importorskip("llvmlite.binding").get_host_cpu_features().get("avx2"):
        pytest.skip("this machine has no AVX2")
    floor = pm.Plane((0, -9, 0))
    still = pm.ParticleSystem(cloud(np.float32), [pm.Gravity(), pm.Drag(0.1)], floor)
    still.particles.unpin([4])
    sim = pm.Simulation(still, pm.SymplecticEuler(), DT, compiled=True)
    sim.step()
    (members,) = (group.members for group in sim.engine._grouped(None))
    source = store.complete("lanes", members.kernel.text, "float32").replace("**FLAGS", "**ENTRY")
    scope: dict[str, Any] = {}
    exec(compile(source.replace('"cache": True', '"cache": False'), "<lanes>", "exec"), scope)
    members.kernel.__dict__["functions"] = scope
    sim.step(9)
    for name in ("lanes8", "lanes1", "load", "keep"):
        text = "".join(scope[name].inspect_asm().values())
        assert text.count("%ymm") + text.count("%zmm") > 50, name
        assert "maskmov" not in text or "%zmm" in text, name  # such stores are slow without AVX-512


def test_those_who_dip_into_a_surface_between_two_looks_are_seen() -> None:
    def made(*floor: pm.Collider) -> pm.ParticleSystem:
        rng = np.random.default_rng(5)
        g, lowest = 1000.0, rng.uniform(0, 8 * DT, 400)  # when they are lowest, and how low they come
        x, v = rng.uniform(-1, 1, (400, 3)), np.zeros((400, 3))
        v[:, 1] = -g * lowest
        x[:, 1] = g * lowest**2 / 2 + rng.uniform(-0.2, 0.2, 400)
        x[:, 1] = np.maximum(x[:, 1], 0.01)
        return pm.ParticleSystem(pm.Particles(x, v), [pm.Gravity((0, g, 0))], floor)

    one, two = both(lambda: made(pm.Plane(restitution=0.5)), pm.Leapfrog(), 8)
    same(one, two)
    free = pm.Simulation(made(), pm.Leapfrog(), DT, compiled=False)
    free.step(8)
    dipped = (free.system.particles.x != two.particles.x).any(axis=1)
    assert 40 < (dipped & (free.system.particles.x[:, 1] > 0.1)).sum() < 360


def test_the_last_of_several_steps_can_be_looked_into_afterwards() -> None:
    def made() -> pm.Simulation:
        rng = np.random.default_rng(3)
        p = pm.Particles(rng.uniform(0.1, 1, (30, 3)))
        system = pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)], 10.0)], [pm.Plane(restitution=0.5)])
        return pm.Simulation(system, "rk4", 0.05, compiled=True)

    sim, other = made(), made()
    sim.step(7)
    looks = [sim.frame(t=t).positions for t in (0.31, 0.34)]
    sim.step(3)
    other.step(6)
    other._advance(1, look_inside=True)
    np.testing.assert_array_equal([other.frame(t=t).positions for t in (0.31, 0.34)], looks)
    other.step(3)
    np.testing.assert_array_equal(sim.system.particles.x, other.system.particles.x)
    sim.step()
    sim.system.particles.x[3] += 1.0
    with pytest.raises(pm.InvalidInput, match="after which something was changed"):
        sim.frame(t=0.53)
    assert sim.frame().positions[3, 0] == sim.system.particles.x[3, 0]
