from __future__ import annotations

import json

import numpy as np
import pytest

from pointmass.frame import Arrows, Curves, Frame, Points, Segments, Triangles
from pointmass.viewer.messages import FRAME
from pointmass.viewer.pack import pack, versions

KINDS = {"i8": np.int8, "u8": np.uint8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32}


def frame_of(positions, *drawables, dtype=np.float64):
    x = np.asarray(positions, dtype).reshape(-1, 3)
    return Frame(
        number=4,
        time=0.5,
        ids=np.arange(len(x)) + 2**61,
        positions=x,
        velocities=np.zeros_like(x),
        drawables=drawables,
        quantities={"energy": float("nan"), "particles": float(len(x))},
    )


class Unpacked:
    """A frame as the page reads it."""

    def __init__(self, data):
        kind, self.sequence, length = np.frombuffer(data, "<u4", 3)
        assert kind == FRAME
        assert length % 4 == 0
        self.head = json.loads(data[12 : 12 + length])
        self.body = data[12 + length :]

    def array(self, block):
        assert block["offset"] % 4 == 0
        return np.frombuffer(self.body, np.dtype(KINDS[block["type"]]), block["count"], block["offset"])

    def places(self, places):
        q = self.array(places["data"]).reshape(-1, 4)
        assert (q[:, 3] == 0).all()
        return np.array(places["low"]) + np.array(places["size"]) * (q[:, :3] / 65535.0)

    def colors(self, colors):
        q = self.array(colors["data"]).reshape(-1, 4) / 255.0
        return np.concatenate([q[:, :3] ** 2 * colors["scale"], q[:, 3:]], axis=1)


def slow_places(x):
    """The places as the page sees them, the obvious way."""
    good = [row for row in x.astype(float) if np.isfinite(row).all()]
    low, high = np.min(good, axis=0), np.max(good, axis=0)
    result = []
    for row in x.astype(float):
        steps = []
        for a in range(3):
            size = high[a] - low[a]
            part = (row[a] - low[a]) / size if size > 0 else 0.0
            part = min(max(part, 0.0), 1.0) if not np.isnan(part) else 0.0
            steps.append(low[a] + size * (int(part * 65535.0 + 0.5) / 65535.0))
        result.append(steps)
    return np.array(result)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_places_are_those_of_the_obvious_way(dtype):
    x = np.random.default_rng(1).normal(size=(500, 3)) * (3, 0.01, 400) + (7, 0, -5)
    x[3] = np.nan
    x[5, 1] = np.inf
    x[:, 1] = np.where(np.isfinite(x[:, 1]), 2.0, x[:, 1])  # flat along y
    x = x.astype(dtype)
    got = Unpacked(pack(frame_of(x, dtype=dtype), 9, {}))
    assert got.sequence == 9
    assert got.head["count"] == 500
    assert got.head["quantities"]["energy"] is None
    np.testing.assert_allclose(got.places(got.head["places"]), slow_places(x), rtol=0, atol=1e-9)
    fine = np.isfinite(x).all(axis=1)
    error = np.abs(got.places(got.head["places"]) - x)[fine].max(axis=0)
    assert (error <= 0.51 * np.array(got.head["places"]["size"]) / 65535 + 1e-6).all()


def test_nobody_is_a_frame_too():
    got = Unpacked(pack(frame_of(np.zeros((0, 3))), 1, {}))
    assert got.places(got.head["places"]).shape == (0, 3)
    assert got.head["places"]["size"] == [0, 0, 0]


def test_colors_keep_light_of_any_strength():
    rng = np.random.default_rng(2)
    colors = np.concatenate([rng.uniform(0, 40, (300, 3)), rng.uniform(0, 1, (300, 1))], axis=1).astype(np.float32)
    colors[0] = (0, -1, 1e-9, 2)
    points = Points(name="p", color=colors, radius=np.linspace(0.1, 1, 300), glow=True)
    got = Unpacked(pack(frame_of(rng.normal(size=(300, 3)), points), 1, {}))
    part = got.head["items"][0]["part"]
    seen = got.colors(part["color"])
    wanted = np.clip(colors.astype(float), 0, [1e9, 1e9, 1e9, 1])
    scale = wanted[:, :3].max()
    steps = np.floor(np.sqrt(wanted[:, :3] / scale) * 255 + 0.5) / 255
    np.testing.assert_allclose(seen[:, :3], steps**2 * scale, atol=scale * 0.005)
    assert np.abs(np.sqrt(seen[:, :3] / scale) - np.sqrt(wanted[:, :3] / scale)).max() < 0.51 / 255
    assert np.abs(seen[:, 3] - wanted[:, 3]).max() < 0.51 / 255
    np.testing.assert_allclose(got.array(part["radius"]), np.linspace(0.1, 1, 300), rtol=1e-6)
    assert part["count"] == 300
    assert part["rows"] is None
    assert part["glow"]


