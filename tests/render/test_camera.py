from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from render_scenes import frame, square

from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Frame, Points, Segments, Triangles
from pointmass.render import fit_camera
from pointmass.render.camera import look, moved

SIZES = st.sampled_from([(1280, 720), (400, 900), (64, 64)])
CLOUDS = arrays(np.float64, st.tuples(st.integers(1, 40), st.just(3)), elements=st.floats(-1e3, 1e3, width=32))


def pixels(camera, size, places):
    view = look(camera, size)
    seen = view.see(places)
    assert (seen[:, 2] > view.near).all()
    return view.project(seen)


def assert_inside(camera, size, places):
    at = pixels(camera, size, places)
    assert (at >= -1e-6).all()
    assert (at <= np.array(size) + 1e-6).all()


@given(CLOUDS, SIZES, st.floats(-180, 180), st.floats(-90, 90), st.floats(5, 120))
@settings(max_examples=150, deadline=None)
def test_all_points_are_in_view(cloud, size, azimuth, elevation, fov):
    camera = fit_camera([frame(cloud, Points(name="p"))], Camera(azimuth=azimuth, elevation=elevation, fov=fov), size)
    assert_inside(camera, size, cloud)


@given(CLOUDS, SIZES)
@settings(max_examples=50, deadline=None)
def test_all_frames_count(cloud, size):
    frames = [frame(row[None], Points(name="p")) for row in cloud]
    assert_inside(fit_camera(frames, size=size), size, cloud)


@given(CLOUDS)
@settings(max_examples=50, deadline=None)
def test_given_target_stays(cloud):
    camera = fit_camera([frame(cloud, Points(name="p"))], Camera(target=(1.0, 2.0, 3.0)))
    assert camera.target == (1.0, 2.0, 3.0)
    assert_inside(camera, (1280, 720), cloud)


def test_given_position_looks_at_the_middle():
    camera = fit_camera([frame([[0, 0, 0], [2, 0, 0]], Points(name="p"))], Camera(position=(1, 0, 9)))
    assert camera.target == pytest.approx((1, 0, 0))
    assert camera.position == (1, 0, 9)


def test_a_complete_camera_is_left_alone():
    camera = Camera(position=(1, 2, 3), target=(0, 0, 0))
    assert fit_camera([], camera) is camera


def test_cloud_fills_the_picture():
    cloud = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    at = pixels(fit_camera([frame(cloud, Points(name="p"))]), (1280, 720), cloud)
    assert np.ptp(at[:, 1]) > 0.75 * 720


def test_a_runaway_does_not_shrink_a_large_cloud():
    cloud = np.random.default_rng(1).uniform(-1, 1, (5000, 3))
    far = cloud.copy()
    far[0] = 1e6
    camera = fit_camera([frame(far, Points(name="p"))])
    at = pixels(camera, (1280, 720), cloud)
    assert np.ptp(at[:, 1]) > 0.6 * 720


def test_a_huge_floor_does_not_shrink_the_scene():
    cloud = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    points = Points(name="p")
    small = fit_camera([frame(cloud, points)])
    large = fit_camera([frame(cloud, points, square(1e4))])
    distances = [np.linalg.norm(np.subtract(c.position, c.target)) for c in (small, large)]
    assert distances[1] < 1.6 * distances[0]


