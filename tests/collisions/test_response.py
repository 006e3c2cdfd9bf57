"""The response, the discrete test of the lecture, wrong arguments."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.collisions.discrete import bounce

UP = np.array([[0.0, 1.0, 0.0]])


def test_the_lecture():
    # V' = V_T - k_r V_N
    after = pm.respond(np.array([[2.0, -3.0, 1.0]]), UP, np.zeros(3), 0.5, 0.0)
    np.testing.assert_array_equal(after, [[2.0, 1.5, 1.0]])


def test_who_leaves_is_left_alone():
    v = np.array([[0.1, 1e-300, 0.3], [0.1, 0.0, 0.3]])
    np.testing.assert_array_equal(pm.respond(v, np.repeat(UP, 2, axis=0), np.zeros(3), 0.5, 0.5), v)


def test_a_moving_surface():
    np.testing.assert_allclose(pm.respond(np.zeros((1, 3)), UP, np.array([0, 2.0, 0]), 1.0, 0.0), [[0, 4.0, 0]])


def test_pairs_that_part_or_coincide():
    x, v = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]])
    one, two = pm.respond_pair(x + UP, v, 1.0, x, -v, 1.0, 1.0)
    np.testing.assert_array_equal([one, two], [v, -v])
    one, two = pm.respond_pair(x, -v, 1.0, x, v, 1.0, 1.0)
    np.testing.assert_allclose([one, two], [v, -v])


def test_discrete_needs_both_tests():
    # (X - P) . N < eps and N . V < 0
    plane = pm.Plane(eps=0.01, restitution=0.5, friction=0, contact="discrete")
    x = np.array([[0, 0.005, 0], [0, 0.005, 0], [0, 0.02, 0], [0, -0.5, 0]], float)
    v = np.array([[0, -1, 0], [0, 1, 0], [0, -1, 0], [0, -1, 0]], float)
    hit = bounce(plane, x, v, np.zeros(4), np.zeros(4), np.ones(4, bool))
    np.testing.assert_array_equal(hit, [True, False, False, True])
    np.testing.assert_array_equal(v[:, 1], [0.5, 1, -1, 0.5])
    np.testing.assert_array_equal(x[:, 1], [0.005, 0.005, 0.02, 0])


def test_discrete_tunnels_and_swept_does_not():
    ends = []
    for contact in ("discrete", "swept"):
        wall = pm.Box(size=(0.1, 5, 5), contact=contact, restitution=1)
        system = pm.ParticleSystem(pm.Particles([[-1, 0, 0]], [[100, 0, 0]]), [], [wall])
        pm.Simulation(system, dt=1 / 60).step(5)
        ends.append(system.particles.x[0, 0] > 0)
    assert ends == [True, False]


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: pm.Plane(restitution=1.5), "restitution"),
        (lambda: pm.Plane(friction=-1), "friction"),
        (lambda: pm.Plane(eps=0), "eps"),
        (lambda: pm.Plane(contact="soft"), "contact"),
        (lambda: pm.Plane(response="melt"), "response = 'melt' is not allowed: it must be 'bounce', 'stick'"),
        (lambda: pm.Plane(normal=(0, 0, 0)), "normal"),
        (lambda: pm.Plane(normal=(0, np.nan, 1)), "normal"),
        (lambda: pm.Plane(point=("charge", 0, 0)), "point may depend on t"),
        (lambda: pm.Plane(point=(np.nan, 0, 0)), "point.x = nan"),
        (lambda: pm.Plane(point=(0, "log(t)", 0)), "at t = 0 s, point.y = -inf is not allowed"),
        (lambda: pm.Sphere(center=(0, np.nan, 0)), "center.y = nan"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0], [0, 1, 0]], shift=(0, 0, np.nan)), "shift.z = nan"),
        (lambda: pm.Sphere(radius=0), "radius"),
        (lambda: pm.Sphere(radius=np.inf), "radius"),
        (lambda: pm.Capsule(radius=-1), "radius"),
        (lambda: pm.Capsule((0, 1, 0), (0, 1, 0)), r"a and b .* both are \[0.0, 1.0, 0.0\]"),
        (lambda: pm.Cylinder((0, 1, 0), (0, np.nan, 0)), "b must be finite"),
        (lambda: pm.Cylinder(radius=0), "radius"),
        (lambda: pm.Box(size=(1, 0, 1)), "size"),
        (lambda: pm.Box(size=(1, 1)), "size"),
        (lambda: pm.Polygon([]), "vertices"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0]]), "vertices"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), "vertices"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]), "vertices"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]]), "one plane"),
        (lambda: pm.Polygon([[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]]), "convex"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]), "vertices"),
        (lambda: pm.Polygon([[0, 0, 0], [1, 0, 0], [0, 1, 0]], thickness=0), "thickness"),
    ],
)
def test_wrong_arguments_are_named(make, names):
    with pytest.raises(pm.InvalidInput, match=names):
        make()


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_normals_of_any_size(size):
    np.testing.assert_allclose(pm.Plane(normal=(3 * size, 4 * size, 0)).direction, [0.6, 0.8, 0], rtol=1e-12)
