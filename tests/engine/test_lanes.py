"""Islands of one topology side by side: the bits of the reference, whoever is in the batch."""

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import lanes, store
from pointmass.engine.island import Span
from pointmass.engine.lanes import LanesKernel, runs, topologies
from pointmass.engine.reference import ReferenceEngine
from pointmass.solvers import SOLVERS

FIXED = ["euler", "symplectic_euler", "midpoint", "heun", "rk4", "leapfrog", "yoshida4"]
DT = 1 / 512


def strands(islands=10, nodes=5, dtype=np.float64, extra=()):
    """Strands of hair: pinned roots, stretch, bend and angle springs, and masses and lengths of their own."""
    rng = np.random.default_rng(1)
    x = np.zeros((islands, nodes, 3))
    x[:, :, 0] = 0.1 * np.arange(nodes)
    x += 0.01 * rng.standard_normal(x.shape)
    m = rng.uniform(0.5, 1.5, islands * nodes)
    particles = pm.Particles(x.reshape(-1, 3), 0.1 * rng.standard_normal((islands * nodes, 3)), m, dtype=dtype)
    particles.tag("odd", np.arange(islands * nodes) % 2 == 1)
    particles.pin(np.arange(islands) * nodes)
    start = nodes * np.arange(islands)[:, None, None]

    def elements(*offsets):
        base = np.arange(nodes - max(offsets))
        return (np.stack([base + o for o in offsets], axis=1)[None] + start).reshape(-1, len(offsets))

    stiff = np.tile(rng.uniform(20, 40, nodes - 2), islands)
    forces = [
        pm.Springs(elements(0, 1), 50.0, 0.3),
        pm.Gravity(),
        pm.Drag(k="0.1*m"),
        pm.Springs(elements(2, 0), stiff, lambda t: 0.2 + 0.1 * pm.sin(9 * t), rest=0.21),
        pm.Gravity((1, 0, 0), on="odd"),
        pm.Angles(elements(0, 1, 2), 0.01, 1e-4),
        *extra,
    ]
    return pm.ParticleSystem(particles, forces)


def group(system, solver, order=None, jit=True):
    """The members, and their particles in the order of the lanes."""
    islands = len(system.particles) // 5
    order = np.arange(islands) if order is None else order
    rows = np.arange(len(system.particles)).reshape(islands, -1)[order].ravel()
    (topology,) = topologies(system, rows, np.repeat(order, 5))
    assert LanesKernel.fits(system, solver)
    kernel = LanesKernel(system, solver, topology)
    if not jit:
        kernel.functions = store.plain(kernel.title, kernel.text, kernel.dtype)
    return kernel.members(topology), topology.rows.ravel()


def moved(system, solver, spans, order=None, jit=False):
    """Positions and velocities after steps, of the particles in their own order."""
    members, rows = group(system, solver, order, jit)
    x, v = (np.ascontiguousarray(q[rows]).ravel() for q in (system.particles.x, system.particles.v))
    for begin, end in spans:
        outcome = members.run(x, v, None, Span(0.0, DT, begin, end - begin), {})
        assert outcome.good
        np.testing.assert_array_equal(outcome.reach, [np.abs(x).max(), np.abs(v).max()])
    back = np.argsort(rows)
    return x.reshape(-1, 3)[back], v.reshape(-1, 3)[back]


def expected(system, solver, steps):
    engine = ReferenceEngine(system, solver)
    for k in range(steps):
        engine.step(k * DT, (k + 1) * DT)
    return system.particles.x, system.particles.v


@pytest.mark.parametrize("name", FIXED)
def test_has_the_bits_of_the_reference(name):
    system, solver = strands(9, 5), SOLVERS[name]()
    x, v = moved(system, solver, [(0, 2)])
    for got, wanted in zip((x, v), expected(system, solver, 2), strict=True):
        np.testing.assert_array_equal(got, wanted)


