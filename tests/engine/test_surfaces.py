"""The deepest point of a triangle in a collider, as a printed kernel finds it, against many points of the triangle."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import pointmass as pm
from pointmass.engine import store
from pointmass.engine.surfaces import PRECISION, SurfaceKernel
from tests import naive
from tests.engine.test_contact import HILLS, PEBBLE, PLATE, ROD
from tests.shapes import SHEET, TETRAHEDRON

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
SHAPES = {
    "ball": lambda: pm.Sphere((0, "0.1*t", 0), radius=0.6),
    "block": lambda: pm.Box((0, -0.1, 0), (1, 0.8, 0.6)),
    "capsule": lambda: pm.Capsule(**ROD, radius=0.3),
    "cylinder": lambda: pm.Cylinder(**ROD, radius=0.4),
    "plate": lambda: pm.Polygon(PLATE, thickness=0.1),
    "tetrahedron": lambda: pm.Mesh(TETRAHEDRON, scale=0.7),
    "round mesh": lambda: pm.Mesh((BALL.vertices, BALL.faces), shift=(0.1, "t", 0)),
    "sheet": lambda: pm.Mesh(SHEET, thickness=0.1),
    "hills": lambda: pm.HeightField(HILLS, (2.5, 2.5)),
    "grid": lambda: pm.DistanceGrid(PEBBLE, spacing=0.25),
}
THICKNESS = 0.01
T = 0.25


class Searcher:
    """The search of a kernel as plain Python."""

    def __init__(self, collider):
        self.kernel = SurfaceKernel([collider], "float64")
        self.functions = store.plain("search", self.kernel.text, "float64")
        self.table, self.memory = self.kernel.contact.table(), np.zeros(self.kernel.contact.record)

    def deepest(self, corners, w=(1.0, 1.0, 1.0), rows=(0, 1, 2)):
        """How deep, its weights, and the precision."""
        scratch = self.kernel._scratch
        state = (self.table, self.memory, scratch)
        longest = self.functions["laid"](*state, 0, T, corners, np.array(w), *rows, THICKNESS)
        self.functions["deepest"](*state, 0, PRECISION * longest, self.kernel._details[0])
        best = self.functions["BEST"]
        depth, s, t = scratch[best : best + 3]
        return depth, np.array([1 - s - t, s, t]), PRECISION * longest


@pytest.mark.parametrize("name", SHAPES)
def test_the_deepest_point_is_found(name):
    """No point of many is deeper, up to the precision; and the depth is the distance of the point that is returned."""
    collider = SHAPES[name]()
    search = Searcher(collider)
    for corners in touching(collider):
        sampled = naive.deepest(collider, corners, T) - THICKNESS
        depth, weights, precision = search.deepest(corners)
        assert depth <= max(sampled, 0) + precision
        if depth < 0:
            (found,) = collider.distance(weights[None] @ corners, T) - THICKNESS
            assert depth == pytest.approx(found, abs=1e-12)
            assert weights.min() > -1e-12


def touching(collider, count=8):
    """Triangles whose corners are outside of a collider, but not the points between them."""
    rng = np.random.default_rng(7)
    found = []
    for _ in range(100):
        near = rng.uniform(-0.9, 0.9, (40, 1, 3))
        on = near - collider.distance(near[:, 0], T)[:, None, None] * collider.normal(near[:, 0], T)[:, None]
        some = on + rng.normal(0, 0.2, (40, 3, 3))
        free = collider.distance(some.reshape(-1, 3), T).reshape(-1, 3).min(axis=1) > THICKNESS
        middles = some[free].mean(axis=1)
        found += list(some[free][collider.distance(middles, T) < 0.5 * THICKNESS]) if len(middles) else []
        if len(found) >= count:
            return found[:count]
    raise AssertionError("no triangle touches")


def test_an_edge_is_a_triangle_whose_third_corner_is_its_first():
    """Over a ball the deepest point of a link is the foot of the perpendicular from the centre."""
    search = Searcher(pm.Sphere(radius=0.5))
    ends = np.array([[-0.5, 0.49, 0.03], [0.3, 0.5, 0.03]])
    depth, weights, precision = search.deepest(ends, rows=(0, 1, 0))
    along = ends[1] - ends[0]
    foot = ends[0] - (ends[0] @ along) / (along @ along) * along
    assert depth == pytest.approx(np.linalg.norm(foot) - 0.5 - THICKNESS, abs=precision)
    np.testing.assert_allclose((weights[[0, 2]].sum(), weights[1]) @ ends, foot, atol=0.02)


def test_a_held_corner_may_be_where_it_is():
    """A strand that is rooted within the scalp does not come out of it at its root, but farther on."""
    search = Searcher(pm.Sphere(radius=0.5))
    ends = np.array([[0.0, 0.45, 0.0], [0.1, 0.6, 0.0]])
    assert search.deepest(ends, rows=(0, 1, 0))[0] < -0.05
    assert search.deepest(ends, w=(0.0, 1.0, 1.0), rows=(0, 1, 0))[0] >= 0