def test_one_color_for_all_is_sent_once():
    x = np.zeros((4, 3))
    alike = Points(name="p", color=np.tile(np.float32([0.5, 1, 2, 1]), (3, 1)), index=np.array([3, 1, 0]), radius=0.25)
    part = Unpacked(pack(frame_of(x, alike), 1, {})).head["items"][0]["part"]
    assert part["color"] == [0.5, 1, 2, 1]
    assert part["radius"] == 0.25
    assert part["count"] == 3


def test_normals_are_means_of_the_faces_by_area():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(40, 3))
    faces = np.concatenate([rng.permuted(np.arange(39)).reshape(-1, 3) for _ in range(4)]).astype(np.int32)
    mesh = Triangles(name="m", faces=faces)
    got = Unpacked(pack(frame_of(x, mesh), 1, {}))
    item = got.head["items"][0]
    total = np.zeros((40, 3))
    for a, b, c in faces:
        for corner in (a, b, c):
            total[corner] += np.cross(x[b] - x[a], x[c] - x[a])
    seen = got.array(item["normals"]).reshape(-1, 4)
    assert (seen[39] == 0).all()  # in no face
    wanted = total[:39] / np.linalg.norm(total[:39], axis=1)[:, None]
    assert np.abs(seen[:39, :3] / 127 - wanted).max() < 0.51 / 127
    assert item["part"]["normals"] is None
    np.testing.assert_array_equal(got.array(item["part"]["faces"]).reshape(-1, 3), faces)


def test_what_the_page_has_is_not_sent_again():
    x = np.random.default_rng(4).normal(size=(3, 3))
    floor = Triangles(name="floor", vertices=x.astype(np.float32), faces=np.array([[0, 1, 2]]))
    cloth = Triangles(name="cloth", version=7, faces=np.array([[0, 1, 2]]), uv=np.zeros((1, 3, 2), np.float32))
    frame = frame_of(x, floor, cloth)
    first = Unpacked(pack(frame, 1, {}))
    assert all(item["part"] for item in first.head["items"])
    assert first.head["items"][0]["normals"] is None
    assert first.array(first.head["items"][0]["part"]["normals"]).size == 12
    again = Unpacked(pack(frame, 2, versions(frame)))
    assert [item["part"] for item in again.head["items"]] == [None, None]
    assert again.array(again.head["items"][1]["normals"]).size == 12  # it moves
    changed = Unpacked(pack(frame, 3, {"floor": 0, "cloth": 6}))
    assert [item["part"] is None for item in changed.head["items"]] == [True, False]


def test_curves_say_where_they_end():
    x = np.zeros((9, 3))
    curves = Curves(name="c", index=np.array([4, 5, 6, 8, 1]), offsets=np.array([0, 3, 3, 5]))
    got = Unpacked(pack(frame_of(x, curves), 1, {}))
    rows = got.array(got.head["items"][0]["part"]["rows"])
    np.testing.assert_array_equal(rows & 0x7FFFFFFF, [4, 5, 6, 8, 1])
    np.testing.assert_array_equal(rows >> 31, [0, 0, 1, 0, 1])


def test_segments_and_arrows():
    x = np.random.default_rng(5).normal(size=(4, 3))
    springs = Segments(name="s", pairs=np.array([[0, 1], [2, 3]]), width=np.array([0.1, 0.2]))
    field = Arrows(name="a", vertices=x[:2], vectors=x[2:])
    got = Unpacked(pack(frame_of(x, springs, field), 1, {}))
    first, second = (item["part"] for item in got.head["items"])
    np.testing.assert_array_equal(got.array(first["pairs"]), [0, 1, 2, 3])
    np.testing.assert_allclose(got.array(first["width"]), [0.1, 0.2], rtol=1e-6)
    np.testing.assert_allclose(got.array(second["vectors"]).reshape(-1, 3), x[2:], rtol=1e-6)
    np.testing.assert_allclose(got.places(second["places"]), x[:2], atol=1e-4)
