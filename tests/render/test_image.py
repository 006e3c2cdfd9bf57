import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from render_scenes import FRONT, everything, frame, square

from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Camera, Curves, Points, Segments, Triangles
from pointmass.render import Style, image
from pointmass.render.caption import caption_words

BLACK = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0.0, pool=0.0)
SIZE = (160, 120)


def brightness(picture):
    return picture.astype(float).sum(axis=2)


def linear(picture):
    """Linear light of sRGB bytes."""
    value = picture / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def child(code, **environment):
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {here!r})\n{code}"],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


DIGEST = """
import hashlib
from render_scenes import everything
from pointmass.render import image
print(hashlib.sha256(image(everything(), size=(160, 120)).tobytes()).hexdigest())
"""


def test_same_bytes_twice_and_on_any_number_of_threads():
    here = [hashlib.sha256(image(everything(), size=SIZE).tobytes()).hexdigest() for _ in range(2)]
    there = [child(DIGEST, NUMBA_NUM_THREADS=count) for count in ("1", "2")]
    assert len({*here, *there}) == 1


def test_same_picture_without_compiling():
    code = """
from render_scenes import everything
from pointmass.render import image
print(image(everything(8), size=(24, 16)).tobytes().hex())
"""
    plain = np.frombuffer(bytes.fromhex(child(code, NUMBA_DISABLE_JIT="1").splitlines()[-1]), np.uint8)
    compiled = image(everything(8), size=(24, 16)).ravel()
    assert np.abs(plain.astype(int) - compiled).max() <= 1


def test_importing_loads_no_compiler_and_no_codec():
    code = "import pointmass, pointmass.render; print([m for m in ('numba', 'av', 'PIL') if m in sys.modules])"
    assert child(code) == "[]"


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_ball_covers_its_area(samples):
    ball = Points(name="ball", radius=1.0, color=(1.0, 1.0, 1.0, 1.0))
    picture = image(frame([[0, 0, 0]], ball), camera=FRONT, size=(200, 200), style=Style(samples=samples))
    empty = image(frame([[0, 0, 0]]), camera=FRONT, size=(200, 200), style=Style(samples=samples))
    focal = 100.0 / math.tan(math.radians(15.0))
    radius = focal / math.sqrt(10.0**2 - 1.0)
    touched = (brightness(picture) > brightness(empty) + 8).sum()
    # With several samples a pixel counts when it is touched: half of the edge's pixels more.
    edge = 0.0 if samples == 1 else math.pi * radius
    assert touched == pytest.approx(math.pi * radius**2 + edge, rel=0.02)


def test_small_balls_keep_their_light():
    def total(radius):
        ball = Points(name="ball", radius=radius, color=(0.5, 0.5, 0.5, 1.0))
        return linear(image(frame([[0, 0, 0]], ball), camera=FRONT, size=SIZE, style=BLACK)).sum()

    pixel = 10.0 / (60.0 / math.tan(math.radians(15.0)))
    assert total(0.5 * pixel) / total(0.25 * pixel) == pytest.approx(4.0, rel=0.3)


def test_near_ball_hides_far_ball_in_any_order():
    red, blue = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
    for order in (slice(None), slice(None, None, -1)):
        places = np.array([[0, 0, 2.0], [0, 0, -2.0]])[order]
        colors = np.array([red, blue])[order]
        picture = image(frame(places, Points(name="b", radius=0.5, color=colors)), camera=FRONT, size=SIZE, style=BLACK)
        assert picture[60, 80, 0] > 2 * picture[60, 80, 2]


def test_mesh_hides_glow():
    def centre(z):
        glow = Points(name="glow", radius=0.2, color=(3.0, 3.0, 3.0, 1.0), glow=True)
        return image(frame([[0, 0, z]], glow, square(1.0)), camera=FRONT, size=SIZE, style=BLACK)[60, 80]

    bare = image(frame([[0, 0, 0]], square(1.0)), camera=FRONT, size=SIZE, style=BLACK)[60, 80]
    assert np.abs(centre(-1.0).astype(int) - bare).max() <= 1
    assert (centre(1.0) > bare).all()


def test_glows_add_their_light():
    def at(*colors):
        points = [Points(name=str(i), radius=0.4, color=(*c, 1.0), glow=True) for i, c in enumerate(colors)]
        return linear(image(frame([[0, 0, 0]], *points), camera=FRONT, size=SIZE, style=BLACK)[60, 80])

    red, green = (0.2, 0.0, 0.0), (0.1, 0.3, 0.0)
    assert at(red, green) == pytest.approx(at(red) + at(green), abs=0.01)


