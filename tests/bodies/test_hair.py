"""Strands of hair: counts, masses, places, shapes at rest and at the start."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput

TETRAHEDRON = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def strands_of(body: pm.Body, strands: int) -> np.ndarray:
    return body.particles.x.reshape(strands, -1, 3)


@pytest.mark.parametrize(("style", "counts"), [("straight", [19, 18]), ("wavy", [19, 18, 17]), ("curly", [19, 18, 17])])
def test_counts_of_a_strand(style: str, counts: list[int]) -> None:
    body = pm.hair(3, 20, 0.2, style=style)
    assert [len(f.ids) for f in body.forces if isinstance(f, (pm.Springs, pm.Angles, pm.Volumes))] == [
        3 * c for c in counts
    ]
    assert body.particles.pinned.reshape(3, 20).tolist() == 3 * [[True, True] + 18 * [False]]


def test_mass_and_length() -> None:
    body = pm.hair(50, 12, 0.3, jitter=0.2, thickness=1e-4, density=1000.0)
    x = strands_of(body, 50)
    length = np.linalg.norm(np.diff(x, axis=1), axis=2)
    np.testing.assert_allclose(length, length[:, :1] * np.ones(11), rtol=1e-12)
    total = length.sum(axis=1)
    assert (np.abs(total / 0.3 - 1) <= 0.2 + 1e-12).all()
    assert np.ptp(total) > 0.05
    weights = body.particles.m.reshape(50, 12)
    np.testing.assert_allclose(weights, (1000 * math.pi * 0.5e-4**2 * total / 11)[:, None] * np.ones(12), rtol=1e-12)
    assert (body.particles.radius == 5e-5).all()


def test_stiffness_does_not_depend_on_the_number_of_points() -> None:
    for points in (5, 9, 33):
        stretch, bend = pm.hair(1, points, 0.2, jitter=0.0, bend=3e-9, stretch=2e-3).forces
        link = 0.2 / (points - 1)
        np.testing.assert_allclose(stretch.parameters["k_s"].components[0].value, 2e-3 / link, rtol=1e-12)
        np.testing.assert_allclose(bend.parameters["k_s"].components[0].value, 3e-9 / link, rtol=1e-12)


def test_roots_lie_evenly_on_the_cap() -> None:
    """The height on a cap is even: Archimedes."""
    roots = strands_of(pm.hair(400, 3, 0.1, center=(1, 2, 3), scalp=0.5, cap=60.0, crown=(1, 1, 0)), 400)[:, 0]
    out = roots - (1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 0.5, rtol=1e-12)
    height = np.sort(out @ (math.sqrt(0.5), math.sqrt(0.5), 0) / 0.5)
    np.testing.assert_allclose(height, 1 - 0.5 * (np.arange(400)[::-1] + 0.5) / 400, rtol=1e-12)
    apart = np.linalg.norm(out[:, None] - out[None], axis=2) + np.eye(400)
    even = math.sqrt(2 * math.pi * 0.5**2 * 0.5 / 400)
    assert apart.min() > 0.6 * even


def test_roots_lie_evenly_on_a_mesh_and_grow_along_its_normals() -> None:
    body = pm.hair(600, 4, 0.1, mesh=TETRAHEDRON, jitter=0.0, seed=3)
    x = strands_of(body, 600)
    slope = np.isclose(x[:, 0].sum(axis=1), 1)
    share = math.sqrt(3) / (3 + math.sqrt(3))
    assert abs(slope.mean() - share) < 4 * math.sqrt(share * (1 - share) / 600)
    np.testing.assert_allclose(x[slope, 1] - x[slope, 0], np.full((slope.sum(), 3), 0.1 / 3 / math.sqrt(3)), atol=1e-12)


@pytest.mark.parametrize("turns", [16.0, -16.0])
def test_a_curl_is_a_helix(turns: float) -> None:
    """On a cap of 1e-3 degrees the root slants by 1e-5 rad, that is 1e-6 m over the strand."""
    x = strands_of(pm.hair(1, 24, 0.25, curl_radius=0.006, curl_turns=turns, jitter=0.0, cap=1e-3), 1)[0]
    flat = x[:, [0, 2]]
    fit, *_ = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(24)]), (flat**2).sum(axis=1), rcond=None)
    radius = np.linalg.norm(flat - fit[:2], axis=1)  # from the middle of a circle fitted to the view from above
    np.testing.assert_allclose(radius, 0.006, rtol=1e-3)
    rises = np.diff(x[:, 1])
    np.testing.assert_allclose(rises, rises[0], rtol=1e-3)


def test_combing_changes_the_start_and_not_the_rest() -> None:
    loose, combed = (
        pm.hair(40, 16, 0.2, style="wavy", curl_turns=10.0, comb=(0, c, 0), cap=100.0) for c in (0.0, -25.0)
    )
    for a, b in zip(loose.forces, combed.forces, strict=True):
        for name in a.parameters:
            np.testing.assert_array_equal(
                a.parameters[name].components[0].value, b.parameters[name].components[0].value
            )
    x = strands_of(combed, 40)
    links = np.linalg.norm(np.diff(x, axis=1), axis=2)
    np.testing.assert_allclose(links, np.linalg.norm(np.diff(strands_of(loose, 40), axis=1), axis=2), rtol=1e-12)
    assert (x[:, -1, 1] < x[:, 0, 1]).all()
    assert np.linalg.norm(x, axis=2).min() > 0.09 - 1e-12


def test_roots_lean_to_where_they_are_combed() -> None:
    x = strands_of(pm.hair(60, 4, 0.1, jitter=0.0, comb=(0, -10, 0), lean=30.0, cap=120.0), 60)
    out, root = x[:, 0] / 0.09, (x[:, 1] - x[:, 0]) / (0.1 / 3)
    np.testing.assert_allclose((out * root).sum(axis=1), math.cos(math.radians(30)), rtol=1e-12)
    assert (root[:, 1] < out[:, 1] * math.cos(math.radians(30))).all()


def test_given_curves_stay_as_they_are() -> None:
    curves = np.random.default_rng(1).normal(size=(4, 6, 3))
    body = pm.hair(curves=curves)
    np.testing.assert_array_equal(strands_of(body, 4), curves)
    system = pm.ParticleSystem(body.particles, body.forces)
    weight = body.particles.m.min() * 9.81
    assert np.abs(system.deriv_eval()[system.dim // 2 :]).max() * body.particles.m.max() < 1e-9 * weight


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"strands": 0}, "strands = 0"),
        ({"points": 2}, "points = 2 is not allowed: it must be a whole number, at least 3"),
        ({"style": "punk"}, "unknown style of hair 'punk'"),
        ({"style": "curly", "points": 12}, "needs 5 links for each turn, so give at least 23 points"),
        ({"curl_radius": 0.1, "curl_turns": 10.0}, r"give less than 0\.0\d+ m, or fewer turns"),
        ({"jitter": 1.0}, "jitter = 1.0"),
        ({"cap": 181.0}, "cap = 181.0"),
        ({"lean": 90.0}, "lean = 90.0"),
        ({"thickness": 0.0}, "thickness = 0.0"),
        ({"bend": -1.0}, "bend = -1.0"),
        ({"crown": (0, 0, 0)}, "crown"),
        ({"curves": [[[0, 0, 0], [1, 0, 0]]]}, "at least 1 strand of 3 points"),
        ({"curves": [[[0, 0, 0], [1, 0, 0], [1, 0, 0]]]}, "points 1 and 2 of strand 0 of curves are the same"),
        ({"curves": [[[0, 0, 0], [1, 0, 0], [2, 0, 0]]], "comb": (0, -1, 0)}, "leave out mesh and comb"),
        ({"mesh": "hair.txt"}, "mesh file"),
    ],
)
def test_bad_hair_is_refused_in_one_sentence(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        pm.hair(**given)
