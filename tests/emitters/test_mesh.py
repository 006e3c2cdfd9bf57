"""Particles from the surface and the inside of triangle meshes."""

import copy
import pickle

import numpy as np
import pytest
import trimesh

import pointmass as pm
from pointmass.emitters.solid import Solid
from pointmass.meshes import triangle_mesh

N = 40_000
TETRAHEDRON = ([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def arrays(mesh):
    return mesh.vertices.tolist(), mesh.faces.tolist()


def born(emitter, until=N, seed=0):
    return emitter.births(0.0, until, seed, "s")


def winding(mesh, x):
    """How often a closed mesh goes around places, by solid angles (Van Oosterom & Strackee 1983)."""
    total = np.zeros(len(x))
    for a, b, c in mesh.triangles:
        r = [corner - x for corner in (a, b, c)]
        size = [np.linalg.norm(d, axis=1) for d in r]
        below = size[0] * size[1] * size[2]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            below = below + (r[i] * r[j]).sum(axis=1) * size[k]
        total += 2 * np.arctan2((r[0] * np.cross(r[1], r[2])).sum(axis=1), below)
    return total / (4 * np.pi)


def hollow():
    """A box with a box cut out of it: two surfaces, the inner one facing inwards to the hollow."""
    inner = trimesh.creation.box((0.5, 0.5, 0.5))
    inner.apply_translation((0.2, 0.1, 0))
    inner.invert()
    return trimesh.util.concatenate([trimesh.creation.box((1, 2, 1)), inner])


# ------------------------------------------------------------------------------------------------------------- surface


def test_each_triangle_has_as_many_as_it_has_area():
    ball = trimesh.creation.icosphere(subdivisions=1, radius=2.0)
    ball.apply_scale((1, 0.3, 2))
    emitter = pm.MeshEmitter((1, 2, 3), mesh=arrays(ball), rate=1)
    x = born(emitter).x - [1, 2, 3]
    a, b, c = np.moveaxis(ball.triangles, 1, 0)[:, :, :, None]  # each place in the coordinates of each triangle
    inverse = np.linalg.inv(np.concatenate([b - a, c - a, ball.face_normals[:, :, None]], axis=2))
    q = np.einsum("fij,nfj->nfi", inverse, x[:, None] - a[:, :, 0])
    on = (q[..., :2] > -1e-9).all(axis=2) & (q[..., :2].sum(axis=2) < 1 + 1e-9) & (np.abs(q[..., 2]) < 1e-9)
    assert on.any(axis=1).all()
    which = on.argmax(axis=1)
    expected = N * ball.area_faces / ball.area
    chi2 = ((np.bincount(which, minlength=len(expected)) - expected) ** 2 / expected).sum()
    assert abs(chi2 - len(expected)) < 5 * np.sqrt(2 * len(expected))


def test_within_a_triangle_they_are_even():
    x = born(pm.MeshEmitter(mesh=([[0, 0, 0], [3, 0, 0], [0, 2, 0]], [[0, 1, 2]]), rate=1)).x
    a, b = x[:, 0] / 3, x[:, 1] / 2
    assert ((a >= 0) & (b >= 0) & (a + b <= 1)).all()
    for k, part in ((1, 1 / 3), (2, 1 / 6), (3, 1 / 10)):  # moments of the unit triangle: 2 / ((k + 1) (k + 2))
        for barycentric in (a, b, 1 - a - b):
            assert (barycentric**k).mean() == pytest.approx(part, rel=0.02)


def test_along_the_normal_of_the_mesh():
    emitter = pm.MeshEmitter(mesh=TETRAHEDRON, rate=1, direction="normal", cone=0, speed=3)
    birth = born(emitter, 1000)
    sloped = birth.x.min(axis=1) > 1e-12
    normal = np.array([1 / 2, 1 / 3, 1.0]) / np.linalg.norm([1 / 2, 1 / 3, 1])
    np.testing.assert_allclose(birth.v[sloped], np.broadcast_to(3 * normal, (sloped.sum(), 3)), atol=1e-12)
    assert 0.3 < sloped.mean() < 0.7
    flat = birth.v[birth.x[:, 0] == 0]
    np.testing.assert_allclose(flat, np.broadcast_to([-3.0, 0, 0], flat.shape), atol=1e-12)


# -------------------------------------------------------------------------------------------------------------- volume


def test_a_tetrahedron_is_filled_evenly():
    """Moments of the barycentric coordinates over a tetrahedron: 6 k! / (k + 3)!."""
    x = born(pm.MeshEmitter(mesh=TETRAHEDRON, where="volume", rate=1), 100_000).x / [2, 3, 1]
    for part in (*x.T, 1 - x.sum(axis=1)):
        assert part.min() >= 0
        for k, moment in ((1, 1 / 4), (2, 1 / 10), (3, 1 / 20)):
            assert (part**k).mean() == pytest.approx(moment, rel=0.03)


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.torus(1.0, 0.3, major_sections=48, minor_sections=24),
        trimesh.creation.icosphere(subdivisions=3, radius=0.7),
        trimesh.creation.annulus(0.5, 0.55, 2.0, sections=16),
        hollow(),
    ],
    ids=["torus", "ball", "thin tube", "hollow box"],
)
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_solids_are_filled_evenly(mesh, turn):
    """Centre and second moments of the places are those of the solid; solid angles say what is inside."""
    mesh = mesh.copy()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, (1, 2, 3)))
    x = born(pm.MeshEmitter(mesh=arrays(mesh), where="volume", rate=1)).x
    np.testing.assert_allclose(winding(mesh, x[:1000]), 1, atol=1e-9)
    size = np.ptp(mesh.vertices, axis=0).max()
    np.testing.assert_allclose(x.mean(axis=0), mesh.center_mass, atol=5 * size / np.sqrt(12 * N))
    inertia = mesh.moment_inertia / mesh.volume
    moments = np.cov(x.T)
    np.testing.assert_allclose(np.trace(moments) * np.eye(3) - moments, inertia, atol=0.02 * np.abs(inertia).max())