def test_bright_glow_keeps_its_hue():
    glow = Points(name="glow", radius=0.4, color=(0.4, 1.2, 6.0, 1.0), glow=True)
    r, g, b = image(frame([[0, 0, 0]], glow), camera=FRONT, size=SIZE, style=BLACK)[60, 80].astype(int)
    assert r < g < b


def test_a_known_point_falls_on_its_pixel():
    glow = Points(name="glow", radius=0.03, color=(1.0, 1.0, 1.0, 1.0), glow=True)
    place = np.array([[1.1, -0.7, 2.0]])
    picture = brightness(image(frame(place, glow), camera=FRONT, size=(320, 240), style=BLACK))
    focal = 120.0 / math.tan(math.radians(15.0))
    column, row = 160.0 + focal * 1.1 / 8.0, 120.0 + focal * 0.7 / 8.0
    ys, xs = np.mgrid[0:240, 0:320] + 0.5
    assert (xs * picture).sum() / picture.sum() == pytest.approx(column, abs=0.1)
    assert (ys * picture).sum() / picture.sum() == pytest.approx(row, abs=0.1)


@pytest.mark.parametrize("width", [0.002, 0.05, 0.4])
@pytest.mark.parametrize("glow", [False, True])
def test_line_covers_length_times_width(width, glow):
    ends = np.array([[-1.0, -0.6, 0.0], [1.0, 0.6, 0.0]])
    line = Segments(name="line", pairs=np.array([[0, 1]]), width=width, color=(0.3, 0.3, 0.3, 1.0), glow=glow)
    light = linear(image(frame(ends, line), camera=FRONT, size=(320, 240), style=BLACK))[:, :, 1]
    if glow or width < 0.01:
        thinner = Segments(
            name="line", pairs=np.array([[0, 1]]), width=width / 2, color=(0.3, 0.3, 0.3, 1.0), glow=glow
        )
        half = linear(image(frame(ends, thinner), camera=FRONT, size=(320, 240), style=BLACK))[:, :, 1]
        assert light.sum() / half.sum() == pytest.approx(2.0, rel=0.35)
    else:
        scale = 120.0 / math.tan(math.radians(15.0)) / 10.0
        area = (math.hypot(2.0, 1.2) * width + math.pi * width**2 / 4.0) * scale**2
        assert (light > 0.02).sum() == pytest.approx(area, rel=0.12 if width > 0.1 else 0.4)


def test_clear_curve_has_no_beads_at_its_joints():
    angle = np.linspace(0.0, 1.2, 40)
    places = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) - [0.8, 0.5, 0.0]
    curve = Curves(
        name="c", index=np.arange(40), offsets=np.array([0, 40]), width=0.1, color=(0.4, 0.4, 0.4, 0.5), glow=True
    )
    light = linear(image(frame(places, curve), camera=FRONT, size=(640, 480), style=BLACK))[:, :, 0]
    assert light.max() == pytest.approx(0.2, abs=0.02)


def test_curves_do_not_join_their_neighbours():
    places = np.array([[-1, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0]], float)
    curves = Curves(name="c", index=np.arange(4), offsets=np.array([0, 2, 4]), width=0.1)
    picture = brightness(image(frame(places, curves), camera=FRONT, size=SIZE, style=BLACK))
    assert picture[55:65, 75:85].max() <= 3
    assert picture.max() > 100


def test_clear_mesh_lets_a_share_through():
    def centre(*drawables):
        return linear(image(frame([[0, 0, 0]], *drawables), camera=FRONT, size=SIZE, style=BLACK)[60, 80])

    behind, before = square(1.0, -1.0, (0.6, 0.1, 0.1, 1.0)), square(1.0, 1.0, (0.1, 0.1, 0.6, 0.25))
    opaque = square(1.0, 1.0, (0.1, 0.1, 0.6, 1.0))
    mixed = centre(behind, before)
    assert mixed == pytest.approx(0.75 * centre(behind) + 0.25 * centre(opaque), abs=0.02)


def test_a_mesh_has_no_seams():
    picture = image(frame([[0, 0, 0]], square(9.0, 0.0, (0.4, 0.4, 0.4, 0.5))), camera=FRONT, size=SIZE, style=BLACK)
    assert np.ptp(picture[20:100, 20:140].astype(int), axis=(0, 1)).max() <= 6


