"""Laws of pairs: who is near whom, sums that are finished, own laws, what is refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.laws.force import Blocks
from pointmass.laws.neighbours import pairs_within

sys.path.append(str(Path(__file__).parents[1]))
import naive

RNG = np.random.default_rng(3)
X, V, M = RNG.uniform(0, 2, (9, 3)), RNG.standard_normal((9, 3)), RNG.uniform(1, 2, 9)
CHARGE = RNG.uniform(-1, 1, 9)


def weight(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, cutoff: Any) -> Any:
    """A kernel of a smoothed density, its gradient, and a mean velocity."""
    d = x1 - x2
    q = cutoff * cutoff - pm.dot(d, d)
    return m2 * q**3, m2 * q * q * d, q * (v2 - v1)


def pressure(sums: Any, x: Any, v: Any, m: Any, t: Any, stiffness: Any) -> Any:
    density, gradient, drift = sums[0], sums[1:4], sums[4:7]
    return stiffness * density * pm.add(gradient, (0, 0, 0)) + pm.scale(m, drift) - 0.1 * v + 0.01 * x


@pm.pair_force(finish=pressure)
def fluid(x1, v1, m1, x2, v2, m2, t, stiffness=2.0, cutoff=1.1):
    return weight(x1, v1, m1, x2, v2, m2, t, cutoff)


@pm.pair_force(per_particle=["charge"], cutoff=1.3)
def coulomb(x1, v1, m1, x2, v2, m2, t, k=1.0, charge="charge"):
    d = x1 - x2
    return k * charge[0] * charge[1] * pm.inverse(pm.length(d) ** 3) * d


def cloud(**more: Any) -> pm.Particles:
    return pm.Particles(X, V, M, charge=CHARGE, **more)


def evaluate(force: Any, p: pm.Particles, x: Any = None, v: Any = None, t: float = 0.3) -> Any:
    force.bind(p)
    f = np.zeros_like(p.x)
    force.add_forces(p, t, p.x if x is None else x, p.v if v is None else v, f)
    return f


@pytest.mark.parametrize("box", [None, (2.2, 2.5, 3.0), (4.0, 4.5, 2.1)])
@pytest.mark.parametrize(("cutoff", "spread"), [(0.4, 4.0), (1.0, 4.0), (1.0, 1.0), (0.05, 100.0)])
def test_F13_pairs_are_those_of_brute_force(cutoff, spread, box):
    x = np.random.default_rng(5).uniform(-spread, spread, (120 if box else 500, 3))
    i, j = pairs_within(x, cutoff, box)
    found = list(zip(i.tolist(), j.tolist(), strict=True))
    assert found == sorted(found)
    moved = x if box is None else x % np.array(box)
    assert set(found) == naive.near_pairs(moved.tolist(), cutoff, box)
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("box", [None, (2.2, 2.5, 3.0)])
@pytest.mark.parametrize(("count", "others"), [(100, 3), (3, 100), (20, 30), (0, 5), (5, 0)])
def test_pairs_with_others_are_those_of_brute_force(count, others, box):
    x = np.random.default_rng(5).uniform(0, 2, (count + others, 3))
    i, j = pairs_within(x[:count], 0.7, box, x[count:])
    found = list(zip(i.tolist(), (j + count).tolist(), strict=True))
    assert found == sorted(found)
    want = naive.near_pairs(x.tolist(), 0.7, box)
    assert found == sorted((a, b) for a, b in want if a < count <= b)


def test_one_way():
    """Some act on others, and some on themselves, too."""
    p = cloud()
    for cutoff in (None, 1.3):
        f = evaluate(coulomb(cutoff=cutoff, on=[0, 1, 2, 3], by=[3, 4, 8]), p)
        want = np.zeros((9, 3))
        for i in (0, 1, 2, 3):
            for j in (3, 4, 8):
                d = X[i] - X[j]
                if i != j and np.linalg.norm(d) < (cutoff or np.inf):
                    want[i] += CHARGE[i] * CHARGE[j] * d / np.linalg.norm(d) ** 3
        np.testing.assert_allclose(f, want, rtol=0, atol=1e-13 * np.abs(want).max())


def test_what_acts_one_way_has_no_energy_and_follows_births_and_deaths():
    potential = {"potential": lambda x1, v1, m1, x2, v2, m2, t, k: k}
    law = pm.pair_force(**potential)(lambda x1, v1, m1, x2, v2, m2, t, k=1.0: k * (x1 - x2))
    p = cloud()
    assert pm.ParticleSystem(p, [law()]).energy().potential == 36.0
    system = pm.ParticleSystem(p, [law(on=[0, 5], by=[1, 2])])
    assert system.energy().potential == 0.0
    system.remove([0, 1])
    system.add([[0, 0, 0]], charge=[0.0])
    f = system.deriv_eval().reshape(2, -1, 3)[1] * p.m[:, None]
    want = np.zeros((8, 3))
    want[3] = X[5] - X[2]
    np.testing.assert_allclose(f, want, rtol=0, atol=1e-15)


def test_few_none_and_lost_particles_have_no_pairs():
    for x in (np.zeros((0, 3)), np.zeros((1, 3)), np.array([[0, 0, 0], [np.nan, 0, 0], [1e300, 0, np.inf]])):
        assert len(pairs_within(x, 1.0)[0]) == 0


def test_a_law_of_sums_with_a_finish():
    p = cloud()
    f = evaluate(fluid(stiffness=3.0), p)
    want = np.zeros((9, 3))
    for i in range(9):
        sums = np.zeros(7)
        for j in range(9):
            d = X[i] - X[j]
            q = 1.1**2 - d @ d
            if i != j and q > 0:
                sums += [M[j] * q**3, *(M[j] * q * q * d), *(q * (V[j] - V[i]))]
        want[i] = 3.0 * sums[0] * sums[1:4] + M[i] * sums[4:] - 0.1 * V[i] + 0.01 * X[i]
    np.testing.assert_allclose(f, want, rtol=0, atol=1e-13 * np.abs(want).max())
    assert fluid().velocity_dependent
    assert not coulomb().velocity_dependent


@pytest.mark.parametrize(
    "force",
    [fluid(), fluid(cutoff=3.0), coulomb(k=2.0), coulomb(cutoff=None), fluid(on=[0, 1, 5, 6, 8], by=[2, 4, 5, 7])],
)
def test_jacobian_of_own_laws(force):
    p = cloud()
    force.bind(p)
    blocks = Blocks()
    force.add_jacobian(p, 0.3, p.x, p.v, blocks)
    h = 1e-6
    for exact, which in zip(blocks.matrices(9), (0, 1), strict=True):
        slope = np.zeros((27, 27))
        for column in range(27):
            up, down = [p.x.copy(), p.v.copy()], [p.x.copy(), p.v.copy()]
            up[which].ravel()[column] += h
            down[which].ravel()[column] -= h
            slope[:, column] = (evaluate(force, p, *up) - evaluate(force, p, *down)).ravel() / (2 * h)
        np.testing.assert_allclose(exact.toarray(), slope, rtol=0, atol=1e-5 * np.abs(slope).max())


def test_the_jacobian_of_a_cut_off_is_sparse_and_has_no_limit():
    x = np.stack(np.meshgrid(*[np.arange(13.0)] * 3), axis=-1).reshape(-1, 3)
    system = pm.ParticleSystem(pm.Particles(x), [pm.LennardJones(sigma=0.9, cutoff=1.2)])
    assert system.jacobian(0.0, system.get_state()).nnz < 2197 * 3 * (2 * 7 * 3 + 1)


def test_columns_and_selections():
    p = cloud()
    f = evaluate(coulomb(k="t", on=[1, 2, 5, 7]), p)
    want = np.zeros((9, 3))
    for i in (1, 2, 5, 7):
        for j in (1, 2, 5, 7):
            d = X[i] - X[j]
            if i != j and np.linalg.norm(d) < 1.3:
                want[i] += 0.3 * CHARGE[i] * CHARGE[j] * d / np.linalg.norm(d) ** 3
    np.testing.assert_allclose(f, want, rtol=0, atol=1e-13 * np.abs(want).max())
    np.testing.assert_array_equal(evaluate(coulomb(charge=CHARGE.tolist()), p), evaluate(coulomb(), p))


def test_images_whichever_box_a_particle_is_in():
    box = (3.0, 3.2, 3.1)
    p = cloud()
    f = evaluate(coulomb(box=box), p)
    far = p.x + np.array(box) * RNG.integers(-3, 4, (9, 3))
    np.testing.assert_allclose(evaluate(coulomb(box=box), p, far), f, rtol=0, atol=1e-12 * np.abs(f).max())


def test_cut_off_can_be_set():
    p = cloud()
    force = coulomb()
    evaluate(force, p)
    force.set(cutoff=0.7)
    np.testing.assert_array_equal(evaluate(force, p), evaluate(coulomb(cutoff=0.7), p))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: coulomb(cutoff=0.0), "cutoff = 0.0 is not allowed"),
        (lambda: coulomb(cutoff="1 + t"), "cutoff of coulomb must be one number"),
        (lambda: coulomb(box=(3, 2, 3)), "a cut-off of 1.3 m in a periodic box: give one of at most half .* 1 m"),
        (lambda: pm.LennardJones(box=(3, -2, 3)), "its sides must be greater than 0"),
        (lambda: coulomb(cutoff=None, box=(3, 2, 3)), "has no cut-off in a periodic box"),
        (lambda: pm.LennardJones(sigma="1 + t"), "needs a cutoff"),
        (lambda: pm.SoftSphere(radius="1 + t"), "radius of soft_sphere must not depend on t"),
        (lambda: pm.pair_force(per_particle=["mass"])(coulomb.law), "has no parameter 'mass'"),
        (lambda: pm.pair_force(finish=pressure)(coulomb.law), "has no parameter 'stiffness'"),
        (pm.pair_force(weight), "needs a cutoff"),
        (lambda: pm.pair_force(weight)(cutoff=1.0), "must return 3 numbers, but returned 7"),
    ],
)
def test_what_is_refused_says_what_is_allowed(make, words):
    with pytest.raises(pm.InvalidInput, match=words):
        make().bind(cloud())