def test_inside_agrees_with_solid_angles_everywhere():
    mesh = trimesh.creation.torus(1.0, 0.3)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(1.0, (1, 0.3, 0)))
    solid = Solid(triangle_mesh(*arrays(mesh)))
    x = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))
    inside = solid.holds(x)
    np.testing.assert_array_equal(inside, winding(mesh, x) > 0.5)
    assert inside.mean() == pytest.approx(mesh.volume / 27, rel=0.2)
    assert solid.filled > 0.5


def test_places_on_lines_where_triangles_meet_are_inside_once():
    """The middle of a box is below the diagonals of its lid."""
    solid = Solid(triangle_mesh(*arrays(trimesh.creation.box((2, 2, 2)))))
    y = np.linspace(-1.5, 1.5, 12)
    for x, z in ((0.0, 0.0), (0.5, 0.5), (0.25, -0.25)):
        line = np.stack([np.full(12, x), y, np.full(12, z)], axis=1)
        np.testing.assert_array_equal(solid.holds(line), np.abs(y) < 1)


# -------------------------------------------------------------------------------------------------------------- common


@pytest.mark.parametrize("where", ["surface", "volume"])
def test_the_same_births_however_time_is_cut_and_in_copies(where):
    emitter = pm.MeshEmitter(("t", 0, "sin(3*t)"), mesh=TETRAHEDRON, where=where, rate=700, per_distance=100)
    whole = born(emitter, 1.0)
    parts = [emitter.births(a, a + 0.25, 0, "s") for a in (0.0, 0.25, 0.5, 0.75)]
    np.testing.assert_array_equal(np.concatenate([p.x for p in parts]), whole.x)
    for other in (copy.deepcopy(emitter), pickle.loads(pickle.dumps(emitter))):
        np.testing.assert_array_equal(born(other, 1.0).x, whole.x)
    still = pm.MeshEmitter(mesh=TETRAHEDRON, where=where, rate=700)
    at, steady = born(emitter, 1.0), born(still, 1.0)
    mine = at.number < 2**38  # those of the rate
    moved = np.stack([at.time, 0 * at.time, np.sin(3 * at.time)], axis=1)
    np.testing.assert_allclose((at.x - moved)[mine], steady.x, atol=1e-12)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb"])
def test_a_mesh_of_a_file_in_a_scene(suffix, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    ball.export(tmp_path / f"ball.{suffix}")
    (tmp_path / "ball.toml").write_text(
        f'[[emitters]]\ntype = "mesh"\nmesh = "ball.{suffix}"\nposition = ["t", 1, 0]\nwhere = "volume"\n'
    )
    scene = pm.Scene.load(tmp_path / "ball.toml")
    sim = scene.simulation()
    sim.step(120)
    p = sim.system.particles
    assert len(p) > 40
    birth = scene.emitters[0].births(0, 2, 0, "s")
    assert np.linalg.norm(birth.x - np.stack([birth.time, 1 + 0 * birth.time, 0 * birth.time], 1), axis=1).max() < 0.5
    scene.save(tmp_path / "again.toml")
    assert f'mesh = "ball.{suffix}"' in (tmp_path / "again.toml").read_text()
    assert pm.Scene.load(tmp_path / "again.toml") == scene


def test_a_mesh_of_arrays_in_a_scene():
    scene = pm.Scene(emitters=[pm.MeshEmitter(mesh=TETRAHEDRON), pm.MeshEmitter(mesh=triangle_mesh(*TETRAHEDRON))])
    again = pm.Scene.from_toml(scene.to_toml())
    np.testing.assert_array_equal(*(s.emitters[0].births(0, 1, 0, "s").x for s in (scene, again)))


SHEET = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (pm.MeshEmitter, "needs the parameter 'mesh'"),
        (lambda: pm.MeshEmitter(mesh="nobody.obj"), r"mesh file 'nobody\.obj' does not exist"),
        (lambda: pm.MeshEmitter(mesh=3), "a mesh must be the path of a file or a pair"),
        (lambda: pm.MeshEmitter(mesh=([[0, 0, np.nan]], [[0, 0, 0]])), "vertices of a mesh"),
        (lambda: pm.MeshEmitter(mesh=TETRAHEDRON, where="edge"), "unknown value of where: 'edge'"),
        (lambda: pm.MeshEmitter(mesh=SHEET, where="volume"), r"not closed \(3 edges"),
        (lambda: pm.MeshEmitter(mesh=TETRAHEDRON, where="volume", direction="normal"), "direction = 'normal' is not"),
        (
            lambda: pm.MeshEmitter(mesh=(SHEET[0], [[0, 1, 2], [0, 2, 1]]), where="volume"),
            "not allowed for a mesh that is nearly flat",
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says):
        make()
