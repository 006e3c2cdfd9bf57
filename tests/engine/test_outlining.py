"""Loops of all threads as functions of their own: the same results, plain and compiled."""

from __future__ import annotations

import ast

import numpy as np
import pytest
from numba.core import ir_utils, ssa
from numba.core.compiler import run_frontend

from pointmass.engine import passes, store
from pointmass.engine.outlining import outlined

TEXT = """
@njit(parallel=True, **OWNING)
def work(x, y, n, shift):
    found = 10
    most = 3
    scale = 2 * shift
    for i in prange(n):
        if x[i] < 0:
            continue
        own = np.zeros(2, R)
        for k in range(3):
            if k == 1:
                continue
            own[0] += x[i] * scale
        y[i] = own[0] + shift
        found += 1
        most = max(most, i)
    if found > 11:
        for i in prange(2, n):
            own = y[i]
            y[i] = own + found
    return found, most


@njit(**OWNING_ENTRY)
def run(x, y, n, shift):
    return work(x, y, n, shift)
"""


def wanted(x: np.ndarray, y: np.ndarray, shift: float) -> tuple[int, int]:
    up = x >= 0
    y[up] = 4 * shift * x[up] + shift
    found = 10 + int(up.sum())
    y[2:] += found
    return found, max(3, int(np.flatnonzero(up)[-1]))


@pytest.mark.parametrize("way", ["plain", "compiled"])
def test_loops_continue_add_and_keep_the_largest(way: str, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("POINTMASS_CACHE", str(tmp_path))
    x = np.random.default_rng(1).normal(size=200)
    y, same = np.zeros(200), np.zeros(200)
    loaded = store.load("outlined", TEXT, "float64") if way == "compiled" else None
    run = loaded.run if loaded is not None else store.plain("outlined", TEXT, "float64")["run"]
    assert tuple(run(x, y, 200, 0.5)) == wanted(x, same, 0.5)
    np.testing.assert_allclose(y, same, rtol=1e-15)


def test_a_loop_of_all_threads_has_a_function_of_its_own() -> None:
    tree = ast.parse(outlined(TEXT))
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert list(functions) == ["work_0_one", "work_0", "work_1_one", "work_1", "work", "run"]
    assert [len(functions[name].body[-2:]) for name in ("work_0", "work_1")] == [2, 1]
    assert "parallel" not in ast.unparse(functions["work"])


def test_what_a_loop_leaves_behind_is_refused() -> None:
    with pytest.raises(AssertionError, match=r"last.*leave a loop of work"):
        outlined(
            "@njit(parallel=True, **OWNING)\ndef work(x):\n    for i in prange(3):\n        last = i\n    return last\n"
        )


def chosen(x, k):
    """Choices within choices and loops, whose variables are assigned often."""
    best, sign = x[0], 1.0
    for i in range(k):
        value = x[i] if x[i] > 0 else -x[i] if i > 2 else 0.5
        if value > best:
            best = value
        elif i % 2:
            sign = -sign
            best += sign
    total = best if sign > 0 else best * 2
    total = total + sign
    return total


def test_variables_are_assigned_once_as_numba_does_it() -> None:
    first, second = run_frontend(chosen), run_frontend(chosen)
    ours, theirs = passes.assigned_once(first.blocks), ssa.reconstruct_ssa(second).blocks
    text, same = ([[str(s) for s in block.body] for block in blocks.values()] for blocks in (ours, theirs))
    assert text == same
    assert len(ir_utils.build_definitions(ours)) > 20
