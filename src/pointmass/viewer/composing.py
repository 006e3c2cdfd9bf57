"""Several frames in one: one beside the other or all in one place, each in a colour of its own."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import linear
from pointmass.frame import Arrows, Curves, Drawable, Frame, Points, Segments, Triangles

THIN = 0.6  # of a ghost's balls and lines
FLOORS = "plane "  # drawn once for all


@dataclass(frozen=True, eq=False)
class Part:
    """A frame, and how it is shown: its colour, how far from its place [m], and whether it is only a ghost."""

    name: str
    color: str
    offset: NDArray[np.float64]
    frame: Frame
    ghost: bool


class Composer:
    """Makes one frame of several, in which a drawable that is the same has the same version."""

    def __init__(self) -> None:
        self._versions: dict[str, tuple[Hashable, int]] = {}

    def frame(self, parts: Sequence[Part], number: int, time: float, beside: bool) -> Frame:
        """The frame of all; rows of the first come first."""
        drawables: list[Drawable] = []
        begin = 0
        for k, part in enumerate(parts):
            for drawable in part.frame.drawables:
                own = drawable.vertices is not None
                once = own and (not beside or drawable.name.startswith(FLOORS))
                if not once or k == 0:
                    drawables.append(self._placed(drawable, part, begin))
            begin += len(part.frame.positions)
        return Frame(
            number=number,
            time=time,
            ids=np.concatenate([part.frame.ids for part in parts]),
            positions=np.concatenate([part.frame.positions + part.offset for part in parts]),
            velocities=np.concatenate([part.frame.velocities for part in parts]),
            drawables=tuple(drawables),
            quantities={"particles": float(begin)},
        )

    def _placed(self, drawable: Drawable, part: Part, begin: int) -> Drawable:
        name = f"{part.name}/{drawable.name}"
        key = (drawable.version, begin, len(part.frame.positions), tuple(part.offset))
        version = self._version(name, key)
        if drawable.vertices is not None:
            floor = drawable.name.startswith(FLOORS)
            shift = np.zeros(3) if floor else part.offset
            return replace(drawable, name=name, version=version, vertices=drawable.vertices + shift.astype(np.float32))
        color: Any = tuple(linear(part.color).tolist())
        thin = THIN if part.ghost else 1.0
        drawable = replace(drawable, name=name, version=version)
        match drawable:
            case Points(index=index, radius=radius):
                rows = np.arange(len(part.frame.positions)) if index is None else index
                return replace(
                    drawable,
                    index=(rows + begin).astype(np.int32),
                    color=color,
                    radius=np.multiply(radius, thin),
                    glow=False,
                    soft=False,
                    motion=None,
                    normals=None,
                )
            case Segments(pairs=pairs, width=width):
                return replace(
                    drawable,
                    pairs=pairs + begin,
                    color=color,
                    width=np.multiply(width, thin),
                )
            case Curves(index=index, width=width):
                return replace(
                    drawable,
                    index=index + begin,
                    color=color,
                    width=np.multiply(width, thin),
                )
            case Triangles(faces=faces):
                return replace(drawable, faces=faces + begin, color=color, uv=None, pattern="plain")
            case Arrows():
                return drawable

    def _version(self, name: str, key: Hashable) -> int:
        known = self._versions.get(name)
        if known is None or known[0] != key:
            known = key, known[1] + 1 if known else 0
            self._versions[name] = known
        return known[1]
