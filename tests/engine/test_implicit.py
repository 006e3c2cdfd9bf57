"""Implicit steps in kernels against the reference path: the same bits for particles alone, else to the tolerances."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import store
from pointmass.engine.implicit import is_relative
from pointmass.engine.island import CHECKPOINT as COLD
from pointmass.engine.island import IslandKernel, Outcome, Span
from pointmass.engine.reference import ReferenceEngine
from pointmass.solvers.base import Memory

SOLVERS = [pm.ImplicitEuler, pm.ImplicitMidpoint, pm.BDF2]
SHARP: dict[str, Any] = {"tolerance": 1e-13, "cg_tolerance": 1e-13}
DT = 1 / 60


@pm.unary_force
def swirl(x: Any, v: Any, m: Any, t: Any, strength: Any = 0.7) -> Any:
    """Neither symmetric nor linear, and a function of time."""
    return -strength * x[1] * x[2] - 0.1 * v[0] * v[0], strength * x[0] * pm.cos(9 * t), 0.2 * pm.sin(3 * t) - x[2] ** 3


@pm.spring_force
def tether(x1: Any, v1: Any, x2: Any, v2: Any, t: Any, k: Any = 30.0) -> Any:
    """A spring that also knows where it is."""
    return -k * (1 + 0.1 * x1[1] * x1[1]) * (x1 - x2)


def advanced(
    system: pm.ParticleSystem, solver: pm.Solver, steps: int, parallel: bool = False, jit: bool = False, dt: float = DT
) -> tuple[Outcome, Memory]:
    """Run a kernel on a whole system."""
    kernel = IslandKernel(system, solver, parallel)
    if not jit:
        kernel.__dict__["functions"] = store.plain(kernel.title, kernel.text, kernel.dtype)
    island, p = system.island_of_particle, system.particles
    rows = np.argsort(island, kind="stable")
    memory = solver.start(system)
    x, v = p.x[rows].ravel(), p.v[rows].ravel()
    outcome = kernel.members(rows, island[rows]).run(x, v, None, Span(0.0, dt, 0, steps), memory)
    p.x[rows], p.v[rows] = x.reshape(-1, 3), v.reshape(-1, 3)
    return outcome, memory


def reference(system: pm.ParticleSystem, solver: pm.Solver, steps: int, dt: float = DT) -> ReferenceEngine:
    engine = ReferenceEngine(system, solver)
    for k in range(steps):
        engine.step(k * dt, (k + 1) * dt)
    return engine


def cloud() -> pm.ParticleSystem:
    """Particles alone, one pinned, under forces with full and partial Jacobians."""
    rng = np.random.default_rng(5)
    particles = pm.Particles(
        rng.uniform(-1, 1, (6, 3)), rng.uniform(-1, 1, (6, 3)), rng.uniform(0.5, 2, 6), charge=rng.uniform(1, 2, 6)
    )
    particles.pin([4])
    off = pm.Harmonic(9.0, enabled=False)
    forces = [
        pm.Gravity(),
        swirl(),
        pm.Drag("0.3*charge"),
        pm.Magnetic((0.1, 0.2, 9.0)),
        pm.Harmonic(40.0, on=[0, 2]),
        off,
    ]
    return pm.ParticleSystem(particles, forces)


def chains(bend: float = 0.05) -> pm.ParticleSystem:
    """Two chains, a particle alone, and every kind of element."""
    rng = np.random.default_rng(3)
    x = np.c_[np.arange(9) * 0.1, 0.02 * rng.standard_normal((9, 2))]
    particles = pm.Particles(x, m=rng.uniform(0.1, 0.3, 9))
    particles.pin([0, 5])
    pairs = [(0, 1), (1, 2), (2, 3), (5, 6), (6, 7)]
    return pm.ParticleSystem(
        particles,
        [
            pm.Gravity(),
            pm.Springs(pairs, 500.0, 1.0),
            pm.Angles([(0, 1, 2), (1, 2, 3)], 2.0, bend),
            swirl(),
            tether(pairs=[(7, 5), (1, 3)]),
            pm.Springs([(1, 3)], 5.0, enabled=False),
        ],
    )


def flow() -> pm.ParticleSystem:
    particles = pm.Particles(np.random.default_rng(2).uniform(-1, 1, (5, 3)))
    particles.pin([1])
    return pm.ParticleSystem(particles, [pm.Flow(("-2*y", "x + 0.2*sin(t)", "-60*z")), pm.Vortex(2.0, eps=0.3)])


ALONE = [(solver, make, False) for solver in SOLVERS for make in (cloud, flow)] + [(pm.BDF2, cloud, True)]


@pytest.mark.parametrize(("solver", "make", "jit"), ALONE)
def test_particles_alone_have_the_same_bits(solver: Any, make: Any, jit: bool) -> None:
    ours, theirs = make(), make()
    outcome, _ = advanced(ours, solver(), 20, jit=jit)
    engine = reference(theirs, solver(), 20)
    assert outcome.good
    assert ours.get_state().tobytes() == theirs.get_state().tobytes()
    assert outcome.stats.iterations == engine.stats.iterations > 0
    assert outcome.stats.cg_iterations == 0


@pytest.mark.parametrize(
    ("newton", "linear", "steps"), [("full", "auto", 100), ("full", "cg", 50), ("one", "auto", 50)]
)
@pytest.mark.parametrize("solver", SOLVERS)
def test_islands_agree_with_the_reference(solver: Any, newton: Any, linear: Any, steps: int) -> None:
    """By elimination also where damped bending makes the matrix anything but symmetric."""
    bend = 0.05 if (newton, linear) == ("full", "auto") else 0.0
    ours, theirs = chains(bend), chains(bend)
    outcome, memory = advanced(ours, solver(linear, newton, **SHARP), steps)
    engine = reference(theirs, solver(linear, newton, **SHARP), steps)
    assert outcome.good
    a, b = ours.get_state(), theirs.get_state()
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())
    alone = np.r_[12:15, 24:27, 39:42, 51:54]
    assert a[alone].tobytes() == b[alone].tobytes()
    assert a[:3].tobytes() == chains().get_state()[:3].tobytes()  # pinned
    assert (outcome.stats.cg_iterations > 0) == (engine.stats.cg_iterations > 0) == (bend == 0.0)
    assert outcome.stats.steps == engine.stats.steps
    if bend:
        assert outcome.stats.iterations == engine.stats.iterations
    for name, values in engine.memory.items():
        np.testing.assert_allclose(memory[name], values, rtol=0, atol=1e-10 * max(1, np.abs(values).max()))


def net() -> pm.ParticleSystem:
    """A square of springs that sags from two of its corners."""
    grid = np.arange(36).reshape(6, 6)
    ends = ((grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:]), (grid[:-1, :-1], grid[1:, 1:]))
    pairs = np.concatenate([np.c_[a.ravel(), b.ravel()] for a, b in ends])
    x = np.stack([grid % 6 / 6, 0.0 * grid, grid // 6 / 6], axis=-1).reshape(-1, 3)
    particles = pm.Particles(x, m=np.full(36, 0.02))
    particles.pin([0, 5])
    return pm.ParticleSystem(particles, [pm.Gravity(), pm.Drag(0.01), pm.Springs(pairs, 50.0, 0.05)])


def fabric() -> pm.ParticleSystem:
    """More than a block of particles, whose blocks are in runs and beside them, of both kinds."""
    side = 17
    grid = np.arange(side * side).reshape(side, side)
    ends = ((grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:]), (grid[:-1, :-1], grid[1:, 1:]))
    pairs = np.concatenate([np.c_[a.ravel(), b.ravel()] for a, b in ends])
    rng = np.random.default_rng(8)
    x = np.stack([grid % side / side, 0.0 * grid, grid // side / side], axis=-1).reshape(-1, 3)
    x[:, 1] = 0.05 * rng.uniform(-1, 1, len(x))
    particles = pm.Particles(x, m=rng.uniform(0.01, 0.02, len(x)))
    particles.pin([0, side - 1])
    forces = [pm.Gravity(), pm.Springs(pairs, 50.0, 0.05), pm.Springs(pairs[::3], 9.0), tether(pairs=pairs[::2])]
    return pm.ParticleSystem(particles, forces)


def carpet() -> pm.ParticleSystem:
    """The same with some on the ground, one of its forces switched off, and bending."""
    system = fabric()
    particles, grid = system.particles, np.arange(289).reshape(17, 17)
    bent = np.stack([grid[:, :-2], grid[:, 1:-1], grid[:, 2:]], axis=-1).reshape(-1, 3)
    system.forces[2].enabled = False
    lying = particles.x[:, 0] > 0.7
    particles.x[:, 1] += 0.2
    particles.x[lying, 1] = 0.0
    forces = [*system.forces, pm.Angles(bent, 0.01), pm.Drag(0.01)]
    return pm.ParticleSystem(particles, forces, [pm.Plane(friction=0.3)])


@pytest.mark.parametrize(
    ("make", "solver", "steps", "ways"),
    [
        (net, pm.ImplicitEuler("cg"), 5, [False]),
        (fabric, pm.ImplicitEuler(newton="one", cg_tolerance=1e-2), 1, [True]),
    ],
)
def test_compiled_kernels_give_the_bits_of_plain_python(make: Any, solver: Any, steps: int, ways: list[bool]) -> None:
    """Also where all threads work on one island, by conjugate gradients."""
    plain = make()
    outcome, _ = advanced(plain, solver, steps)
    assert outcome.good
    assert outcome.stats.cg_iterations > 0
    for parallel in ways:
        system = make()
        other, _ = advanced(system, solver, steps, parallel, jit=True)
        assert system.get_state().tobytes() == plain.get_state().tobytes()
        assert other.stats == outcome.stats


@pytest.mark.parametrize("make", [fabric, carpet])
def test_large_islands_agree_with_the_reference(make: Any) -> None:
    ours, theirs = make(), make()
    solver = pm.BDF2(newton="one", cg_tolerance=1e-13)
    outcome, _ = advanced(ours, solver, 2)
    reference(theirs, solver, 2)
    assert outcome.good
    np.testing.assert_allclose(ours.get_state(), theirs.get_state(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("newton", ["full", "one"])
def test_direct_means_direct(newton: Any) -> None:
    """Chains are eliminated, also for a single step; islands that are not narrow are left to the reference path."""
    ours, theirs = chains(), chains()
    solver = pm.ImplicitEuler("direct", newton, tolerance=1e-13)
    outcome, _ = advanced(ours, solver, 20)
    reference(theirs, solver, 20)
    assert outcome.good
    assert outcome.stats.cg_iterations == 0
    np.testing.assert_allclose(ours.get_state(), theirs.get_state(), rtol=0, atol=1e-12)
    assert not advanced(fabric(), solver, 1)[0].good


def test_a_run_may_be_cut_anywhere() -> None:
    """The memory carries the warm start and the history of BDF2 over."""
    whole, cut = chains(), chains()
    solver = pm.BDF2()
    advanced(whole, solver, 7)
    kernel = IslandKernel(cut, solver, False)
    kernel.__dict__["functions"] = store.plain(kernel.title, kernel.text, kernel.dtype)
    island, p, memory = cut.island_of_particle, cut.particles, solver.start(cut)
    rows = np.argsort(island, kind="stable")
    members = kernel.members(rows, island[rows])
    for first, count in ((0, 3), (3, 4)):
        x, v = p.x[rows].ravel(), p.v[rows].ravel()
        assert members.run(x, v, None, Span(0.0, DT, first, count), memory).good
        p.x[rows], p.v[rows] = x.reshape(-1, 3), v.reshape(-1, 3)
    assert cut.get_state().tobytes() == whole.get_state().tobytes()


def test_the_warm_start_saves_iterations_and_is_cleared_on_the_grid() -> None:
    def iterations(first: int, warm: bool) -> tuple[int, bytes]:
        system, solver = chains(0.0), pm.ImplicitEuler(newton="one", cg_tolerance=1e-4)
        _, memory = advanced(system, solver, 20)
        if not warm:
            memory["rise"][:] = 0.0
        kernel = IslandKernel(system, solver, False)
        kernel.__dict__["functions"] = store.plain(kernel.title, kernel.text, kernel.dtype)
        rows = np.argsort(system.island_of_particle, kind="stable")
        members = kernel.members(rows, system.island_of_particle[rows])
        x, v = system.particles.x[rows].ravel(), system.particles.v[rows].ravel()
        outcome = members.run(x, v, None, Span(-first * DT, DT, first, 1), memory)
        return outcome.stats.cg_iterations, x.tobytes()

    assert iterations(COLD, True) == iterations(COLD, False)
    assert iterations(COLD + 1, True)[0] <= iterations(COLD + 1, False)[0]
    assert iterations(COLD + 1, True)[1] != iterations(COLD + 1, False)[1]


def crumpled() -> pm.ParticleSystem:
    """A stiff net that is squeezed and folded: the matrix of a step is anything but positive definite."""
    system = net()
    p = system.particles
    p.x[:] = p.x * (0.6, 1.0, 0.6) + np.random.default_rng(4).normal(0, 0.02, p.x.shape)
    system.forces[2].set(k_s=500.0)
    return system


def test_folded_cloth_is_solved_with_less_of_what_pushes() -> None:
    """Also where several solutions are near: both paths end in some that solve the equations."""
    ours, theirs = crumpled(), crumpled()
    solver = pm.ImplicitEuler("cg", tolerance=1e-12, cg_tolerance=1e-6)
    before = ours.energy().total
    outcome, _ = advanced(ours, solver, 2)
    engine = reference(theirs, solver, 2)
    assert outcome.good
    assert outcome.stats.rejected == engine.stats.rejected == 0
    assert ours.energy().total < before
    np.testing.assert_allclose(ours.get_state(), theirs.get_state(), rtol=0, atol=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_step_that_is_not_solved_is_divided(solver: Any) -> None:
    """On both paths into the same parts; particles alone, which are solved, keep their whole step to the bit."""
    ours, theirs, exact = chains(), chains(), chains()
    hasty = solver(max_iterations=4)
    for system in (ours, theirs, exact):
        system.particles.v[1:4] = (0.0, 40.0, 0.0), (0.0, -30.0, 5.0), (0.0, 0.0, 60.0)
        system.forces[1].set(k_s=5e4)
    outcome, memory = advanced(ours, hasty, 2)
    engine = reference(theirs, hasty, 2)
    reference(exact, solver(), 2)
    assert outcome.good
    assert outcome.stats.rejected == engine.stats.rejected > 0
    assert outcome.stats.iterations == engine.stats.iterations
    a, b, c = ours.get_state(), theirs.get_state(), exact.get_state()
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * np.abs(b).max())
    alone = np.r_[12:15, 24:27, 39:42, 51:54]
    assert a[alone].tobytes() == b[alone].tobytes() == c[alone].tobytes()
    np.testing.assert_allclose(memory["rise"], engine.memory["rise"], rtol=0, atol=1e-6 * np.abs(b).max())


def test_pairs_that_know_where_they_are_have_blocks_of_their_own() -> None:
    forces = {type(f).__name__: f for f in chains().forces}
    assert is_relative(forces["Springs"])
    assert not is_relative(forces["tether"])
    assert not is_relative(forces["Angles"])


def test_equations_without_a_solution_are_reported() -> None:
    system = pm.ParticleSystem(pm.Particles([[1.0, 0, 0]]), [pm.Flow(("x*x + 1", "0", "0"))])
    outcome, _ = advanced(system, pm.ImplicitEuler(), 1, dt=10.0)
    assert not outcome.good


@pytest.mark.parametrize("make", [chains, cloud, flow])
def test_float32_stays_near(make: Any) -> None:
    theirs = make()
    p = theirs.particles
    charge = {"charge": p.column("charge")} if "charge" in p.attributes else {}
    single = pm.Particles(p.x, p.v, p.m, dtype="float32", **charge)
    single.pin(p.pinned)
    ours = pm.ParticleSystem(single, make().forces)
    outcome, _ = advanced(ours, pm.ImplicitEuler(), 10)
    reference(theirs, pm.ImplicitEuler(), 10)
    assert outcome.good
    np.testing.assert_allclose(ours.get_state(), theirs.get_state(), rtol=1e-3, atol=1e-3)


def test_a_stiff_cloth_hangs_by_its_pins() -> None:
    """K05: k_s h^2/m = 100, h = 1/30, 300 steps."""
    n, h, m = 10, 1 / 30, 0.01
    grid = np.arange(n * n).reshape(n, n)
    pairs = np.concatenate(
        [np.c_[a.ravel(), b.ravel()] for a, b in ((grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:]))]
    )
    x = np.stack([grid % n / n, 0.0 * grid, grid // n / n], axis=-1).reshape(-1, 3)
    particles = pm.Particles(x, m=np.full(n * n, m))
    particles.pin([0, n - 1])
    system = pm.ParticleSystem(particles, [pm.Gravity(), pm.Springs(pairs, 100 * m / h**2, 0.05)])
    outcome, _ = advanced(system, pm.ImplicitEuler(), 300, jit=True, dt=h)
    assert outcome.good
    assert particles.x[[0, n - 1]].tobytes() == x[[0, n - 1]].tobytes()
    assert np.isfinite(system.get_state()).all()
    assert system.stretch() < 0.2


def test_what_stands_on_the_ground_stays_there() -> None:
    """Resting contact, sliding and rebound: alone with the same bits, chains to the tolerances."""

    def scene() -> pm.ParticleSystem:
        x = np.array([[0, 0.0, 0], [1, 0.3, 0], [2, 0.0, 0], [2.1, 0.0, 0], [2.2, 0.02, 0]])
        v = np.array([[0.5, 0, 0], [0, 0, 0.2], [0.3, 0, 0], [0, 0, 0], [0, 0, 0.1]])
        particles = pm.Particles(x, v, np.full(5, 0.2))
        forces = [pm.Gravity(), pm.Drag(0.1), pm.Springs([(2, 3), (3, 4)], 80.0, 0.3)]
        return pm.ParticleSystem(particles, forces, [pm.Plane(friction=0.3, restitution=0.4)])

    ours, theirs = scene(), scene()
    outcome, _ = advanced(ours, pm.ImplicitEuler(**SHARP), 40)
    reference(theirs, pm.ImplicitEuler(**SHARP), 40)
    assert outcome.good
    a, b = ours.particles, theirs.particles
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.v, b.v, rtol=0, atol=1e-11)
    assert a.x[:2].tobytes() == b.x[:2].tobytes()
    assert a.v[:2].tobytes() == b.v[:2].tobytes()


@pytest.mark.parametrize("count", [13, 12], ids=["chain", "ring"])
def test_a_dozen_families_on_a_floor(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three jellies have as many, and some of their numbers once had the names of entries of matrices."""
    monkeypatch.setattr(store, "load", lambda *text: SimpleNamespace(**store.plain(*text)))

    def run(compiled: bool) -> pm.Particles:
        rng = np.random.default_rng(0)
        p = pm.Particles(np.abs(rng.normal(size=(count, 3))))
        families = [pm.Springs([(k, (k + 1) % count)], k_s=50.0 + k, k_d=0.5) for k in range(12)]
        system = pm.ParticleSystem(p, [pm.Gravity(), *families], [pm.Plane(friction=0.4, restitution=0.0)])
        pm.Simulation(system, pm.ImplicitEuler(**SHARP), DT, compiled=compiled).step(12)
        return p

    slow, fast = run(False), run(True)
    np.testing.assert_allclose(fast.x, slow.x, atol=1e-9)
    np.testing.assert_allclose(fast.v, slow.v, atol=1e-8)


