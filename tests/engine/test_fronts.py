"""Grids whose elements are relaxed row by row: the bits of the reference, whatever the bands and the threads."""

from functools import cache

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import engine, store
from pointmass.engine.dealt import Dealt, decks_of, fits
from pointmass.engine.engine import Engine
from pointmass.engine.island import IslandKernel
from pointmass.forces.hinges import Hinges
from pointmass.laws import stencils

DT = 1 / 500


@pytest.fixture(autouse=True)
def _also_small_grids(monkeypatch):
    monkeypatch.setattr(engine, "DEALT", 1)


@pytest.fixture
def as_python(monkeypatch):
    """Kernels run as the plain Python that they are."""
    loaded = cache(store.plain)
    monkeypatch.setattr(IslandKernel, "functions", property(lambda k: loaded(k.title, k.text, k.dtype)))


def sheet(m=17, n=19, floor=False, dtype=np.float64, angles=True):
    """A cloth of unequal masses in motion, with springs of all kinds, and angles instead of bend springs along rows."""
    rng = np.random.default_rng(2)
    i = np.arange(m * n).reshape(m, n)
    x = np.stack([i.ravel() // n / n, i.ravel() % n / n, np.zeros(m * n)], axis=1) + 0.01 * rng.random((m * n, 3))
    p = pm.Particles(x, rng.standard_normal(x.shape), rng.uniform(0.5, 1.5, m * n) / (m * n), dtype=dtype)
    p.pin([0, n - 1])
    stretch = np.concatenate([_pairs(i[:, :-1], i[:, 1:]), _pairs(i[:-1], i[1:])])
    shear = np.stack([_pairs(i[:-1, :-1], i[1:, 1:]), _pairs(i[1:, :-1], i[:-1, 1:])], axis=1).reshape(-1, 2)
    bend = _pairs(i[:-2], i[2:])
    if not angles:
        bend = np.concatenate([bend, _pairs(i[:, 2:], i[:, :-2])])
    forces = [
        pm.Springs(stretch, rng.uniform(20, 40, len(stretch)), 0.01),
        pm.Gravity((0, 0, -9.81)),
        pm.Springs(shear, 10.0, lambda t: 0.01 * (1 + pm.sin(99 * t))),
        pm.Drag(k="0.1*m"),
        pm.Springs(bend, 5.0),
    ]
    if angles:
        forces.append(pm.Angles(np.stack([i[:, :-2].ravel(), i[:, 1:-1].ravel(), i[:, 2:].ravel()], axis=1), 1e-5))
    floors = [pm.Plane((0, 0, -0.002), (0, 0, 1), restitution=0.1, friction=0.4)] if floor else []
    return pm.ParticleSystem(p, forces, floors)


def _pairs(a, b):
    return np.stack([a.ravel(), b.ravel()], axis=1)


def moved(system, iterations, steps, compiled, bands=None):
    """Positions and velocities after steps."""
    sim = pm.Simulation(system, pm.XPBD(iterations), DT, compiled=compiled)
    if compiled:
        (group,) = sim.engine._grouped(None)
        assert group.members.kernel.dealt is not None
        if bands is not None:
            n = len(system.particles)
            group.members.tiling = n * np.arange(bands + 1) // bands
    sim.step(steps)
    return system.particles.x, system.particles.v


def same(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.filterwarnings("ignore:overflow")  # rows before others, as unsigned numbers
@pytest.mark.usefixtures("as_python")
@pytest.mark.parametrize("iterations", [1, 3])
@pytest.mark.parametrize("floor", [False, True])
def test_has_the_bits_of_the_reference(iterations, floor):
    one, other = (moved(sheet(floor=floor), iterations, 3, compiled) for compiled in (True, False))
    same(one, other)
    assert not floor or (one[0][:, 2] >= -0.0021).all()  # some have met the floor
    assert not floor or one[0][:, 2].min() < -0.0019


@pytest.mark.usefixtures("as_python")
def test_bands_do_not_matter():
    """Three bands, each of which leaves out ten rows at an inner end."""
    one, *others = (moved(sheet(64, 16), 2, 2, True, bands) for bands in (1, 2, 3))
    for other in others:
        same(one, other)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_compiled_bits_do_not_depend_on_threads(dtype):
    found, most = [], numba.get_num_threads()
    for threads in dict.fromkeys((most, 1)):
        numba.set_num_threads(threads)
        try:
            found.append(moved(sheet(60, 40, dtype=dtype, angles=False), 2, 8, True))
        finally:
            numba.set_num_threads(most)
    for other in found[1:]:
        same(found[0], other)
    exact = moved(sheet(60, 40, angles=False), 2, 8, False)
    if dtype == np.float64:
        same(found[0], exact)
    np.testing.assert_allclose(found[0][0], exact[0], rtol=0, atol=1e-5)


def test_every_colour_is_a_vector():
    """A loop that meets a number as two nodes would be done one by one."""
    if not pytest.importorskip("llvmlite.binding").get_host_cpu_features().get("avx2"):
        pytest.skip("this machine has no AVX2")
    cloth = pm.cloth(40, 40, pinned="top corners")
    system = pm.ParticleSystem(pm.Particles(cloth.particles.x, dtype=np.float32), cloth.forces)
    (group,) = Engine(system, pm.XPBD(2), True)._grouped(None)
    kernel = group.members.kernel
    source = store.complete("fronts", kernel.text, kernel.dtype)
    source = source.replace('"cache": True', '"cache": False').replace(
        "@njit(**FLAGS)\ndef stage", "@njit(**ENTRY)\ndef stage"
    )
    scope = {}
    exec(compile(source, "<fronts>", "exec"), scope)
    rows, _ = kernel.dealt.arrays(system.particles.w)
    for k in range(len(kernel.dealt.grid.stencils)):
        stage = scope[f"stage{k}"]
        stage(3, rows, kernel.deriv.binder.numbers.array(), np.zeros((1, 1600), np.float32), 0.0, np.float32(0.01))
        lines = "\n".join(stage.inspect_asm().values()).split("\n")
        assert any("vsqrtps" in line and ("%ymm" in line or "%zmm" in line) for line in lines)
        assert not any("vsqrtss" in line or "gather" in line or "scatter" in line for line in lines)


STENCILS = {
    "along": ([(0, 0), (0, 1)], 2),
    "down by two": ([(0, 0), (2, 0)], 2),
    "along by three": ([(0, 0), (0, 3)], 2),
    "diagonal": ([(0, 1), (1, 0)], 2),
    "angle": ([(0, 0), (0, 1), (0, 2)], 3),
    "angle down": ([(0, 0), (1, 0), (2, 0)], 3),
    "hinge": ([(0, 1), (1, 0), (0, 0), (1, 1)], 4),
}


@pytest.mark.parametrize("name", STENCILS)
def test_no_two_elements_of_a_colour_share_a_particle(name):
    shifts, most = STENCILS[name]
    m, n = 18, 17
    down, right = (max(s[k] for s in shifts) for k in (0, 1))
    number = np.arange(m * n).reshape(m, n)
    nodes = np.stack([number[r : m - down + r, c : n - right + c].ravel() for r, c in shifts], axis=1)
    own = np.arange(len(nodes)).reshape(m - down, n - right)
    kind = {2: pm.Springs, 3: pm.Angles, 4: Hinges}[len(shifts)]
    colours = stencils.Stencil(kind(nodes, 1.0), tuple(shifts), own).colours()
    assert set(colours.ravel().tolist()) == set(range(most))
    for colour in range(most):
        taken = nodes[own[colours == colour]].ravel()
        assert len(taken) == len(np.unique(taken))


def test_decks():
    """Rows of 19 by turns of 6: springs by two, angles by three."""
    system = sheet()
    forces = [f for f in system.forces if isinstance(f, (pm.Springs, pm.Angles))]
    found = stencils.grid(forces, system.particles, np.arange(17 * 19))
    assert fits(found)
    assert decks_of(found) == 6
    dealt = Dealt(found, np.float64, projected=False, noting=False, led=False)
    rows = dealt.arrays(system.particles.w)[0].reshape(17, dealt.components, dealt.width)
    w = system.particles.w.reshape(17, 19)
    for c in range(19):
        np.testing.assert_array_equal(rows[:, 6, c % 6 * dealt.lanes + c // 6], w[:, c])
    assert (rows[:, 6] != 0).sum() == 17 * 19 - 2
    number = np.arange(17 * 19).reshape(17, 19)
    apart = pm.Springs(_pairs(number[:, :-2], number[:, 2:]), 1.0)
    assert not fits(stencils.grid([*forces, apart], system.particles, np.arange(17 * 19)))  # 12 decks