@pytest.mark.parametrize(
    "scene",
    [
        frame(np.zeros((0, 3))),
        frame([[5, 5, 5]]),
        frame([[1e-9, 0, 0]], Points(name="p", radius=0.0)),
        frame([[2, 1, 0]] * 5, Points(name="p")),
        frame(np.full((3, 3), np.nan), Points(name="p")),
        frame([[0, 0, 0], [1, 0, 0]], Segments(name="s", pairs=np.array([[0, 1]]))),
        frame(np.zeros((0, 3)), square(2.0)),
        frame([[0, 0, 0], [1, 0, 0], [0, 1, 0]], Triangles(name="t", faces=np.array([[0, 1, 2]]))),
    ],
)
def test_scenes_without_extent(scene):
    view = look(fit_camera([scene]), (64, 64))
    assert np.isfinite(view.axes).all()
    assert np.isfinite(view.eye).all()


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (0, 90), (0, -90), (90, 0), (200, 40)])
def test_direction_of_an_automatic_camera(azimuth, elevation):
    camera = fit_camera([frame([[0, 0, 0]])], Camera(azimuth=azimuth, elevation=elevation))
    away = np.subtract(camera.position, camera.target)
    a, e = np.radians((azimuth, elevation))
    expected = (np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a))
    assert away / np.linalg.norm(away) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "values",
    [
        {"position": (0.0, float("nan"), 0.0)},
        {"target": (1.0, 2.0)},
        {"up": (0, float("inf"), 0)},
        {"azimuth": float("nan")},
        {"fov": 180.0},
        {"fov": "wide"},
        {"up": (0, 0, 0)},
        {"position": (1, 2, 3), "target": (1.0, 2.0, 3.0)},
        {"position": (1e16, 0, 0), "target": (0, 0, 0)},
        {"position": (1e-13, 0, 0), "target": (0, 0, 0)},
    ],
)
def test_a_camera_that_sees_nothing_is_refused(values: dict[str, object]) -> None:
    with pytest.raises(InvalidInput, match=f"camera.{next(iter(values))}"):
        Camera(**values)  # type: ignore[arg-type]


def test_a_camera_moves_with_the_time_of_a_frame():
    still = Camera(position=(0, 0, 10), target=(0, 0, 0))
    later = Frame(number=3, time=2.0, ids=np.array([4, 7]), positions=np.array([[9.0, 0, 0], [1, 2, 3]]), velocities=0)
    assert moved(still, later) is still
    np.testing.assert_allclose(moved(replace(still, orbit=45.0), later).position, (10, 0, 0), atol=1e-12)
    assert moved(replace(still, dolly=1.5), later).position == pytest.approx((0, 0, 7))
    assert moved(replace(still, dolly=100.0), later).position == pytest.approx((0, 0, 0.5))  # and no nearer
    beside = moved(replace(still, follow=7, orbit=90.0), later)
    np.testing.assert_allclose([beside.position, beside.target], [(1, 2, -7), (1, 2, 3)], atol=1e-12)
    assert moved(replace(still, follow=5), later).target == (0, 0, 0)  # nobody of that name is there


def test_a_path_goes_through_its_rows_and_not_beyond():
    path = ((0, 0, 0, 10, 0, 0, 0), (1, 4, 0, 10, 0, 0, 0), (2, 4, 0, 5, 1, 0, 0))
    camera = fit_camera([frame([[0, 0, 0]])], Camera(path=path))
    places = []
    for time in np.linspace(-1, 3, 41):
        now = moved(camera, Frame(number=0, time=time, ids=np.zeros(0, int), positions=np.zeros((0, 3)), velocities=0))
        places.append([*now.position, *now.target])
    places = np.array(places)
    np.testing.assert_allclose(places[[0, 10, 20, 30, 40]], np.array(path)[[0, 0, 1, 2, 2], 1:], atol=1e-12)
    assert (np.diff(places[:, 0]) >= -1e-12).all()
    assert places[:, 0].max() <= 4 + 1e-12
    for wrong, said in (
        ({"path": ((0, 0, 0, 1, 0, 0),)}, r"camera.path must have shape \(n, 7\)|camera.path"),
        ({"path": (path[1], path[0])}, "times that rise"),
        ({"path": ((0, 1, 1, 1, 1, 1, 1),)}, "not at their targets"),
        ({"follow": -1}, "camera.follow = -1"),
        ({"orbit": np.nan}, "camera.orbit"),
    ):
        with pytest.raises(InvalidInput, match=said):
            Camera(**wrong)