def balls(box: tuple[float, float, float] | None = None) -> pm.ParticleSystem:
    """A heap of balls that overlap, some of them ends of springs, one pinned."""
    rng = np.random.default_rng(12)
    x = np.stack(np.meshgrid(*3 * [np.arange(4)], indexing="ij"), axis=-1).reshape(-1, 3) * 0.25
    x = x + rng.uniform(-0.05, 0.05, x.shape)
    particles = pm.Particles(x, rng.uniform(-1, 1, x.shape), rng.uniform(0.5, 2, 64), radius=rng.uniform(0.1, 0.18, 64))
    particles.pin([3])
    springs = pm.Springs(np.array([[0, 5], [9, 40], [60, 63]]), 30.0, 0.4, 0.2)
    return pm.ParticleSystem(particles, [pm.Gravity(), springs, pm.SoftSphere(400.0, 3.0, box=box)])


def magnets() -> pm.ParticleSystem:
    """A law that is not the same for both of a pair, and depends on their own places."""

    @pm.pair_force(cutoff=0.7, per_particle=["charge"])
    def lopsided(x1, v1, m1, x2, v2, m2, t, k=2.0, charge="charge"):
        d = pm.sub(x2, x1)
        pull = k * charge[1] * pm.inverse(0.1 + pm.dot(d, d)) - 0.3 * pm.dot(v1, d)
        return pm.add(pm.scale(pull, d), pm.scale(0.1, x1))

    rng = np.random.default_rng(13)
    particles = pm.Particles(rng.uniform(0, 1, (30, 3)), rng.uniform(-1, 1, (30, 3)), charge=rng.uniform(0.1, 1, 30))
    return pm.ParticleSystem(particles, [pm.Gravity(), pm.Drag(0.4), lopsided()])