def test_colours_across_a_tilted_mesh_are_straight_in_space():
    corners = np.array([[-1, 0, -6], [-1, 0, 6], [1, 0, 6], [1, 0, -6]], float)
    red, blue = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
    mesh = Triangles(
        name="m", vertices=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]), color=np.array([red, blue, blue, red])
    )
    camera = Camera(position=(0.0, 2.0, 10.0), target=(0.0, 0.0, 0.0), fov=30.0)
    light = linear(image(frame([[0, 0, 0]], mesh), camera=camera, size=(161, 121), style=BLACK)[60, 80])
    # The picture's centre sees the mesh's centre: as much red as blue, but for the tint of the light.
    assert light[0] / light[2] == pytest.approx(1.0, abs=0.25)


def test_shadow_darkens_the_floor_below_a_ball():
    floor = Triangles(
        name="floor",
        vertices=np.array([[-3, 0, -3], [3, 0, -3], [3, 0, 3], [-3, 0, 3]], float),
        faces=np.array([[0, 2, 1], [0, 3, 2]]),
    )
    camera = Camera(position=(0.0, 4.0, 8.0), target=(0.0, 0.0, 0.0))
    ball = Points(name="ball", radius=0.3)
    pictures = [
        image(frame([[0, 1, 0]], floor, ball), camera=camera, size=SIZE, style=Style(light=(0, 1, 0), shadows=shadows))
        for shadows in (True, False)
    ]
    assert brightness(pictures[0])[60, 80] < 0.75 * brightness(pictures[1])[60, 80]
    assert np.abs(pictures[0][100, 80].astype(int) - pictures[1][100, 80]).max() <= 1


def test_arrow_points_to_its_tip():
    arrow = Arrows(name="a", vertices=np.array([[-1.0, 0, 0]]), vectors=np.array([[2.0, 0, 0]]), width=0.1)
    picture = brightness(image(frame([[0, 0, 0]], arrow), camera=FRONT, size=SIZE, style=BLACK)) > 60
    left, right = np.flatnonzero(picture.any(axis=0))[[0, -1]]
    heights = picture.sum(axis=0)
    assert heights[right - 12 : right].max() > 1.8 * heights[left + 4 : left + 20].max()


def test_what_is_not_finite_or_behind_the_eye_is_left_out():
    places = np.array([[0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 10.0], [0, 0, 40.0], [1e300, 0, 0]])
    rows = np.arange(6)
    pairs = np.stack([rows, rows[::-1]], axis=1)
    radius = np.array([0.2, 0.2, 0.2, 0.2, 0.2, np.nan])
    picture = image(
        frame(
            places,
            Points(name="a", radius=radius),
            Points(name="b", radius=radius, glow=True),
            Points(name="zero", radius=0.0),
            Segments(name="c", pairs=np.concatenate([pairs, [[0, 0]]]), width=0.1),
            Curves(name="d", index=rows, offsets=np.array([0, 6]), width=0.1, glow=True),
            Triangles(name="e", faces=np.array([[0, 1, 2], [0, 3, 4], [0, 4, 5], [0, 0, 0]])),
            Arrows(name="f", vertices=places, vectors=places),
            Arrows(name="g", vertices=places, vectors=np.zeros_like(places)),
        ),
        camera=FRONT,
        size=SIZE,
    )
    assert picture.shape == (120, 160, 3)


def test_nothing_at_all():
    none = np.zeros((0, 3))
    drawables = (
        Points(name="a"),
        Segments(name="b", pairs=np.zeros((0, 2), int)),
        Curves(name="c", index=np.zeros(0, int), offsets=np.zeros(1, int)),
        Triangles(name="d", faces=np.zeros((0, 3), int)),
        Arrows(name="e", vertices=none, vectors=none),
    )
    assert image(frame(none, *drawables), size=(7, 5)).shape == (5, 7, 3)
    assert image(frame(none), size=(1, 1)).shape == (1, 1, 3)


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (33, 17)])
def test_odd_sizes(size):
    assert image(everything(), size=size).shape == (size[1], size[0], 3)


def test_types_of_numbers_do_not_matter():
    one = image(everything(dtype=np.float64, index=np.int64), size=SIZE, camera=FRONT)
    other = image(everything(dtype=np.float32, index=np.int32), size=SIZE, camera=FRONT)
    assert np.mean(np.abs(one.astype(int) - other) > 2) < 0.02


