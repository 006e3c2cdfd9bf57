"""Values on grids: interpolation, its exact slopes, edges, and refusals."""

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.laws.grid import Grid

RNG = np.random.default_rng(5)
VALUES = RNG.standard_normal((3, 4, 5, 6, 3))
PLACE = {"origin": (-1.0, 2.0, 0.5), "spacing": (0.5, 1.0, 0.25), "times": [0.0, 1.0, 4.0]}
INSIDE = np.array([-1.0, 2.0, 0.5]) + RNG.uniform(0.01, 0.99, (200, 3)) * np.array([1.5, 4.0, 1.25])


def value(grid, x, t=0.0, component=0, orders=(0, 0, 0, 0)):
    x = np.asarray(x)
    return grid.lookup(component, orders).columns(x[..., 0], x[..., 1], x[..., 2], t)


def test_the_values_at_the_points():
    grid = Grid(VALUES, **PLACE)
    for s, i, j, k in [(0, 0, 0, 0), (1, 2, 3, 4), (2, 3, 4, 5), (0, 3, 0, 5)]:
        place = grid.origin + grid.spacing * (i, j, k)
        for component in range(3):
            assert value(grid, place, grid.times[s], component) == pytest.approx(
                VALUES[s, i, j, k, component], rel=1e-13
            )


def test_a_linear_field_is_exact():
    x, y, z = np.meshgrid(np.arange(4) * 0.5 - 1, np.arange(5) + 2.0, np.arange(6) * 0.25 + 0.5, indexing="ij")
    field = (2 * x - 3 * y + 0.5 * z + 1)[..., None]
    grid = Grid(np.stack([field, 3 * field]), PLACE["origin"], PLACE["spacing"], [1.0, 3.0])
    exact = INSIDE @ (2, -3, 0.5) + 1
    np.testing.assert_allclose(value(grid, INSIDE, 1.0), exact, rtol=1e-12)
    np.testing.assert_allclose(value(grid, INSIDE, 2.0), 2 * exact, rtol=1e-12)
    for axis, slope in enumerate((2, -3, 0.5)):
        orders = tuple(int(k == axis) for k in range(4))
        np.testing.assert_allclose(value(grid, INSIDE, 1.0, 0, orders), slope, rtol=1e-12)


@pytest.mark.parametrize("outside", ["zero", "clamp", "wrap"])
@pytest.mark.parametrize("axis", [0, 1, 2, 3])
def test_slopes_equal_finite_differences(outside, axis):
    grid = Grid(VALUES, **PLACE, outside=outside)
    x = INSIDE + RNG.uniform(-1.5, 1.5, INSIDE.shape)  # some outside
    t = RNG.uniform(-1, 5, len(x))
    h = 1e-7
    dx, dt = h * np.eye(4)[axis, :3], h * (axis == 3)
    near = (value(grid, x + dx, t + dt) - value(grid, x - dx, t - dt)) / (2 * h)
    exact = value(grid, x, t, 0, tuple(int(k == axis) for k in range(4)))
    smooth = np.abs(near - exact) < 1e-5
    assert smooth.sum() >= len(x) - 2  # a point may sit within h of a kink
    assert (value(grid, x, t, 0, tuple(2 * int(k == axis) for k in range(4))) == 0).all()
    lookup = grid.lookup(0)
    assert lookup.derivative(axis).derivative(axis).derivative(axis) is lookup.derivative(axis).derivative(axis)


def test_outside():
    far = np.array([[-9.0, 3.0, 1.0], [0.0, 99.0, 1.0]])
    zero, clamp, wrap = (Grid(VALUES, **PLACE, outside=o) for o in ("zero", "clamp", "wrap"))
    assert (value(zero, far) == 0).all()
    nearest = np.clip(far, clamp.origin, clamp.origin + clamp.spacing * (3, 4, 5))
    np.testing.assert_array_equal(value(clamp, far), value(clamp, nearest))
    period = wrap.spacing * (4, 5, 6)
    np.testing.assert_allclose(value(wrap, INSIDE + 3 * period), value(wrap, INSIDE), rtol=1e-9, atol=1e-12)
    between = wrap.origin + wrap.spacing * (3.5, 0, 0)  # between the last point and the first
    assert value(wrap, between) == pytest.approx((VALUES[0, 3, 0, 0, 0] + VALUES[0, 0, 0, 0, 0]) / 2)


