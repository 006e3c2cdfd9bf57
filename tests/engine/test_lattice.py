"""A grid of particles by rows: the bits of the reference, whatever the tiles, the threads and the spans."""

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import lattice, store
from pointmass.engine.island import Span
from pointmass.engine.lattice import LatticeKernel, grid
from pointmass.engine.reference import ReferenceEngine
from pointmass.solvers import SOLVERS

FIXED = ["euler", "symplectic_euler", "midpoint", "heun", "rk4", "leapfrog", "yoshida4"]
DT = 1e-4


def sheet(m=17, n=19, dtype=np.float64, *, turned=False):
    """A cloth of unequal masses, with stretch, shear and bend springs and a force on three particles at a time."""
    rng = np.random.default_rng(2)
    number = np.arange(m * n).reshape(m, n)
    x = np.zeros((m * n, 3))
    x[:, 0], x[:, 1] = number.ravel() // n / n, number.ravel() % n / n
    x += 0.1 / n * rng.standard_normal(x.shape)
    particles = pm.Particles(x, rng.standard_normal(x.shape), rng.uniform(0.5, 1.5, m * n) / (m * n), dtype=dtype)
    particles.tag("left", number[:, :5].ravel())
    particles.pin([0, n - 1])
    i = number
    stretch = np.concatenate([_pairs(i[:, :-1], i[:, 1:]), _pairs(i[:-1], i[1:])])
    shear = np.stack([_pairs(i[:-1, :-1], i[1:, 1:]), _pairs(i[1:, :-1], i[:-1, 1:])], axis=1).reshape(-1, 2)
    bend = np.concatenate([_pairs(i[:, 2:], i[:, :-2]), _pairs(i[:-2], i[2:])])
    if turned:
        stretch = stretch[rng.permutation(len(stretch))]
    forces = [
        pm.Springs(stretch, rng.uniform(20, 40, len(stretch)), 0.001),
        pm.Gravity((0, 0, -9.81)),
        pm.Springs(shear, 10.0, lambda t: 0.001 * (1 + pm.sin(99 * t))),
        pm.Drag(k="0.1*m"),
        pm.Springs(bend, 5.0),
        pm.Gravity((1, 0, 0), on="left"),
        pm.Angles(np.stack([i[:, :-2].ravel(), i[:, 1:-1].ravel(), i[:, 2:].ravel()], axis=1), 1e-5),
    ]
    return pm.ParticleSystem(particles, forces)


def _pairs(a, b):
    return np.stack([a.ravel(), b.ravel()], axis=1)


def group(system, solver, jit=True):
    found = grid(system, np.arange(len(system.particles)))
    assert LatticeKernel.fits(system, solver)
    kernel = LatticeKernel(system, solver, found)
    if not jit:
        kernel.functions = store.plain(kernel.title, kernel.text, kernel.dtype)
    return kernel.members(found)


def moved(system, solver, spans, jit=False, threads=None):
    """Positions and velocities after steps."""
    members = group(system, solver, jit)
    x, v = system.particles.x.ravel().copy(), system.particles.v.ravel().copy()
    most = numba.get_num_threads()
    numba.set_num_threads(threads or most)
    try:
        for begin, end in spans:
            outcome = members.run(x, v, None, Span(0.0, DT, begin, end - begin), {})
            assert outcome.good
            np.testing.assert_array_equal(outcome.reach, [np.abs(x).max(), np.abs(v).max()])
    finally:
        numba.set_num_threads(most)
    return x.reshape(-1, 3), v.reshape(-1, 3)


def expected(system, solver, steps):
    engine = ReferenceEngine(system, solver)
    for k in range(steps):
        engine.step(k * DT, (k + 1) * DT)
    return system.particles.x, system.particles.v


@pytest.mark.parametrize("name", FIXED)
def test_has_the_bits_of_the_reference(name):
    system, solver = sheet(), SOLVERS[name]()
    got = moved(system, solver, [(0, 2)])
    for mine, wanted in zip(got, expected(system, solver, 2), strict=True):
        np.testing.assert_array_equal(mine, wanted)


def test_elements_in_any_order():
    system, solver = sheet(turned=True), pm.SymplecticEuler()
    got = moved(system, solver, [(0, 2)])
    for mine, wanted in zip(got, expected(system, solver, 2), strict=True):
        np.testing.assert_allclose(mine, wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-4)])
