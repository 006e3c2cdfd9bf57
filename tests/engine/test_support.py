"""What printed kernels call against NumPy, compiled and plain."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from pointmass.engine.support import added, columns, exponent, scaled, significand, streamed, subtracted
from pointmass.engine.threads import LINE


@numba.njit(error_model="numpy")
def apply(a, k, result):
    for i in range(a.size):
        result[0, i] = scaled(a[i], k[i])
        result[1, i] = significand(a[i])
        result[2, i] = exponent(a[i])


def numbers(dtype: type) -> np.ndarray:
    rng = np.random.default_rng(1)
    with np.errstate(over="ignore"):
        spread = np.exp(rng.uniform(-740, 700, 3000)).astype(dtype) * rng.choice([-1, 1], 3000).astype(dtype)
    return np.concatenate([spread, np.array([0.0, -0.0, 1.0, 2.0, 0.75, np.inf, -np.inf, np.nan], dtype)])


@pytest.mark.filterwarnings("ignore:.*encountered.*:RuntimeWarning")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("run", [apply, apply.py_func], ids=["compiled", "plain"])
def test_as_numpy(run, dtype):
    a = numbers(dtype)
    near = np.random.default_rng(2).uniform(0.5, 2, len(a)).astype(dtype)
    k = np.floor(np.random.default_rng(3).uniform(-1100, 1030, len(a))).astype(dtype)
    result = np.zeros((3, len(a)), dtype)
    run(near, k, result)
    assert np.array_equal(result[0], np.ldexp(near, k.astype(np.int32)))
    run(a, np.zeros_like(a), result)
    f, e = np.frexp(a)
    assert np.array_equal(result[1], f, equal_nan=True)
    assert np.array_equal(result[2][np.isfinite(a)], e[np.isfinite(a)])


@numba.njit(error_model="numpy")
def move(records, rows, turned, totals, acts):
    columns(turned, np.uintp(3), 11, records, rows, np.uintp(1), 2)
    added(totals, np.uintp(4), acts, np.uintp(8))
    subtracted(totals, np.uintp(8), acts, np.uintp(0))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("run", [move, move.py_func], ids=["compiled", "plain"])
def test_records_become_columns_and_are_added(run, dtype):
    rng = np.random.default_rng(1)
    records = rng.normal(size=(20, 8)).astype(dtype)
    rows = rng.permutation(20).astype(np.int32)
    turned, totals, acts = np.zeros(80, dtype), rng.normal(size=16).astype(dtype), rng.normal(size=16).astype(dtype)
    before = totals.copy()
    run(records.ravel(), rows, turned, totals, acts)
    wanted = np.zeros(80, dtype)
    for c in range(6):
        wanted[3 + 11 * c :][:8] = records[rows[1:16:2], c]
    assert np.array_equal(turned, wanted)
    before[4:8] += acts[8:12]
    before[8:12] -= acts[:4]
    assert np.array_equal(totals, before)


@numba.njit(error_model="numpy")
def keep(target, o, source):
    streamed(target, np.uintp(o), source)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("run", [keep, keep.py_func], ids=["compiled", "plain"])
def test_a_line_is_copied_wherever_it_begins(run, dtype):
    source = np.random.default_rng(1).normal(size=4 * LINE).astype(dtype)
    count = LINE // source.itemsize
    for o in range(2 * count):  # at the beginning of a line of memory, and between two
        target = np.zeros_like(source)
        run(target, o, source)
        assert np.array_equal(np.flatnonzero(target), np.arange(o, o + count))
        assert np.array_equal(target[o : o + count], source[o : o + count])