@pytest.mark.parametrize("size", [(160, 40), (160, 90), (160, 700), (640, 360), (1280, 720), (7, 5)])
def test_caption_fits_into_the_corner(size):
    scene = frame(np.zeros((0, 3)), energy=-1.23456789e-300, kinetic=1.0, momentum_x=3.0)
    plain, written = (image(scene, camera=FRONT, size=size, style=Style(caption=c)) for c in (False, True))
    rows, columns = np.nonzero((plain != written).any(axis=2))
    if min(size) >= 40:
        assert len(rows)
        assert columns.max() < size[0] - 1
        assert rows.min() > 0.5 * size[1]
    assert (image(scene, camera=FRONT, size=size, style=Style(caption=True)) == written).all()


def test_caption_says_time_and_energy():
    def words(**quantities):
        return caption_words(frame(np.zeros((1, 3)), **quantities))

    assert words() == "t = 0.500 s"
    assert words(energy=4.5649, kinetic=1.0) == "t = 0.500 s   E = 4.565 J"
    assert words(energy=float("nan")) == "t = 0.500 s"


@pytest.mark.parametrize("size", [(0, 5), (5, -1), (1.5, 2), (9000, 10), (5,), (True, 4)])
def test_size_out_of_range(size):
    with pytest.raises(InvalidInput, match="size"):
        image(everything(), size=size)


@pytest.mark.parametrize(
    "drawable",
    [
        Points(name="p", index=np.array([0, 99])),
        Points(name="p", index=np.array([-1])),
        Points(name="p", radius=np.ones(3)),
        Points(name="p", color=np.ones((3, 4))),
        Points(name="p", color=(1.0, 1.0, 1.0)),
        Points(name="p", vertices=np.zeros((3, 2))),
        Segments(name="p", pairs=np.array([[0, 5]])),
        Curves(name="p", index=np.array([0, 1]), offsets=np.array([0, 3])),
        Triangles(name="p", faces=np.array([[0, 1, 7]])),
        Triangles(name="p", faces=np.array([[0, 1, 1]]), color=np.ones((1, 4))),
        Arrows(name="p", vertices=np.zeros((3, 3)), vectors=np.zeros((2, 3))),
    ],
)
def test_drawables_that_do_not_fit_are_named(drawable):
    with pytest.raises(InvalidInput, match="'p'"):
        image(frame(np.zeros((2, 3)), drawable), camera=FRONT, size=(8, 8))


@pytest.mark.parametrize(
    "numbers",
    [{"samples": 0}, {"samples": 5}, {"exposure": 0.0}, {"light": (0, 0, 0)}, {"bloom": -1.0}, {"top": (-1, 0, 0)}],
)
def test_style_out_of_range(numbers):
    with pytest.raises(InvalidInput, match="style"):
        Style(**numbers)


@pytest.mark.parametrize("kind", ["ball", "line"])
@pytest.mark.parametrize("x", [-7.1, -6.9, -6.8, 0.1, 0.25, 6.7, 6.9])
def test_a_glow_lights_nothing_beyond_its_reach(kind, x):
    # Kernels work on tiles of 128 pixels and whole blocks of them: what lies across an edge must not come back.
    ends = np.array([[x, -0.4, 0.0], [x + 0.2, 0.4, 0.0]])
    glow = (
        Points(name="g", index=np.array([0]), radius=0.1, color=(3.0, 3.0, 3.0, 1.0), glow=True)
        if kind == "ball"
        else Segments(name="g", pairs=np.array([[0, 1]]), width=0.1, color=(3.0, 3.0, 3.0, 1.0), glow=True)
    )
    size = (512, 100)
    picture = brightness(image(frame(ends, glow), camera=FRONT, size=size, style=BLACK))
    scale = 50.0 / math.tan(math.radians(15.0)) / 10.0
    rows, columns = np.nonzero(picture > 3)
    assert len(rows) > 20
    assert columns.min() >= 256 + scale * (x - 0.35) - 1
    assert columns.max() <= 256 + scale * (x + 0.2 + 0.35) + 1


def test_an_edit_of_a_helper_is_a_new_kernel():
    from pointmass.render import inner, kernels, kernels_post, kernels_shadow

    for compiled in (kernels.draw, kernels.sort_into_tiles, kernels_post.develop, kernels_shadow.cast):
        assert inner.DIGEST in compiled.py_func.__qualname__