def test_compiled_it_agrees_over_100_steps(dtype, tolerance):
    system, solver = sheet(70, 81, dtype), pm.SymplecticEuler()
    got = moved(system, solver, [(0, 100)], jit=True)
    scale = np.maximum(1, np.abs(system.particles.v).max())
    for mine, wanted in zip(got, expected(system, solver, 100), strict=True):
        np.testing.assert_allclose(mine, wanted, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_bits_depend_on_no_thread_tile_or_span(monkeypatch, dtype):
    system, solver = sheet(70, 81, dtype), pm.SymplecticEuler()
    x, v = moved(system, solver, [(0, 21)], jit=True)
    variants = [moved(system, solver, [(0, 21)], jit=True, threads=1)]
    variants.append(moved(system, solver, [(0, 1), (1, 7), (7, 21)], jit=True))
    monkeypatch.setattr(lattice, "HEIGHT", 16)
    variants.append(moved(system, solver, [(0, 21)], jit=True))
    for xs, vs in variants:
        np.testing.assert_array_equal(xs, x)
        np.testing.assert_array_equal(vs, v)


def test_vectors():
    if not pytest.importorskip("llvmlite.binding").get_host_cpu_features().get("avx2"):
        pytest.skip("this machine has no AVX2")
    kernel = group(sheet(70, 81, np.float32), pm.SymplecticEuler()).kernel
    source = (
        store.complete("lattice", kernel.text, kernel.dtype)
        .replace('"cache": True', '"cache": False')
        .replace("**FLAGS", "**ENTRY")
    )
    scope = {}
    exec(compile(source, "<lattice>", "exec"), scope)
    parts = np.ones((kernel.reach + 4, kernel.scratch(4)), np.float32)
    scope["row"](*parts, kernel.binder.numbers.array(), 0.0, 0, 70, True)
    scope["phase0"](*parts[:2], np.float32(0.1))
    assert _wide(scope["row"], "vsqrtps") >= len(kernel.grid.stencils)
    assert _wide(scope["phase0"], "mulps") >= 1 or _wide(scope["phase0"], "vfm") >= 1
    assert not any(_wide(scope[name], "scatter") for name in ("row", "phase0"))


def _wide(function, operation):
    """How many instructions of a kind work on 8 or 16 numbers."""
    lines = "\n".join(function.inspect_asm().values()).split("\n")
    return sum(operation in line and ("%ymm" in line or "%zmm" in line) for line in lines)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_sheet_that_diverges_is_noticed():
    system = sheet()
    x, v = system.particles.x.ravel().copy(), system.particles.v.ravel().copy()
    v[100] = np.inf
    assert not group(system, pm.Euler(), jit=False).run(x, v, None, Span(0.0, DT, 0, 1), {}).good


def test_a_function_of_time_out_of_bounds_is_noticed():
    system = sheet()
    system.forces[2].set(k_d=lambda t: 1 - 1.5e4 * t)
    x, v = system.particles.x.ravel().copy(), system.particles.v.ravel().copy()
    members = group(system, pm.Euler(), jit=False)
    assert members.run(x, v, None, Span(0.0, DT, 0, 1), {}).good
    assert not members.run(x, v, None, Span(0.0, DT, 0, 2), {}).good


def test_what_does_not_fit():
    system = sheet()
    assert LatticeKernel.fits(system, pm.BogackiShampine(adaptive=False))
    assert not LatticeKernel.fits(system, pm.BogackiShampine())
    assert not LatticeKernel.fits(system, pm.ImplicitEuler())
    everybody = np.arange(len(system.particles))
    pairs = system.forces[4].ids
    assert grid(pm.ParticleSystem(system.particles, [pm.Springs(pairs)]), everybody).n == 19
    assert grid(pm.ParticleSystem(system.particles, [pm.Springs(pairs[1:])]), everybody) is None
    assert grid(pm.ParticleSystem(system.particles, [pm.Springs([*pairs, (0, 300)])]), everybody) is None
    assert grid(pm.ParticleSystem(system.particles, [pm.Springs([*pairs, pairs[0]])]), everybody) is None
    assert grid(pm.ParticleSystem(system.particles, [pm.Gravity()]), everybody) is None


def test_a_force_of_another_island_leaves_a_grid_a_grid():
    """A pole beside a flag."""
    cloth = sheet()
    p = cloth.particles
    ends = p.add([[5, 0, 0], [5, 1, 0]])
    system = pm.ParticleSystem(p, [*cloth.forces, pm.Springs([ends])])
    assert grid(system, np.arange(17 * 19)) is not None
    pm.Simulation(system, "symplectic_euler", DT, compiled=True).prepare()
