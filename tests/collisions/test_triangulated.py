"""Meshes and height fields: distances and normals against the slow obvious ones, and what particles do there."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import pointmass as pm
from pointmass.collisions.swept import Paths, first_hit
from tests import naive

KNOT = trimesh.creation.torus(1.0, 0.35, major_sections=11, minor_sections=7)
BALL = trimesh.creation.icosphere(2)
HOLED = (BALL.vertices, BALL.faces[BALL.triangles_center[:, 1] < 0.4])  # a bowl
SQUARE = ([[-5, 0, -5], [-5, 0, 5], [5, 0, 5], [5, 0, -5]], [[0, 1, 2], [0, 2, 3]])
SLOPE = np.tan(np.radians(25))
ENGINES = pytest.mark.parametrize("compiled", [False, True])


def simulation(x, v, colliders, dt, solver=None, compiled=False, g=(0, -9.81, 0), **particles):
    system = pm.ParticleSystem(pm.Particles(x, v, **particles), [pm.Gravity(g)], colliders)
    return pm.Simulation(system, solver or pm.Leapfrog(), dt, compiled=compiled)


def hills(nx=9, nz=7):
    x, z = np.meshgrid(np.linspace(-2, 2, nx), np.linspace(-1.5, 1.5, nz), indexing="ij")
    return 0.4 * np.sin(2 * x + z)


# ------------------------------------------------------------------------------------------------ distances


SHAPES = {
    "knot": pm.Mesh((KNOT.vertices, KNOT.faces)),
    "room": pm.Mesh((KNOT.vertices, KNOT.faces), inside=True),
    "bowl": pm.Mesh(HOLED, thickness=0.1),
    "hills": pm.HeightField(hills(), (4, 3)),
    "triangle": pm.Mesh(([[0, 0, 0], [1, 0, 0.2], [0.3, 1, 0]], [[0, 1, 2]])),
}


def naive_distance(shape, p):
    mesh = shape.triangles
    away = naive.distance_to_triangles(list(p), mesh.vertices.tolist(), mesh.faces.tolist())
    if shape.half:
        return away - shape.half
    inside = naive.winding_number(list(p), mesh.vertices.tolist(), mesh.faces.tolist()) > 0.5
    return shape.sign * (-away if inside else away)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(SHAPES)), st.tuples(*[st.floats(-2.5, 2.5)] * 3))
def test_distance_is_that_to_the_nearest_of_all_triangles(name, p):
    shape = SHAPES[name]
    assert shape.distance(np.array([p]), 0.0)[0] == pytest.approx(naive_distance(shape, p), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["knot", "hills"]), st.integers(0, 10**6), st.sampled_from([0.0, 1e-12, 1e-6, -1e-6]))
def test_near_corners_and_edges(name, number, off):
    shape = SHAPES[name]
    mesh = shape.triangles
    pairs, _ = mesh.edges
    places = np.concatenate([mesh.vertices, mesh.vertices[pairs].mean(axis=1)])
    p = places[number % len(places)] + off * np.random.default_rng(number).normal(size=3)
    d, n = shape.look(p[None])
    assert abs(d[0]) == pytest.approx(abs(naive_distance(shape, p)), abs=1e-14)
    assert np.linalg.norm(n[0]) == pytest.approx(1, rel=1e-12)


def test_who_is_near_is_never_called_far():
    x = np.random.default_rng(1).uniform(-2.5, 2.5, (4000, 3))
    for shape in SHAPES.values():
        cubes = shape.voxels
        at = np.floor((x - cubes.origin) / cubes.size).astype(int)
        within = ((at >= 0) & (at < cubes.counts)).all(axis=1)
        away = np.linalg.norm(x - cubes.origin - cubes.size * (at + 0.5), axis=1)[within]
        bound = cubes.bounds.reshape(cubes.counts)[tuple(at[within].T)] - away
        assert (bound <= shape.distance(x[within], 0.0) + 1e-12).all()
        assert (bound > 0).any()


def test_a_point_that_is_no_number_has_no_distance():
    d, _ = SHAPES["knot"].look(np.array([[np.nan, 0, 0], [np.inf, 0, 0], [2.0, 0, 0]]))
    assert np.isnan(d[:2]).all()
    assert d[2] == pytest.approx(0.65, abs=0.03)


def test_a_hundred_thousand_triangles():
    fine = trimesh.creation.icosphere(6)
    ball = pm.Mesh((fine.vertices, fine.faces))
    x = np.random.default_rng(1).normal(size=(500, 3))
    assert len(ball.triangles.faces) == 81920
    np.testing.assert_allclose(ball.distance(x, 0.0), np.linalg.norm(x, axis=1) - 1, atol=2e-4)


# ------------------------------------------------------------------------------------------------ height fields


def test_the_ground_is_as_high_as_given():
    h = hills()
    ground = pm.HeightField(h, (4, 3), height=2.0, shift=(1, 10, 0))
    x, z = np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-1.5, 1.5, 7), indexing="ij")
    on = np.stack([x + 1, 2 * h + 10, z], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(ground.distance(on, 0.0), 0, atol=1e-12)
    assert (ground.distance(on + np.array([0, 0.1, 0]), 0.0) > 0).all()
    mesh = ground.triangles
    assert mesh.closed
    means = (2 * h[:-1, :-1] + 2 * h[1:, 1:] + h[1:, :-1] + h[:-1, 1:]) / 6  # of two triangles along that diagonal
    volume = 2 * (4 / 8 * 3 / 6) * means.sum() + 12 * (1 - 2 * h.min())
    assert mesh.volume == pytest.approx(volume, rel=1e-12)


def test_a_plane_slope_is_that_plane():
    x = np.linspace(-5, 5, 11)
    ground = pm.HeightField(np.outer(SLOPE * x, np.ones(11)), (10, 10), depth=3)
    plane = pm.Plane(normal=(-SLOPE, 1, 0))
    p = np.random.default_rng(1).uniform(-1, 1, (100, 3))
    np.testing.assert_allclose(ground.distance(p, 0.0), plane.distance(p, 0.0), atol=1e-12)
    np.testing.assert_allclose(ground.normal(p, 0.0), plane.normal(p, 0.0), atol=1e-12)


def test_beyond_its_border_there_is_nothing():
    ground = pm.HeightField(np.zeros((3, 3)), (2, 2), depth=0.5)
    np.testing.assert_allclose(ground.distance(np.array([[4.0, -3, 0], [0, -1, 0]]), 0.0), [np.hypot(3, 2.5), 0.5])
    sim = simulation([[0.9, 1.0, 0.0]], [[1.0, 0, 0]], [ground], 1 / 60)
    sim.step(120)
    assert sim.system.particles.x[0, 1] < -5


def test_heights_from_files(tmp_path):
    h = hills()
    np.save(tmp_path / "h.npy", h)
    np.savez(tmp_path / "h.npz", heights=h)
    for name in ("h.npy", "h.npz"):
        np.testing.assert_array_equal(pm.HeightField(tmp_path / name, (4, 3)).heights, h)
    grey = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20  # 3 rows along z, 4 columns along x
    Image.fromarray(grey).save(tmp_path / "h.png")
    np.testing.assert_allclose(pm.HeightField(tmp_path / "h.png", height=2.0).heights, 2 / 255 * grey.T)
    Image.fromarray(grey.astype(np.uint16) * 257).save(tmp_path / "deep.png")
    np.testing.assert_allclose(pm.HeightField(tmp_path / "deep.png").heights, grey.T / 255)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"heights": [[0, 1], [np.nan, 0]]}, "heights must be finite"),
        ({"heights": [[0, 1, 2]]}, "at least 2 x 2"),
        ({"heights": [1, 2, 3]}, r"must have shape \(n, n\)"),
        ({"heights": "none.png"}, "does not exist"),
        ({"heights": "none.txt"}, r"must end in \.npy"),
        ({"heights": np.eye(2), "size": (0, 1)}, "must be greater than 0"),
        ({"heights": np.eye(2), "depth": 0}, "depth = 0"),
        ({"heights": np.eye(2), "height": -1}, "height = -1"),
    ],
)
def test_bad_ground_is_refused(arguments, message):
    with pytest.raises(pm.InvalidInput, match=message):
        pm.HeightField(**arguments)


def test_damaged_height_files_are_refused(tmp_path):
    np.save(tmp_path / "cut.npy", hills())
    for name, content in (
        ("cut.npy", (tmp_path / "cut.npy").read_bytes()[:150]),
        ("noise.png", b"no picture"),
        ("noise.npz", b"PK\x03\x04"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(pm.InvalidInput, match=rf"height file '.*{name}': it is damaged"):
            pm.HeightField(tmp_path / name)
    np.savez(tmp_path / "two.npz", a=hills(), b=hills())
    with pytest.raises(pm.InvalidInput, match="it must hold one array, but it holds a, b"):
        pm.HeightField(tmp_path / "two.npz")


# ------------------------------------------------------------------------------------------------ meshes


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mesh": SQUARE, "inside": True}, "inside = True needs a closed mesh, but 4 edges"),
        ({"mesh": SQUARE, "thickness": 1e-5}, "thickness = 1e-05 is not allowed: .* at least 0.0001"),
        ({"mesh": SQUARE, "scale": 0}, "scale = 0"),
        ({"mesh": "none.stl"}, "does not exist"),
        ({"mesh": "scene.toml"}, "must end in"),
        ({"mesh": 3}, "the path of a file or a pair"),
    ],
)
def test_bad_meshes_are_refused(arguments, message):
    with pytest.raises(pm.InvalidInput, match=message):
        pm.Mesh(**arguments)


def test_air_does_not_flow_around_meshes():
    with pytest.raises(pm.InvalidInput, match=r"around holds a Mesh, .* use spheres"):
        pm.CurlNoise(around=[SHAPES["knot"]])


@pytest.mark.parametrize("ending", [".obj", ".stl", ".ply", ".glb"])
def test_a_scene_finds_its_mesh(ending, tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    BALL.export(folder / f"ball{ending}")
    (folder / "a.toml").write_text(
        '[[bodies]]\ntype = "points"\nx = [[0, 2, 0]]\n'
        f'[[colliders]]\ntype = "mesh"\nmesh = "ball{ending}"\nscale = 0.5\n'
        "[[colliders]]\ntype = 'height_field'\nheights = [[0, 0], [0, 1]]\nshift = [0, -3, 0]\n"
    )
    scene = pm.Scene.load(folder / "a.toml")
    assert scene.simulation().system.colliders[0].distance(np.zeros((1, 3)), 0.0)[0] == pytest.approx(-0.5, abs=0.05)
    scene.save(tmp_path / "b.toml")
    assert f'mesh = "scenes/ball{ending}"' in (tmp_path / "b.toml").read_text()
    assert pm.Scene.load(tmp_path / "b.toml").to_toml() == scene.to_toml()


# ------------------------------------------------------------------------------------------------ C06, C07, bullets


@ENGINES
def test_C06_a_moving_sheet_throws(compiled):
    sheet = pm.Mesh(SQUARE, shift=(0, "-1+3*t", 0), restitution=1.0, friction=0.0)
    sim = simulation([[0.3, 0, 0.2]], [[0.0, 0, 0]], [sheet], 1 / 60, compiled=compiled, g=(0, 0, 0))
    sim.step(30)
    np.testing.assert_allclose(sim.system.particles.v[0], [0, 6, 0], atol=1e-9)


@ENGINES
def test_C07_nothing_tunnels(compiled):
    """Bullets at thin sheets, a mesh's shell, corners and edges, at any step size."""
    rng = np.random.default_rng(2)
    way = rng.normal(size=(120, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    way[:12] = BALL.vertices[:12]  # straight at its corners
    shell = pm.Mesh((BALL.vertices, BALL.faces), inside=True, restitution=1.0, friction=0.0)
    wide = pm.Mesh((3 * BALL.vertices, BALL.faces), inside=True)
    for speed in (100.0, 1e4):
        for dt in (1e-4, 1 / 60):
            sim = simulation(0.1 * way, speed * way, [shell, wide], dt, compiled=compiled)
            sim.step(3)
            assert (shell.distance(sim.system.particles.x, sim.t) >= -1e-9).all()


@pytest.mark.parametrize("speed", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("angle", [0.0, 80.0, 89.0])
def test_a_bullet_hits_a_thin_sheet_where_it_is(speed, angle):
    sheet = pm.Mesh(SQUARE, thickness=1e-3)
    a = np.radians(angle)
    way = speed * np.array([[np.sin(a), -np.cos(a), 0]])
    start = np.array([[-2.0 * np.tan(a) * 0.01, 0.01, 0.1]])
    path = Paths(start, way, start + way, way, np.zeros(1), np.ones(1), np.zeros(1))
    hit = first_hit(sheet, path)[0]
    assert hit * speed * np.cos(a) == pytest.approx(0.01 - 5e-4, abs=1e-9)


def test_a_path_that_skims_a_surface_is_not_stopped_far_from_it():
    ring = SHAPES["knot"]
    for height, meets in ((1.36, False), (1.2, True)):
        start, way = np.array([[-50.0, height, 0.0]]), np.array([[100.0, 0, 0]])
        path = Paths(start, way, start + way, way, np.zeros(1), np.ones(1), np.zeros(1))
        assert np.isfinite(first_hit(ring, path)[0]) == meets


# ------------------------------------------------------------------------------------------------ resting, sliding


@ENGINES
@pytest.mark.parametrize("kind", ["sheet", "ground"])
def test_a_flake_on_a_slope_rests_or_slides(kind, compiled):
    """C04 on a mesh: below the friction angle nothing creeps, above it a = g (sin - mu cos)."""
    if kind == "sheet":
        corners = [[-50, -50 * SLOPE, -5], [-50, -50 * SLOPE, 5], [50, 50 * SLOPE, 5], [50, 50 * SLOPE, -5]]
        make, lift = (lambda mu: pm.Mesh((corners, SQUARE[1]), friction=mu, thickness=0.02)), 0.01
    else:
        x = np.linspace(-50, 50, 12)
        make, lift = (lambda mu: pm.HeightField(np.outer(SLOPE * x, np.ones(5)), (100, 10), friction=mu)), 0.0
    n = np.array([-SLOPE, 1, 0]) / np.hypot(SLOPE, 1)
    start = np.array([[0.3, SLOPE * 0.3, 0.7]]) + lift * n
    sim = simulation(start, [[0, 0, 0]], [make(1.1 * SLOPE)], 1 / 60, compiled=compiled)
    sim.step(2)
    held = sim.system.particles.x.copy()
    sim.step(600)
    np.testing.assert_array_equal(sim.system.particles.x, held)
    assert not sim.system.particles.v.any()
    sim = simulation(start, [[0, 0, 0]], [make(0.9 * SLOPE)], 1 / 60, compiled=compiled)
    sim.step(60)
    angle = np.arctan(SLOPE)
    a = 9.81 * (np.sin(angle) - 0.9 * SLOPE * np.cos(angle))
    went = np.linalg.norm(sim.system.particles.x - start)
    assert went == pytest.approx(0.5 * a * sim.t**2, rel=1e-3)


@ENGINES
def test_C01_a_ball_bounces_off_a_mesh_as_off_a_plane(compiled):
    material = {"restitution": 0.8, "friction": 0.0}
    results = []
    for floor, lift in ((pm.Plane(**material), 0.0), (pm.Mesh(SQUARE, thickness=0.02, **material), 0.01)):
        sim = simulation([[0.3, 1 + lift, 0.2]], [[0.5, 0, 0]], [floor], 1 / 60, compiled=compiled)
        sim.step(100)
        results.append(sim.system.particles.x[0] - np.array([0, lift, 0]))
    np.testing.assert_allclose(results[1], results[0], atol=1e-9)


@ENGINES
def test_who_slides_over_an_edge_flies_on(compiled):
    """From level ground over an edge of 45 degrees: a parabola, not a path along the slope."""
    heights = np.outer([0, 0, 0, -5, -10], np.ones(3))  # the edge at x = 0
    ground = pm.HeightField(heights, (20, 10), friction=0.0)
    sim = simulation([[-1.0, 0, 0]], [[6.0, 0, 0]], [ground], 1 / 60, compiled=compiled)
    sim.step(30)
    fall = sim.t - 1 / 6
    x = sim.system.particles.x[0]
    assert x[0] == pytest.approx(-1 + 6 * sim.t, abs=0.03)
    assert x[1] == pytest.approx(-0.5 * 9.81 * fall**2, abs=0.06)


@ENGINES
def test_in_a_valley_a_flake_comes_to_rest(compiled):
    heights = np.outer(np.abs(np.linspace(-1, 1, 5)), np.ones(3))
    ground = pm.HeightField(heights, (2, 4), friction=0.3, restitution=0.2)
    sim = simulation([[0.6, 1.0, 0.1]], [[0, 0, 0]], [ground], 1 / 120, compiled=compiled)
    sim.step(1200)
    p = sim.system.particles
    assert np.abs(p.x[0, :2]).max() < 0.02
    assert np.abs(p.v).max() < 0.05


@ENGINES
@pytest.mark.parametrize("response", ["stick", "kill", "slide"])
def test_responses(response, compiled):
    ground = pm.HeightField(hills(), (4, 3), response=response)
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (30, 3)) + np.array([0, 2, 0])
    sim = simulation(x, np.zeros((30, 3)), [ground], 1 / 60, compiled=compiled)
    sim.step(60)
    p = sim.system.particles
    if response == "kill":
        assert len(p) == 0
    elif response == "stick":
        np.testing.assert_allclose(p.x[:, [0, 2]], x[:, [0, 2]], atol=1e-9)
        np.testing.assert_allclose(ground.distance(p.x, 0.0), 0, atol=1e-9)
        assert not p.v.any()
    else:
        assert (ground.distance(p.x, 0.0) > -1e-9).all()
        assert np.abs(p.x[:, [0, 2]] - x[:, [0, 2]]).max() > 0.01


def test_linked_particles_lie_on_the_ground():
    """Cloth, stepped with its springs, on a mesh: an island of many particles."""
    results = []
    for compiled in (False, True):
        chain = pm.chain(6, length=1.5)
        chain.particles.x[:, 1] += 0.5 - chain.particles.x[:, 1].min()
        system = pm.ParticleSystem(chain.particles, [pm.Gravity(), *chain.forces], [pm.HeightField(hills(), (4, 3))])
        sim = pm.Simulation(system, pm.Leapfrog(), 1 / 240, compiled=compiled)
        sim.step(80)
        assert (system.colliders[0].distance(system.particles.x, sim.t) > -1e-9).all()
        results.append(system.particles.x.copy())
    np.testing.assert_allclose(results[0], results[1], atol=1e-6)
