"""Solids given by distances on a grid."""

import numpy as np
import pytest

import pointmass as pm

X = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 3, indexing="ij"))
BALL = np.sqrt((X**2).sum(axis=0)) - 0.7
ENGINES = pytest.mark.parametrize("compiled", [False, True])


def points(n, size=1.0):
    return np.random.default_rng(1).uniform(-size, size, (n, 3))


def simulation(x, v, colliders, dt, compiled, g=(0, -9.81, 0)):
    system = pm.ParticleSystem(pm.Particles(x, v), [pm.Gravity(g)], colliders)
    return pm.Simulation(system, pm.Leapfrog(), dt, compiled=compiled)


def test_distances_and_normals_are_those_of_the_ball():
    x = points(500)
    x = x[np.linalg.norm(x, axis=1) > 0.3]  # its middle is a tip
    ball = pm.DistanceGrid(BALL, spacing=0.05)
    size = np.linalg.norm(x, axis=1)
    np.testing.assert_allclose(ball.distance(x, 0.0), size - 0.7, atol=2e-3)
    np.testing.assert_allclose(ball.normal(x, 0.0), x / size[:, None], atol=0.1)
    bowl = pm.DistanceGrid(BALL, spacing=0.05, inside=True)
    np.testing.assert_array_equal(bowl.distance(x, 0.0), -ball.distance(x, 0.0))
    np.testing.assert_array_equal(bowl.normal(x, 0.0), -ball.normal(x, 0.0))


def test_a_linear_field_is_exact():
    n = np.array([2.0, 3.0, -6.0]) / 7
    slope = pm.DistanceGrid(np.einsum("k,kabc->abc", n, X) - 0.1, spacing=0.05)
    x = points(200, 0.3)
    np.testing.assert_allclose(slope.distance(x, 0.0), x @ n - 0.1, atol=1e-13)
    np.testing.assert_allclose(slope.normal(x, 0.0), np.broadcast_to(n, x.shape), atol=1e-12)
    assert slope.steepness == pytest.approx(1, rel=1e-12)


def test_beyond_the_grid_there_is_nothing():
    half = pm.DistanceGrid(X[1].copy(), spacing=0.05)  # solid below y = 0, down to -1
    outside = np.array([[0, -1.5, 0], [2, -0.5, 0], [0, 3, 0]])
    np.testing.assert_allclose(half.distance(outside, 0.0), [0.5, 1, np.sqrt(1 + 4)])
    np.testing.assert_allclose(half.normal(outside, 0.0)[:2], [[0, -1, 0], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(half.distance(np.array([[0.9, -0.5, 0.0]]), 0.0), [-0.1])
    np.testing.assert_allclose(half.normal(np.array([[0.9, -0.5, 0.0]]), 0.0), [[1, 0, 0]])


def test_a_file_holds_it_all(tmp_path):
    np.savez(tmp_path / "ball.npz", values=BALL, spacing=0.05, origin=[0, 0, 0])
    ball = pm.DistanceGrid(tmp_path / "ball.npz")
    assert ball.distance(np.array([[1.0, 1, 1]]), 0.0)[0] == pytest.approx(-0.7)
    (tmp_path / "a.toml").write_text(
        "[[bodies]]\ntype = 'points'\nx = [[0, 2, 0]]\n[[colliders]]\ntype = 'distance_grid'\ndistances = 'ball.npz'\n"
    )
    scene = pm.Scene.load(tmp_path / "a.toml")
    scene.save(tmp_path / "b.toml")
    assert 'distances = "ball.npz"' in (tmp_path / "b.toml").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"distances": np.where(BALL[0, 0, 0] == BALL, np.nan, BALL), "spacing": 1}, "distances must be finite"),
        ({"distances": BALL}, "needs its spacing"),
        ({"distances": BALL, "spacing": 0}, "spacing = 0 is not allowed"),
        ({"distances": BALL + 1, "spacing": 1}, r"below 0 in the solid .* from 0\.3 to"),
        ({"distances": BALL[:1], "spacing": 1}, "at least 2 x 2 x 2"),
        ({"distances": BALL[0], "spacing": 1}, r"must have shape \(n, n, n\)"),
        ({"distances": BALL, "spacing": 0.05, "origin": (0, np.inf, 0)}, "origin must be finite"),
        ({"distances": BALL, "spacing": 5}, r"about 1 m for each metre near the surface, not by 0\.01 m"),
        ({"distances": BALL**3, "spacing": 0.05}, "make other fields distances first"),
        ({"distances": "none.npz"}, "does not exist"),
        ({"distances": "none.vti"}, r"must end in \.npz"),
        ({"distances": "none.npz", "spacing": 1}, "stand in the file"),
    ],
)
def test_bad_grids_are_refused(arguments, message):
    with pytest.raises(pm.InvalidInput, match=message):
        pm.DistanceGrid(**arguments)


def test_damaged_files_are_refused(tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(pm.InvalidInput, match=r"bad\.npz': it is damaged"):
        pm.DistanceGrid(tmp_path / "bad.npz")
    np.savez(tmp_path / "some.npz", values=BALL)
    with pytest.raises(pm.InvalidInput, match=r"it has no array 'spacing'; it has values"):
        pm.DistanceGrid(tmp_path / "some.npz")


@ENGINES
def test_C07_nothing_tunnels(compiled):
    rng = np.random.default_rng(2)
    way = rng.normal(size=(100, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    shell = pm.DistanceGrid(np.abs(BALL) - 0.06, spacing=0.05, restitution=1.0, friction=0.0)
    for speed, dt in ((100.0, 1e-3), (1e4, 1 / 60)):
        sim = simulation(0.1 * way, speed * way, [shell], dt, compiled)
        sim.step(3)
        x = sim.system.particles.x
        assert (np.linalg.norm(x, axis=1) < 0.7).all()
        assert (shell.distance(x, sim.t) >= -1e-9).all()


@ENGINES
def test_a_flake_on_a_slope_does_not_creep(compiled):
    n = np.array([-0.4, 1.0, 0.1]) / np.linalg.norm([-0.4, 1.0, 0.1])
    slope = pm.DistanceGrid(np.einsum("k,kabc->abc", n, X), spacing=0.05, friction=0.5)
    sim = simulation([[0.1, 0.05, 0.2]], [[0, 0, 0]], [slope], 1 / 60, compiled)
    sim.step(60)
    held = sim.system.particles.x.copy()
    assert abs(slope.distance(held, 0.0)[0]) <= slope.eps
    sim.step(600)
    np.testing.assert_array_equal(sim.system.particles.x, held)