def on_the_floor() -> pm.ParticleSystem:
    """Some of the balls stand on the ground."""
    system = balls()
    system.particles.x[:, 1] -= 0.1
    plane = pm.Plane(friction=0.3, restitution=0.0)
    return pm.ParticleSystem(system.particles, system.forces, [plane])


@pytest.mark.parametrize(
    ("make", "solver"),
    [
        (lambda: balls((1.2, 1.1, 1.0)), pm.BDF2),
        (magnets, pm.ImplicitEuler),
        (on_the_floor, pm.ImplicitEuler),
    ],
    ids=["box", "magnets", "floor"],
)
def test_pairs_agree_with_the_reference(make: Any, solver: Any) -> None:
    """The neighbours are found by the kernel, and change from step to step; balls leave and meet each other."""
    ours, theirs = make(), make()
    outcome, _ = advanced(ours, solver("cg", **SHARP), 6, jit=True)
    reference(theirs, solver("cg", **SHARP), 6)
    assert outcome.good
    np.testing.assert_allclose(ours.particles.x, theirs.particles.x, rtol=0, atol=1e-11)
    np.testing.assert_allclose(ours.particles.v, theirs.particles.v, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("force", "has"), [(pm.SoftSphere(), True), (pm.LennardJones(cutoff=0.5), True), (pm.Gravitation(), False)]
)
def test_pairs_within_a_cut_off_have_implicit_kernels(force: pm.Force, has: bool) -> None:
    particles = pm.Particles([[0, 0, 0], [0.3, 0, 0]], radius=0.2)
    system, solver = pm.ParticleSystem(particles, [force]), pm.ImplicitEuler()
    told = nullcontext() if has else pytest.warns(UserWarning, match="no kernel under implicit_euler: use leapfrog")
    with told:
        assert pm.Simulation(system, solver, DT, compiled=True).engine.compiled == has
