"""Patterns on meshes: pieces have the area of the whole, and every pixel has the colour of its field."""

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Frame, Triangles
from pointmass.render import Style, image
from pointmass.render.pattern import patterned

RNG = np.random.default_rng(3)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def surface(pattern, count, faces=FACES, **more):
    flat = {"uv": SQUARE[faces][:, :, :2], "color": (1, 0, 0, 1), "pattern_color": (0, 0, 1)}
    return Triangles(name="rag", faces=faces, pattern=pattern, pattern_count=count, **flat | more)


def areas(pieces):
    a, b, c = pieces[:, 0, :2], pieces[:, 1, :2], pieces[:, 2, :2]
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def field(pattern, count, uv):
    u, v = np.floor(count * uv[:, 0]), np.floor(count * uv[:, 1])
    return {"stripes": u, "bands": v, "checker": u + v}[pattern] % 2


@pytest.mark.parametrize("pattern", ["stripes", "bands", "checker"])
@pytest.mark.parametrize("count", [1, 2, 7])
def test_pieces_fill_the_triangle_and_each_is_in_one_field(pattern, count):
    flat = RNG.uniform(0, 1, (40, 3, 2))
    flat = np.where((areas(flat) < 0)[:, None, None], flat[:, ::-1], flat)
    full = np.concatenate([flat, np.ones((40, 3, 3)), np.full((40, 3, 1), 0.5)], axis=2)
    pieces = patterned(full, flat, slice(2, 5), surface(pattern, count))
    assert areas(pieces).sum() == pytest.approx(areas(flat).sum(), rel=1e-12)
    assert (areas(pieces) >= -1e-15).all(), "no piece is turned over"
    assert (pieces[:, :, 5] == 0.5).all(), "the alpha stays"
    inner = pieces[:, :, :2].mean(axis=1, keepdims=True) + 0.99 * (
        pieces[:, :, :2] - pieces[:, :, :2].mean(1, keepdims=True)
    )
    for corner in range(3):
        blue = pieces[:, corner, 2] == 0
        np.testing.assert_array_equal(field(pattern, count, inner[:, corner]), blue)


def test_lines_along_edges_cut_nothing():
    grid = np.concatenate([SQUARE[:, :2] / 4 + [i / 4, j / 4] for i in range(4) for j in range(4)])
    faces = np.concatenate([FACES + 4 * k for k in range(16)])
    uv = grid[faces]
    full = np.concatenate([uv, np.zeros((32, 3, 4))], axis=2)
    assert len(patterned(full, uv, slice(2, 5), surface("checker", 4))) == 32


@pytest.mark.parametrize("pattern", ["stripes", "bands", "checker"])
def test_a_picture_has_the_pattern(pattern):
    frame = Frame(
        number=0, time=0.0, ids=np.arange(4), positions=SQUARE, velocities=0 * SQUARE, drawables=(surface(pattern, 5),)
    )
    camera = Camera(position=(0.5, 0.5, 2.0), target=(0.5, 0.5, 0.0))
    picture = image(frame, camera=camera, size=(120, 120), style=Style(shadows=False)).astype(int)
    middles = (np.arange(5) + 0.5) / 5
    scale = 120 / (2 * 2.0 * np.tan(np.radians(35) / 2))
    for u in middles:
        for v in middles:
            red, _, blue = picture[round(59.5 - scale * (v - 0.5)), round(59.5 + scale * (u - 0.5))]
            assert (blue > red) == field(pattern, 5, np.array([[u, v]]))[0]


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (surface("dots", 3), "unknown pattern of drawable 'rag': 'dots'"),
        (surface("checker", 0), "has pattern_count = 0"),
        (surface("checker", 3, uv=np.zeros((1, 3, 2))), r"no finite uv of shape \(2, 3, 2\)"),
    ],
)
def test_what_cannot_be_drawn_is_said(made, says):
    frame = Frame(number=0, time=0.0, ids=np.arange(4), positions=SQUARE, velocities=0 * SQUARE, drawables=(made,))
    with pytest.raises(InvalidInput, match=says):
        image(frame, size=(32, 32))