def test_many_elements_are_a_loop(monkeypatch):
    monkeypatch.setattr(lanes, "UNROLLED", 10)
    system, solver = strands(9, 5), pm.Leapfrog()
    assert len(group(system, solver)[0].kernel.staged) == 3
    x, v = moved(system, solver, [(0, 2)])
    for got, wanted in zip((x, v), expected(system, solver, 2), strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize(("dtype", "tolerance", "staged"), [(np.float64, 1e-12, True), (np.float32, 1e-4, False)])
def test_compiled_it_agrees_over_100_steps(monkeypatch, dtype, tolerance, staged):
    if staged:
        monkeypatch.setattr(lanes, "UNROLLED", 10)
    system, solver = strands(70, 5, dtype), pm.SymplecticEuler()
    x, v = moved(system, solver, [(0, 100)], jit=True)
    for got, wanted in zip((x, v), expected(system, solver, 100), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_bits_depend_on_no_thread_batch_order_or_span(dtype):
    solver = pm.SymplecticEuler()
    system = strands(70, 5, dtype)
    x, v = moved(system, solver, [(0, 100)], jit=True)
    shuffled = np.random.default_rng(0).permutation(70)
    most = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        one = moved(system, solver, [(0, 100)], jit=True)
    finally:
        numba.set_num_threads(most)
    variants = [one, moved(system, solver, [(0, 1), (1, 40), (40, 100)], jit=True)]
    variants.append(moved(system, solver, [(0, 100)], shuffled, jit=True))
    for xs, vs in variants:
        np.testing.assert_array_equal(xs, x)
        np.testing.assert_array_equal(vs, v)
    rows = np.arange(60, 105)
    few = moved(system, solver, [(0, 100)], np.arange(12, 21), jit=True)
    np.testing.assert_array_equal(few[0], x[rows])
    np.testing.assert_array_equal(few[1], v[rows])


@pytest.mark.parametrize("staged", [False, True])
def test_vectors(monkeypatch, staged):
    if not pytest.importorskip("llvmlite.binding").get_host_cpu_features().get("avx2"):
        pytest.skip("this machine has no AVX2")
    monkeypatch.setattr(lanes, "UNROLLED", 10 if staged else 10_000)
    kernel = group(strands(70, 5, np.float32), pm.SymplecticEuler())[0].kernel
    source = (
        store.complete("lanes", kernel.text, kernel.dtype)
        .replace('"cache": True', '"cache": False')
        .replace("**FLAGS", "**ENTRY")
    )
    scope = {}
    exec(compile(source, "<lanes>", "exec"), scope)
    s, g = np.ones(kernel.scratch.rows * kernel.width, np.float32), np.ones(9 * kernel.width, np.float32)
    elements = [f.nodes.ravel() for j, f in enumerate(kernel.families) if j in kernel.staged]
    scope["phase0"](s, np.float32(0.1))
    scope["deriv"](s, g, kernel.binder.numbers.array(), *elements, 0.0)
    assert _wide(scope["deriv"], "vsqrtps") >= len(kernel.families)
    assert _wide(scope["phase0"], "mulps") >= 1 or _wide(scope["phase0"], "vfm") >= 1
    assert not any(_wide(scope[name], "scatter") for name in ("deriv", "phase0"))


def _wide(function, operation):
    """How many instructions of a kind work on 8 or 16 numbers."""
    lines = "\n".join(function.inspect_asm().values()).split("\n")
    return sum(operation in line and ("%ymm" in line or "%zmm" in line) for line in lines)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_island_that_diverges_is_noticed():
    system = strands(9, 5)
    members, _ = group(system, pm.Euler(), jit=False)
    x, v = system.particles.x.ravel().copy(), system.particles.v.ravel().copy()
    v[3 * 5 * 4 + 7] = np.inf
    outcome = members.run(x, v, None, Span(0.0, DT, 0, 1), {})
    assert not outcome.good


def test_a_function_of_time_out_of_bounds_is_noticed():
    system = strands(9, 5)
    system.forces[0].set(k_s=lambda t: 1 - 1000 * t)
    members, _ = group(system, pm.Euler(), jit=False)
    x, v = system.particles.x.ravel().copy(), system.particles.v.ravel().copy()
    assert members.run(x, v, None, Span(0.0, DT, 0, 1), {}).good
    assert not members.run(x, v, None, Span(0.0, DT, 0, 2), {}).good


def test_what_does_not_fit():
    system = strands(9, 5)
    assert LanesKernel.fits(system, pm.RK4())
    assert LanesKernel.fits(system, pm.DormandPrince(adaptive=False))
    assert not LanesKernel.fits(system, pm.DormandPrince())
    assert not LanesKernel.fits(system, pm.ImplicitEuler())
    assert not LanesKernel.fits(pm.ParticleSystem(strands(9, 5).particles, [pm.Gravity()], [pm.Plane()]), pm.RK4())
    assert not LanesKernel.fits(pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Flow((1, 0, 0))]), pm.RK4())


def test_islands_by_topology():
    pairs = [(3 * k + a, 3 * k + b) for k in range(20) for a, b in (((0, 1), (1, 2)) if k % 2 else ((1, 2), (0, 1)))]
    system = pm.ParticleSystem(pm.Particles(np.zeros((64, 3))), [pm.Springs([*pairs, (60, 61)]), pm.Gravity()])
    labels = system.island_of_particle
    order = np.argsort(labels, kind="stable")
    odd, even = sorted(topologies(system, order, labels[order]), key=lambda t: -t.rows[0, 0])
    np.testing.assert_array_equal(even.rows, [[6 * k, 6 * k + 1, 6 * k + 2] for k in range(10)])
    np.testing.assert_array_equal(odd.families[0].nodes, [(0, 1), (1, 2)])
    np.testing.assert_array_equal(even.families[0].own, [[4 * k, 4 * k + 1] for k in range(10)])


def test_runs_follow_each_other_at_even_distances():
    nodes = np.array([(0, 1), (1, 2), (2, 3), (7, 5), (1, 0), (3, 4), (5, 8)], np.int32)
    found = runs(nodes)
    rebuilt = [np.array(r.nodes) + e * np.array(r.strides) for r in found for e in range(r.count)]
    np.testing.assert_array_equal(rebuilt, nodes)
    assert [r.count for r in found] == [3, 1, 3]
