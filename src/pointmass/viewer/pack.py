"""Frames as bytes for a page: see `messages` for the format."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import PATTERNS, Arrows, Curves, Drawable, Floats, Frame, Ints, Points, Segments, Triangles
from pointmass.viewer import kernels
from pointmass.viewer.messages import (
    FRAME,
    ArrowsPart,
    Block,
    Color,
    Colors,
    Contender,
    CurveEnd,
    CurvesPart,
    FrameHead,
    Inspected,
    Item,
    Legend,
    Part,
    Places,
    PointsPart,
    SegmentsPart,
    TrackRows,
    TrianglesPart,
    Vector,
    plain,
    vector,
)
from pointmass.viewer.track import Rows

END_OF_CURVE = np.uint32(1 << 31)
Type = Literal["i8", "u8", "u16", "u32", "f32"]
TYPES: dict[Type, Any] = {"i8": np.int8, "u8": np.uint8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32}
Known = Mapping[str, int]  # versions of drawables, by name


@dataclass
class Body:
    """The arrays of a frame, one after another."""

    chunks: list[bytes] = field(default_factory=list)
    length: int = 0

    def add(self, array: NDArray[Any], kind: Type) -> Block:
        """Put an array at the end."""
        data = np.ascontiguousarray(array, np.dtype(TYPES[kind]).newbyteorder("<")).tobytes()
        block = Block(offset=self.length, count=array.size, type=kind)
        self.chunks.append(data + bytes(-len(data) % 4))
        self.length += len(self.chunks[-1])
        return block


def pack(
    frame: Frame,
    sequence: int,
    known: Known,
    *,
    cost: float = 0.0,
    held: int = -1,
    target: Vector = (0.0, 0.0, 0.0),
    picked: Sequence[int] = (),
    pinned: bool = False,
    tracks: Sequence[Rows] = (),
    legend: Legend | None = None,
    inspected: Inspected | None = None,
    duel: Sequence[Contender] = (),
    curves: Sequence[CurveEnd] = (),
) -> bytes:
    """A frame for a page.

    Parameters
    ----------
    sequence : by which the page says that it has drawn the frame.
    known : what the page has already: drawables that have this version are not sent again.
    tracks : rows that the page has not got.
    cost, held, target, picked, pinned, legend, inspected, duel, curves : see `FrameHead`.
    """
    body = Body()
    places = _places(body, frame.positions)
    items = [_item(body, frame, drawable, known) for drawable in frame.drawables]
    head = FrameHead(
        number=frame.number,
        time=frame.time,
        count=len(frame.positions),
        cost=cost,
        held=held,
        target=target,
        picked=list(picked),
        pinned=pinned,
        quantities=frame.quantities,
        places=places,
        items=items,
        tracks=[
            TrackRows(name=t.name, generation=t.generation, columns=t.columns, data=body.add(t.data, "f32"))
            for t in tracks
        ],
        legend=legend,
        inspected=inspected,
        duel=list(duel),
        curves=list(curves),
    )
    text = json.dumps(plain(head), separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([np.array([FRAME, sequence, len(text)], "<u4").tobytes(), text, *body.chunks])


def versions(frame: Frame) -> dict[str, int]:
    """What a page that has drawn this frame knows."""
    return {drawable.name: drawable.version for drawable in frame.drawables}


def _item(body: Body, frame: Frame, drawable: Drawable, known: Known) -> Item:
    new = known.get(drawable.name) != drawable.version
    moves = isinstance(drawable, Triangles) and drawable.vertices is None and drawable.smooth
    return Item(
        name=drawable.name,
        version=drawable.version,
        part=_part(drawable, body, len(frame.positions)) if new else None,
        normals=_normals(body, frame.positions, drawable.faces) if moves and isinstance(drawable, Triangles) else None,
    )


@singledispatch
def _part(drawable: Any, body: Body, total: int) -> Part:
    """The drawable; `total` is how many places the frame has."""
    raise TypeError(f"nobody knows how to pack {type(drawable).__name__}")


@_part.register
def _(drawable: Points, body: Body, total: int) -> Part:
    rows, own = drawable.index, drawable.vertices
    return PointsPart(
        places=_own_places(body, own),
        count=len(rows) if rows is not None else len(own) if own is not None else total,
        rows=None if rows is None else body.add(rows, "u32"),
        radius=_numbers(body, drawable.radius),
        color=_colors(body, drawable.color),
        glow=drawable.glow,
        soft=drawable.soft,
        flat=drawable.normals is not None,
        daylight=drawable.daylight,
    )


@_part.register
def _(drawable: Segments, body: Body, total: int) -> Part:
    return SegmentsPart(
        places=_own_places(body, drawable.vertices),
        pairs=body.add(drawable.pairs, "u32"),
        width=_numbers(body, drawable.width),
        color=_colors(body, drawable.color),
        glow=drawable.glow,
    )


@_part.register
def _(drawable: Curves, body: Body, total: int) -> Part:
    rows = drawable.index.astype(np.uint32)
    ends = drawable.offsets[1:][np.diff(drawable.offsets) > 0] - 1
    rows[ends] |= END_OF_CURVE
    return CurvesPart(
        places=_own_places(body, drawable.vertices),
        rows=body.add(rows, "u32"),
        width=_numbers(body, drawable.width),
        color=_colors(body, drawable.color),
        glow=drawable.glow,
    )


@_part.register
def _(drawable: Triangles, body: Body, total: int) -> Part:
    own = drawable.vertices
    return TrianglesPart(
        places=_own_places(body, own),
        faces=body.add(drawable.faces, "u32"),
        color=_colors(body, drawable.color),
        smooth=drawable.smooth,
        normals=_normals(body, own, drawable.faces) if own is not None and drawable.smooth else None,
        uv=None if drawable.uv is None else body.add(drawable.uv, "f32"),
        pattern=PATTERNS.index(drawable.pattern),
        pattern_count=drawable.pattern_count,
        pattern_color=drawable.pattern_color,
    )


@_part.register
def _(drawable: Arrows, body: Body, total: int) -> Part:
    return ArrowsPart(
        places=_places(body, drawable.vertices),
        vectors=body.add(drawable.vectors, "f32"),
        width=_numbers(body, drawable.width),
        color=_colors(body, drawable.color),
        glow=drawable.glow,
    )


def _own_places(body: Body, vertices: Floats | None) -> Places | None:
    return None if vertices is None else _places(body, vertices)


def _places(body: Body, places: Floats) -> Places:
    places = np.ascontiguousarray(places)
    low, high = kernels.bounds(places)
    if not (low <= high).all():
        low = high = np.zeros(3)
    out = np.empty((len(places), 4), np.uint16)
    kernels.quantise(places, low, high - low, out)
    return Places(low=vector(low), size=vector(high - low), data=body.add(out, "u16"))


def _normals(body: Body, places: Floats, faces: Ints) -> Block:
    out = np.empty((len(places), 4), np.int8)
    kernels.bend(np.ascontiguousarray(places), np.ascontiguousarray(faces), out)
    return body.add(out, "i8")


def _numbers(body: Body, value: Floats | float) -> float | Block:
    """One number, or one for each item; where all are the same, one."""
    if np.ndim(value) == 0:
        return float(value)
    values = np.asarray(value)
    if len(values) and (values == values[0]).all():
        return float(values[0])
    return body.add(values, "f32")


def _colors(body: Body, value: Floats | Color) -> Color | Colors:
    """One colour, or one for each item; where all are the same, one."""
    colors = np.asarray(value, np.float32)
    if colors.ndim == 2 and len(colors) and not (colors == colors[0]).all():
        scale = float(kernels.brightest(colors))
        out = np.empty((len(colors), 4), np.uint8)
        kernels.tint(colors, scale, out)
        return Colors(scale=scale, data=body.add(out, "u8"))
    red, green, blue, alpha = (colors[0] if len(colors) else np.ones(4)) if colors.ndim == 2 else colors
    return float(red), float(green), float(blue), float(alpha)
