"""Near pairs: the hash grid finds what a look at every pair finds."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.self_contact.crossings import crossings
from pointmass.self_contact.pairs import Mesh, find, overlapping
from tests import crossing

NO_STRANDS = np.zeros((0, 2), np.intp)


def crumpled(rows: int, scatter: float, seed: int = 0) -> tuple[np.ndarray, Mesh]:
    cloth = pm.cloth(rows, rows, 1.0)
    rng = np.random.default_rng(seed)
    x = cloth.particles.x * (1, 1, 0.3) + scatter * rng.normal(size=(rows * rows, 3))
    return x, Mesh.of(cloth.particles.corners("cloth"), NO_STRANDS)


def boxes_of(x: np.ndarray, items: np.ndarray, pad: float) -> np.ndarray:
    return np.hstack([x[items].min(axis=1) - pad, x[items].max(axis=1) + pad])


@pytest.mark.parametrize("scatter", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("outlier", [0.0, 1e3])
def test_the_grid_finds_the_pairs_of_brute_force(scatter: float, outlier: float) -> None:
    x, mesh = crumpled(9, scatter)
    x[0] += outlier  # a few boxes are far larger than all others
    edges, triangles, points = (boxes_of(x, items, 0.01) for items in (mesh.edges, mesh.triangles, mesh.alone))
    for items, boxes, others, others_boxes in (
        (mesh.edges, edges, mesh.edges, edges),
        (mesh.alone, points, mesh.triangles, triangles),
        (mesh.edges, edges, mesh.triangles, triangles),
    ):
        found = np.stack(overlapping(items, boxes, others, others_boxes), axis=1)
        wanted = crossing.overlaps(items, boxes, others, others_boxes, items is others)
        assert [tuple(pair) for pair in found.tolist()] == wanted  # in the same order, too
        assert len(wanted) > 50


def test_every_box_over_every_other() -> None:
    """More than there is room for at first."""
    mesh = Mesh.of(np.arange(60).reshape(20, 3), NO_STRANDS)
    boxes = np.tile((0.0, 0, 0, 1, 1, 1), (20, 1))
    found = np.stack(overlapping(mesh.triangles, boxes, mesh.triangles, boxes), axis=1)
    assert found.tolist() == [[i, j] for i in range(20) for j in range(i + 1, 20)]


def test_nothing_to_find() -> None:
    empty = np.zeros((0, 2), np.intp)
    assert [len(a) for a in overlapping(empty, np.zeros((0, 6)), empty, np.zeros((0, 6)))] == [0, 0]


def test_nobody_who_comes_near_is_left_out() -> None:
    """Points and triangles, and edges, that share no corner: those nearer than `reach` at some time of a grid of times,
    though all have strayed by half of the margin."""
    reach, margin = 0.06, 0.03
    x0, mesh = crumpled(6, 0.05)
    rng = np.random.default_rng(1)
    x1 = x0 + 0.1 * rng.normal(size=x0.shape) + (0.3, 0, 0)
    pairs = find(mesh, x0, x1, reach, margin)
    known = {tuple(c) for c in pairs.corners.tolist()}
    kinds = [("point", (int(p), *t)) for p in mesh.points for t in mesh.triangles.tolist() if p not in t]
    edges = mesh.edges.tolist()
    kinds += [("edge", (*a, *b)) for i, a in enumerate(edges) for b in edges[i + 1 :] if not set(a) & set(b)]
    stray = rng.normal(size=x0.shape)
    stray *= 0.5 * margin / np.linalg.norm(stray, axis=1, keepdims=True)
    near = 0
    for kind, corners in kinds:
        rows = list(corners)
        if np.linalg.norm(x0[rows].mean(axis=0) - x0[rows[0]]) > 0.6:
            continue
        for t in (0.0, 0.3, 0.7, 1.0):
            if crossing.distance(kind, (x0 + t * (x1 - x0) + stray)[rows], 12) < reach:
                near += 1
                assert corners in known
                break
    assert near > 50
    assert known <= {corners for _, corners in kinds}
    assert {tuple(c) for c in pairs.corners[: pairs.points].tolist()} <= {c for kind, c in kinds if kind == "point"}


@pytest.mark.parametrize("scatter", [0.0, 0.02, 0.1])
def test_edges_through_triangles_are_those_of_brute_force(scatter: float) -> None:
    x, mesh = crumpled(12, scatter)
    assert [tuple(pair) for pair in crossings(x, mesh).tolist()] == crossing.crossings(x, mesh.triangles, mesh.edges)


def test_pairs_do_not_depend_on_threads() -> None:
    x, mesh = crumpled(30, 0.02)
    most = numba.get_num_threads()
    found = []
    for threads in {1, most}:
        numba.set_num_threads(threads)
        found.append(find(mesh, x, x, 0.02, 0.01).corners.tobytes())
    numba.set_num_threads(most)
    assert len(set(found)) == 1
