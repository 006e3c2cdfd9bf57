"""Kernels of pair forces against the slow obvious versions, the reference columns, and themselves."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.engine import store
from pointmass.engine.binding import Binder, Table
from pointmass.engine.pairs import FULL, TILES, PairArrays, Pairs

sys.path.append(str(Path(__file__).parents[1]))
import naive

TIME = 0.3


def pressure(sums: Any, x: Any, v: Any, m: Any, t: Any, stiffness: Any) -> Any:
    gradient, drift = pm.scale(stiffness * sums[0], sums[1:4]), pm.scale(m * t, sums[4:7])
    return pm.sub(pm.add(gradient, drift), pm.scale(0.1, pm.add(x, v)))


@pm.pair_force(finish=pressure)
def fluid(x1, v1, m1, x2, v2, m2, t, stiffness=2.0, cutoff=0.4):
    d = x1 - x2
    q = 1 - pm.dot(d, d) / (cutoff * cutoff)
    return m2 * q**3, m2 * q * q * d, q * (v2 - v1)


@pm.pair_force(per_particle=["charge"])
def coulomb(x1, v1, m1, x2, v2, m2, t, k=1.0, charge="charge*(1 + t)"):
    d = x1 - x2
    return k * charge[0] * charge[1] * pm.inverse(pm.length(d) ** 3) * d


@pm.pair_force
def drawn_along(x1, v1, m1, x2, v2, m2, t, strength=2.0):
    """Not the same for both."""
    weight = strength * m2 * m2 / (1 + pm.dot(x1, x1) * pm.length(x2 - x1))
    return pm.add(pm.scale(weight, v2), pm.scale(t, x1))


CASES = {
    "drawn along": drawn_along,
    "gravitation": lambda: pm.Gravitation(G="1 + t", eps=0.05),
    "singular": pm.Gravitation,
    "selection": lambda: pm.Gravitation(eps=0.05, on=slice(1, None, 3)),
    "vortices": lambda: pm.PointVortices("charge", eps=0.01),
    "own law": lambda: coulomb(k="1 + t"),
    "column": lambda: coulomb(charge=np.linspace(-1, 1, 20).tolist()),
    "cut-off": lambda: coulomb(cutoff=0.5),
    "some within a cut-off": lambda: coulomb(cutoff=0.5, on=slice(1, None, 3)),
    "box": lambda: coulomb(cutoff=0.5, box=(1.0, 1.3, 1.7)),
    "large box": lambda: coulomb(cutoff=0.3, box=(3.0, 3.0, 3.0)),
    "finish": fluid,
    "lennard_jones": lambda: pm.LennardJones(sigma=0.2),
    "soft_sphere": lambda: pm.SoftSphere(k_d=2.0),
    "points": lambda: pm.SoftSphere(radius=0.0),
    "one way": lambda: drawn_along(on=slice(0, 12), by=slice(8, None, 2)),
    "by all": lambda: drawn_along(on=[3, 5, 6], by=slice(None)),
    "one way within a cut-off": lambda: fluid(on=slice(0, 12), by=slice(8, None, 2)),
    "one way in a box": lambda: coulomb(cutoff=0.5, box=(1.0, 1.3, 1.7), on=slice(6, None), by=[2, 3, 11]),
    "by nobody": lambda: fluid(by=[]),
}


def cloud(n: int, dtype: Any, seed: int = 0) -> pm.Particles:
    """Particles at least a little apart, some far outside of the unit box."""
    rng = np.random.default_rng(seed)
    x = rng.permutation(np.stack(np.meshgrid(*[np.arange(12)] * 3), axis=-1).reshape(-1, 3))[:n] / 8
    x = x + rng.uniform(-0.03, 0.03, x.shape)
    return pm.Particles(
        x,
        rng.standard_normal((n, 3)),
        rng.uniform(1, 2, n),
        rng.uniform(0.05, 0.1, n),
        charge=rng.uniform(-1, 1, n),
        dtype=dtype,
    )


class Kernel:
    """The kernel of one force, with rows in an order of its own."""

    def __init__(self, force: Any, p: pm.Particles, parallel: bool = True, plain: bool = False) -> None:
        force.bind(p)
        self.p, self.force = p, force
        self.order = np.random.default_rng(1).permutation(len(p))
        place = np.empty(len(p), np.intp)
        place[self.order] = np.arange(len(p))
        binder = Binder(p, Table("C"))
        self.pairs = Pairs(force, 3, binder, parallel)
        text = self.pairs.text.replace("**OWNING", "**OWNING_ENTRY")  # called from Python here
        made = (store.plain if plain else store.load)("pairs", text, str(p.dtype))
        self.function = (made if plain else vars(made))["pairs3"]
        self.arrays = PairArrays(self.pairs, p, place)
        self.data = binder.data(len(p), self.order)

    def __call__(self) -> np.ndarray:
        x, v = (np.ascontiguousarray(a[self.order]).ravel() for a in (self.p.x, self.p.v))
        status = FULL
        while status == FULL:
            arrays = self.arrays.arrays()
            with np.errstate(all="ignore"):
                status = self.function(0, 0, len(self.arrays.rows), *self.data, *arrays, TIME, x, v)
            if status == FULL:
                self.arrays.enlarge()
        assert status == 0
        f = np.empty_like(self.p.x)
        f[self.order] = arrays[2].reshape(-1, 3)
        return f


def reference(force: Any, p: pm.Particles) -> np.ndarray:
    force.bind(p)
    f = np.zeros_like(p.x)
    force.add_forces(p, TIME, p.x, p.v, f)
    return f


def close(f: np.ndarray, want: np.ndarray, tolerance: float) -> None:
    np.testing.assert_allclose(f, want, rtol=0, atol=tolerance * max(np.abs(want).max(), 1e-30))


@pytest.mark.parametrize("case", CASES)
def test_loops_of_all_threads_are_found_by_numba(case: str) -> None:
    """It takes a `prange` for a plain loop, without a word, where there is a choice in its argument."""
    text = Kernel(CASES[case](), cloud(20, "float32"), plain=True).pairs.text
    loops = re.findall(r"prange\((.*)\):", text)
    assert len(loops) > 1
    assert not [loop for loop in loops if " if " in loop]


@pytest.mark.parametrize("parallel", [True, False])
@pytest.mark.parametrize(("dtype", "tolerance"), [("float64", 1e-13), ("float32", 1e-5)])
@pytest.mark.parametrize("case", CASES)
def test_text_run_as_plain_python(case: str, dtype: str, tolerance: float, parallel: bool) -> None:
    force, p = CASES[case](), cloud(20, dtype)
    f = Kernel(force, p, parallel, plain=True)()
    assert f.dtype == p.dtype
    close(f, reference(force, p), tolerance)


@pytest.mark.parametrize(("count", "teams"), [(2, 32), (8, 32), (20, 32), (27, 32), (27, 2), (36, 3)])
@pytest.mark.parametrize("case", ["gravitation", "singular", "selection", "vortices", "own law", "drawn along"])
def test_tiles_meet_each_other_once(case: str, count: int, teams: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TILES, True, 8)
    monkeypatch.setattr("pointmass.engine.pairs.TEAMS", teams)
    force, p = CASES[case](), cloud(count, "float64")
    close(Kernel(force, p, plain=True)(), reference(force, p), 1e-13)


def test_equals_the_plain_version_of_the_law() -> None:
    box = (1.1, 1.2, 1.3)
    p = cloud(20, "float64")
    f = Kernel(pm.LennardJones(sigma=0.2, box=box), p, plain=True)()
    state = type("State", (), {"x": p.x.tolist(), "v": p.v.tolist(), "m": p.m.tolist()})
    numbers = {"epsilon": 1.0, "sigma": 0.2, "cutoff": 0.5, "box": box}
    close(f, np.array(naive.over_pairs(naive.lennard_jones, state, lambda i: numbers)), 1e-13)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", ["gravitation", "finish", "box", "one way", "one way within a cut-off"])
def test_compiled_gives_the_bits_of_any_number_of_threads(case: str, dtype: str) -> None:
    import numba

    force, p = CASES[case](), cloud(700, dtype)
    kernel = Kernel(force, p)
    before = numba.get_num_threads()
    try:
        found = []
        for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(threads)
            if kernel.pairs.near:
                kernel.arrays.forget()
            found.append(kernel().copy())
    finally:
        numba.set_num_threads(before)
    np.testing.assert_array_equal(found[0], found[1])
    close(found[0], reference(force, p), 1e-13 if dtype == "float64" else 1e-5)


def test_neighbours_are_kept_until_somebody_has_moved_half_the_skin() -> None:
    p = cloud(20, "float64")
    kernel = Kernel(coulomb(cutoff=0.5), p, plain=True)
    head = kernel.arrays.arrays()[3]
    first = kernel()
    assert head[3] == 1
    p.x[:] += 0.01
    p.x[3] += 0.01  # 0.035 in all, of 0.0375
    close(kernel(), reference(kernel.force, p), 1e-13)
    p.x[3, 0] -= 0.1
    close(kernel(), reference(kernel.force, p), 1e-13)
    assert head[3] == 2
    kernel.force.set(cutoff=0.3)
    kernel.data = kernel.pairs.binder.data(len(p), kernel.order)
    close(kernel(), reference(kernel.force, p), 1e-13)
    assert kernel.arrays.arrays()[3][3] == 1  # of memory of its own
    assert not np.array_equal(first, kernel())


def test_forgetting_gives_the_bits_of_a_new_start() -> None:
    p = cloud(20, "float64")
    old = Kernel(fluid(), p, plain=True)
    old()
    p.x[:] += np.random.default_rng(4).uniform(-0.01, 0.01, p.x.shape)
    old.arrays.forget()
    np.testing.assert_array_equal(old(), Kernel(fluid(), p, plain=True)())


def test_a_crowd_needs_more_room() -> None:
    rng = np.random.default_rng(2)
    p = pm.Particles(rng.uniform(0, 0.3, (90, 3)), m=0.1)
    force = fluid(cutoff=0.6)
    kernel = Kernel(force, p, plain=True)
    close(kernel(), reference(force, p), 1e-13)
    assert kernel.arrays.arrays()[3][1] > 89


def test_room_grows_before_it_is_full_and_keeps_what_is_known() -> None:
    p = cloud(20, "float64")
    kernel = Kernel(fluid(cutoff=3.0), p, plain=True)
    before = kernel()
    head = kernel.arrays.arrays()[3]
    kernel.arrays._reserve(8)
    room = head[1]
    assert head[2] == 24 < room < 30  # 19, in whole vectors
    np.testing.assert_array_equal(kernel(), before)
    assert head[1] > room
    assert head[3] == 1


def test_one_who_is_lost_spoils_all_of_the_force_and_hangs_nothing() -> None:
    p = cloud(20, "float64")
    kernel = Kernel(coulomb(cutoff=0.5), p, plain=True)
    kernel()
    p.x[4] = 1e300
    assert np.isfinite(kernel()).all()
    p.x[4] = np.nan
    assert np.isnan(kernel()).all()


def test_vectors_and_no_division_by_roots(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Direct sums in float32 use the reciprocal square root of the machine, for as many particles at once as it likes:
    sixteen, or eight."""
    from llvmlite.binding import get_host_cpu_features

    if not get_host_cpu_features().get("avx512f"):
        pytest.skip("another kind of CPU")
    monkeypatch.setenv("POINTMASS_CACHE", str(tmp_path))  # Numba shows only what it has compiled in this process
    kernel = Kernel(pm.Gravitation(eps=0.0625), cloud(20, "float32"))
    kernel()
    text = "".join(kernel.function.inspect_asm().values())
    assert text.count("vrsqrt14ps") + text.count("vrsqrtps") >= 4
    assert "vsqrtps" not in text
    assert "vdivps" not in text