def test_before_and_after_the_snapshots():
    grid = Grid(VALUES, **PLACE)
    np.testing.assert_array_equal(value(grid, INSIDE, -5.0), value(grid, INSIDE, 0.0))
    np.testing.assert_array_equal(value(grid, INSIDE, 99.0), value(grid, INSIDE, 4.0))
    np.testing.assert_allclose(value(grid, INSIDE, 2.5), (value(grid, INSIDE, 1.0) + value(grid, INSIDE, 4.0)) / 2)


def test_an_axis_with_one_point_is_constant():
    plane = Grid(VALUES[0, :, :, :1], (-1, 2, 7), 0.5, outside="zero")
    np.testing.assert_array_equal(value(plane, [[-0.3, 2.2, -99.0]]), value(plane, [[-0.3, 2.2, 99.0]]))
    assert value(plane, [-0.3, 2.2, 1.0], 0.0, 0, (0, 0, 1, 0)) == 0


@pytest.mark.parametrize("outside", ["zero", "clamp", "wrap"])
def test_nan_and_infinity_do_not_hide(outside):
    grid = Grid(VALUES, **PLACE, outside=outside)
    assert np.isnan(value(grid, [np.nan, 3.0, 1.0]))
    assert np.isnan(value(grid, [-0.5, 3.0, np.nan]))
    assert not np.isinf(value(grid, [np.inf, 3.0, 1.0]))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_precision_and_shapes(dtype):
    grid = Grid(VALUES, **PLACE, outside="clamp")
    many = value(grid, INSIDE.astype(dtype), dtype(0.5))
    assert many.dtype == dtype
    assert many.shape == (200,)
    one = value(grid, INSIDE[3].astype(dtype), dtype(0.5))
    assert np.ndim(one) == 0
    assert one == many[3]
    assert value(grid, np.zeros((0, 3), dtype), dtype(0.5)).shape == (0,)
    np.testing.assert_allclose(many, value(grid, INSIDE, 0.5), rtol=0, atol=1e-5)


BAD = VALUES[0].copy()
BAD[1, 2, 3, 0] = np.nan


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ({"values": BAD}, r"cell \(1, 2, 3\) is nan"),
        ({"values": np.stack([VALUES[0], BAD]), "times": [0, 1]}, r"cell \(1, 1, 2, 3\) is nan"),
        ({"values": VALUES[0, 0]}, "must have shape"),
        ({"values": VALUES[0, ..., :2]}, "must have shape"),
        ({"values": np.zeros((0, 1, 1, 3))}, "must have shape"),
        ({"values": "text"}, "must be real numbers"),
        ({"values": VALUES}, "3 snapshots for 1 times"),
        ({"values": VALUES, "times": [0, 0, 1]}, "later than the one before"),
        ({"values": VALUES, "times": [0, 1, np.nan]}, "finite"),
        ({"values": VALUES[0], "spacing": 0.0}, "above 0"),
        ({"values": VALUES[0], "spacing": (1, -1, 1)}, "above 0"),
        ({"values": VALUES[0], "spacing": (1, 1)}, "shape"),
        ({"values": VALUES[0], "spacing": [[1], [1, 2]]}, "spacing of the grid must be numbers"),
        ({"values": VALUES[0] + 1j}, "must be real numbers"),
        ({"values": VALUES[0].astype(str)}, "must be real numbers"),
        ({"values": VALUES[0], "origin": (0, 0)}, "shape"),
        ({"values": VALUES[0], "outside": "mirror"}, "'zero', 'clamp' or 'wrap'"),
    ],
)
def test_refused(arguments, hint):
    with pytest.raises(InvalidInput, match=hint):
        Grid(**arguments)
