"""Cloth from meshes: masses, springs and hinges of the triangles, stiffness of a sheet, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.meshes import TriangleMesh, read_mesh, triangle_mesh
from tests.shapes import TETRAHEDRON

SQUARE = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
OBJ = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.5\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 1/1 1/1 2/2\n"""


def triangular(n: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A sheet of equilateral triangles of side 1 / n."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    x = np.stack([j + 0.5 * (i % 2), np.sqrt(0.75) * i, 0 * i], axis=-1).reshape(-1, 3) / n
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = []
    for r in range(n):
        for c in range(n):
            a, b, d, e = number[r, c], number[r, c + 1], number[r + 1, c], number[r + 1, c + 1]
            faces += [[a, b, d], [b, e, d]] if r % 2 == 0 else [[a, e, d], [a, b, e]]
    return x, np.array(faces)


def test_masses_springs_and_hinges_of_a_square() -> None:
    body = pm.cloth_from_mesh(SQUARE, density=0.6, stretch=100.0, bend=0.01)
    p = body.particles
    corner = {tuple(x): k for k, x in enumerate(p.x.tolist())}
    ends = [corner[(0, 0, 0)], corner[(1, 1, 0)]]
    np.testing.assert_allclose(p.m[ends], 0.2)
    assert p.m.sum() == pytest.approx(0.6)
    springs, hinges = body.forces
    assert len(springs.ids) == 5
    assert sorted(hinges.ids[0, :2].tolist()) == sorted(ends)
    assert sorted(hinges.ids[0].tolist()) == [0, 1, 2, 3]
    k = {tuple(sorted(pair)): k for pair, k in zip(springs.ids.tolist(), springs.arguments["k_s"], strict=True)}
    assert k[tuple(sorted(ends))] == pytest.approx(100 * 1.0 / 2)
    assert set(np.round(list(k.values()), 12)) == {50.0}  # of half the area and a length of 1, likewise
    assert hinges.arguments["k_s"][0] == pytest.approx(0.01 * 2 / 1.0)


def test_a_sheet_of_equilateral_triangles_has_its_modulus() -> None:
    """Energy density of a uniform strain, with Lamé's numbers of E = stretch and nu = 1/3: lambda = mu = 3 E / 8."""
    x, faces = triangular()
    body = pm.cloth_from_mesh((x, faces), stretch=80.0, bend=0.0)
    p, (exx, eyy, gamma) = body.particles, 1e-5 * np.array([0.4, -0.7, 1.1])
    flat = p.x.copy()
    p.x = flat + np.stack([exx * flat[:, 0] + gamma * flat[:, 1], eyy * flat[:, 1], 0 * flat[:, 0]], axis=1)
    energy = pm.ParticleSystem(p, body.forces).energy().potential
    mu = 3 * 80.0 / 8
    density = 0.5 * mu * (exx + eyy) ** 2 + mu * (exx**2 + eyy**2 + 0.5 * gamma**2)
    area = triangle_mesh(x, faces).areas.sum()
    assert energy == pytest.approx(density * area, rel=1e-3)


@pytest.mark.parametrize("cells", [8, 16])
def test_a_sheet_bent_along_its_edges_has_its_bending_stiffness(cells: int) -> None:
    """B k^2 / 2 on each unit of area around the inner edges; the form of a rolled sheet is that of a flat one."""
    grid = pm.cloth(cells + 1, cells + 1, 1.0)
    flat, faces = grid.particles.x, grid.triangles
    bent = pm.cloth_from_mesh((flat, faces), bend=0.02, stretch=1.0)
    p, k, cell = bent.particles, 0.8, 1 / cells
    turn = 2 * np.arcsin(k * cell / 2)
    angle = turn * np.round((p.x[:, 0] + 0.5) * cells)
    p.x = np.stack([np.sin(angle) / k, p.x[:, 1], (1 - np.cos(angle)) / k], axis=1)
    energy = bent.forces[1].energy(p, 0.0, p.x, p.v)
    lines = cells - 1
    assert energy == pytest.approx(0.5 * 0.02 * turn**2 * lines * cells, rel=1e-9)
    assert energy == pytest.approx(0.5 * 0.02 * k**2 * lines / cells, rel=turn**2)


def test_a_closed_mesh_is_at_rest_in_its_own_form() -> None:
    body = pm.cloth_from_mesh(TETRAHEDRON, scale=2.0, shift=(0, 1, 0))
    system = pm.ParticleSystem(body.particles, body.forces)
    assert np.abs(system.deriv_eval()).max() < 1e-9
    assert len(body.forces[1].ids) == 6
    assert not body.particles.groups["border"].any()


def test_a_file_keeps_its_pattern_and_loses_what_is_no_surface(tmp_path) -> None:
    (tmp_path / "rag.obj").write_text(OBJ)
    body = pm.cloth_from_mesh(tmp_path / "rag.obj", pinned="top")
    p, surface = body.particles, body.particles.surfaces["cloth"]
    assert len(p) == 4, "the fifth vertex is in no triangle"
    assert len(surface.triangles) == 2, "the third triangle has no area"
    wanted = {(0, 0): (0, 0), (1, 0): (1, 0), (1, 1): (1, 1), (0, 1): (0, 0.5)}
    for row, place in zip(p.rows(surface.triangles).ravel(), surface.uv.reshape(-1, 2), strict=True):
        np.testing.assert_allclose(place, wanted[tuple(p.x[row, :2].tolist())], atol=1e-6)
    assert (p.x[p.pinned, 1] == 1).all()
    assert read_mesh(tmp_path / "rag.obj").uv is not None
    scene = pm.Scene(bodies=[body])
    assert pm.Scene.from_toml(scene.to_toml()) == scene


def test_a_mesh_in_memory_keeps_its_pattern_as_text(tmp_path) -> None:
    """Also where a vertex has several places on it."""
    (tmp_path / "rag.obj").write_text(OBJ)
    mesh = read_mesh(tmp_path / "rag.obj")
    mesh = TriangleMesh(mesh.vertices, mesh.faces, mesh.uv + np.array([0.0, 0.25])[:, None, None])
    scene = pm.Scene(bodies=[pm.cloth_from_mesh(mesh)])
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    np.testing.assert_array_equal(again.bodies[0].particles.surfaces["cloth"].uv, mesh.uv)
    flat = pm.cloth_from_mesh((mesh.vertices, mesh.faces, mesh.vertices[:, :2])).particles.surfaces["cloth"]
    np.testing.assert_array_equal(flat.uv, mesh.vertices[mesh.faces][:, :, :2])
    with pytest.raises(pm.InvalidInput, match="uv of a mesh"):
        pm.cloth_from_mesh((mesh.vertices, mesh.faces, [[0, 0]]))


def test_duplicate_vertices_are_one() -> None:
    corners = np.array(SQUARE[0], float)[np.array(SQUARE[1])].reshape(-1, 3)
    body = pm.cloth_from_mesh((corners, np.arange(6).reshape(2, 3)))
    assert len(body.particles) == 4
    assert len(body.forces[1].ids) == 1


@pytest.mark.parametrize(
    ("mesh", "more", "says"),
    [
        (
            ([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1], [-1, 0, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
            {},
            r"1 edges that more than two triangles share, such as that of 3 triangles from \(0, 0, 0\) to \(0, 1, 0\)",
        ),
        (([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), {}, "at least one triangle whose area is not 0"),
        (SQUARE, {"pinned": "tip"}, "unknown value of pinned 'tip': did you mean 'top'"),
        (SQUARE, {"pinned": [7]}, "rows of particles must be whole numbers below 4"),
        (SQUARE, {"scale": 0}, "scale = 0"),
        (SQUARE, {"material": "tin"}, "unknown material 'tin'"),
        ("rag.txt", {}, "must end in"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(mesh, more, says: str) -> None:
    with pytest.raises(pm.InvalidInput, match=says):
        pm.cloth_from_mesh(mesh, **more)
