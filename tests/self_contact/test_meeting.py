"""When two simplices meet: check K07, and every pair against a fine look at all times."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.self_contact.kernels_response import look, sweep
from tests import crossing

Found = tuple[float, np.ndarray]
ROOM = 1e-9  # [m] as near as meeting


def met(kind: str, x0: np.ndarray, x1: np.ndarray, tolerance: float = ROOM) -> Found:
    """When, and the weights of where."""
    corners, points = np.arange(4)[None], 1 if kind == "point" else 0
    gaps, normals, weights, inside = np.empty(1), np.empty((1, 3)), np.empty((1, 4)), np.empty(1, bool)
    look(corners, points, x0, gaps, normals, weights, inside, 0, 1)
    times = np.empty(1)
    stale = np.ones(4, bool)
    sweep(corners, points, x0, x1, gaps, normals, 0.0, tolerance, stale, times, weights, 0, 1)
    return float(times[0]), weights[0]


TRIANGLE = [(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]


def test_a_point_through_a_triangle() -> None:
    """K07."""
    x0 = np.array([(0.2, 0.2, 1), *TRIANGLE])
    x1 = x0.copy()
    x1[0, 2] = -1
    when, weights = met("point", x0, x1)
    assert when == pytest.approx(0.5, abs=1e-10)
    assert weights == pytest.approx([1, -0.6, -0.2, -0.2], abs=1e-10)
    x0[0, :2] = x1[0, :2] = 2
    assert met("point", x0, x1)[0] > 1


def test_two_edges() -> None:
    x0 = np.array([(-1.0, 0, 0), (1, 0, 0), (0.5, -1, 3), (0.5, 1, 3)])
    x1 = x0 + np.array([(0, 0, 0), (0, 0, 0), (0, 0, -4), (0, 0, -4.0)])
    when, weights = met("edge", x0, x1)
    assert when == pytest.approx(0.75, abs=1e-10)
    assert weights == pytest.approx([0.25, 0.75, -0.5, -0.5], abs=1e-10)


@pytest.mark.parametrize("kind", ["point", "edge"])
def test_random_pairs_against_roots_and_a_fine_look(kind: str) -> None:
    """The volume between the corners is a cubic of time: they meet at a root of it where they are at one place."""
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(3000):
        x0, x1 = rng.uniform(-1, 1, (2, 4, 3))
        when, weights = met(kind, x0, x1)
        wanted = [t for t in roots(x0, x1) if apart(kind, x0 + t * (x1 - x0)) < 1e-7]
        assert (when <= 1) == bool(wanted)
        if wanted:
            hits += 1
            assert when == pytest.approx(min(wanted), abs=1e-7)
            assert np.abs(weights @ (x0 + when * (x1 - x0))).max() < 1e-7
    assert hits > 150


def roots(x0: np.ndarray, x1: np.ndarray) -> list[float]:
    nodes = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    values = [np.linalg.det((x0 + t * (x1 - x0))[1:] - (x0 + t * (x1 - x0))[0]) for t in nodes]
    found = np.roots(np.polyfit(nodes, values, 3))
    return [float(r.real) for r in found if abs(r.imag) < 1e-9 and 0 <= r.real <= 1]


def apart(kind: str, p: np.ndarray) -> float:
    """Exact distance of a pair in one plane, by the solution for the inside of both, else far."""
    e = (
        np.stack([p[2] - p[1], p[3] - p[1]], axis=1)
        if kind == "point"
        else np.stack([p[1] - p[0], p[2] - p[3]], axis=1)
    )
    r = p[0] - p[1] if kind == "point" else p[2] - p[0]
    (u, v), *_ = np.linalg.lstsq(e, r, rcond=None)
    inside = u >= 0 and v >= 0 and (u + v <= 1 if kind == "point" else u <= 1 and v <= 1)
    return float(np.linalg.norm(e @ (u, v) - r)) if inside else np.inf


def test_corners_that_stay_in_one_plane() -> None:
    """The cubic is zero at all times; a point that slides into the triangle is seen, one that passes by is not."""
    x0 = np.array([(-1.0, 0.3, 0), *TRIANGLE])
    x1 = x0 + np.array([(2.0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)])
    when, _ = met("point", x0, x1, 1e-6)
    assert when == pytest.approx(0.5, abs=2e-6)
    x0[0, 1] = x1[0, 1] = -0.2
    assert met("point", x0, x1, 1e-6)[0] > 1


def test_who_ends_too_near_meets() -> None:
    x0 = np.array([(0.2, 0.2, 1), *TRIANGLE])
    x1 = x0.copy()
    x1[0, 2] = 1e-4
    assert met("point", x0, x1, 1e-3)[0] == 1.0
    assert met("point", x0, x1, 1e-5)[0] > 1


def test_parallel_edges_and_edges_without_length() -> None:
    x0 = np.array([(0.0, 0, 0), (1, 0, 0), (0.5, 0, 1), (1.5, 0, 1)])
    x1 = x0.copy()
    x1[2:, 2] = -1
    assert met("edge", x0, x1)[0] == pytest.approx(0.5, abs=1e-6)
    x0[3] = x0[2]
    x1[3] = x1[2]
    assert met("edge", x0, x1)[0] == pytest.approx(0.5, abs=1e-6)


def test_closest_points_are_the_closest() -> None:
    """Against a fine grid of places, which is at most half of a cell of it too far."""
    rng = np.random.default_rng(5)
    corners = np.arange(4)[None]
    for kind, points in (("point", 1), ("edge", 0)):
        for _ in range(200):
            x = rng.uniform(-1, 1, (4, 3))
            gaps, normals, weights, inside = np.empty(1), np.empty((1, 3)), np.empty((1, 4)), np.empty(1, bool)
            look(corners, points, x, gaps, normals, weights, inside, 0, 1)
            slow = crossing.distance(kind, x)
            assert gaps[0] <= slow + 1e-12
            assert gaps[0] > slow - 0.06
            assert weights[0] @ x == pytest.approx(gaps[0] * normals[0], abs=1e-12)
            assert weights[0].sum() == pytest.approx(0, abs=1e-12)
