"""What leaves a simulation: a `Frame`, and the camera that looks at it.

The cache, the renderer, the exporters and the viewer see frames and nothing else. A drawable is a list
of items (points, segments, curves, triangles or arrows) with attributes for each item. Its corners are rows of
`frame.positions` unless it brings `vertices` of its own, so a net of springs is stored once and moves with
the particles. Colours are linear-light RGBA; RGB may exceed 1 (light that glows).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import dist
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array, number, whole_number

Floats = NDArray[np.floating[Any]]
Ints = NDArray[np.integer[Any]]

PATTERNS = ("plain", "checker", "stripes", "bands")  # of surfaces
NEAREST, FARTHEST = 1e-12, 1e15  # from a camera to its target [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class Points:
    """Particles as balls (shaded, solid), as light (`glow`, added up), as puffs (`soft`) or as flakes (`normals`).

    Attributes
    ----------
    index : rows of the corners that are drawn, shape (k,); None = all.
    radius : [m], shape (k,) or ().
    color : linear RGBA, shape (k, 4) or (4,).
    glow : True: soft light that adds to what lies behind; False: an opaque shaded ball.
    soft : True: a translucent puff of smoke, thick in the middle, through which light comes to others.
    motion : the way that each went while the shutter was open [m], shape (k, 3): a glow's light is spread evenly over
        it, a disc is smeared along it, and a ball hides what it passes for the share of the time in which it is there;
        its shadow is that of the middle. Puffs have none. None = a moment.
    normals : the balls are thin discs across these directions, shape (k, 3).
    daylight : factor on the light of the picture's lamps on puffs and discs; what glows lights them, too.
    """

    kind: ClassVar[str] = "points"
    name: str
    version: int = 0
    vertices: Floats | None = None
    index: Ints | None = None
    radius: Floats | float = 0.02
    color: Floats | tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    glow: bool = False
    soft: bool = False
    motion: Floats | None = None
    normals: Floats | None = None
    daylight: float = 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Segments:
    """Straight lines between two corners: springs, sticks.

    Attributes
    ----------
    pairs : rows of the corners, shape (k, 2).
    width : diameter [m], shape (k,) or ().
    color : linear RGBA, shape (k, 4) or (4,).
    """

    kind: ClassVar[str] = "segments"
    name: str
    version: int = 0
    vertices: Floats | None = None
    pairs: Ints
    width: Floats | float = 0.005
    color: Floats | tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    glow: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Open polylines: trails, streamlines, hair.

    Attributes
    ----------
    index : rows of the corners, one polyline after another, shape (p,).
    offsets : where each polyline starts in `index`, and p at the end, shape (c + 1,).
    width : diameter [m] for each entry of `index`, shape (p,) or ().
    color : linear RGBA for each entry of `index`, shape (p, 4) or (4,).
    """

    kind: ClassVar[str] = "curves"
    name: str
    version: int = 0
    vertices: Floats | None = None
    index: Ints
    offsets: Ints
    width: Floats | float = 0.005
    color: Floats | tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    glow: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Triangles:
    """A mesh, lit from both sides.

    Attributes
    ----------
    faces : rows of the corners, counter-clockwise seen from outside, shape (k, 3).
    color : linear RGBA for each corner that `faces` can name, shape (v, 4) or (4,).
    smooth : True: shade with the mean normal of each corner; False: each face flat.
    uv : place of the corners of each face on the pattern, from 0 to 1 along both of its sides, shape (k, 3, 2).
    pattern : "plain", "checker", "stripes" (side by side along u), or "bands" (one above the other along v).
    pattern_count : fields along each side.
    pattern_color : linear RGB of every other field, beginning with the second one; the alpha is that of `color`.
    """

    kind: ClassVar[str] = "triangles"
    name: str
    version: int = 0
    vertices: Floats | None = None
    faces: Ints
    color: Floats | tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    smooth: bool = True
    uv: Floats | None = None
    pattern: Literal["plain", "checker", "stripes", "bands"] = "plain"
    pattern_count: int = 8
    pattern_color: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Arrows:
    """Arrows of a field, of velocities, of forces.

    Attributes
    ----------
    vertices : tails [m], shape (k, 3); always its own, never the particles'.
    vectors : from tail to tip [m], shape (k, 3).
    width : diameter of the shaft [m], shape (k,) or ().
    color : linear RGBA, shape (k, 4) or (4,).
    """

    kind: ClassVar[str] = "arrows"
    name: str
    version: int = 0
    vertices: Floats
    vectors: Floats
    width: Floats | float = 0.005
    color: Floats | tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    glow: bool = False


Drawable = Points | Segments | Curves | Triangles | Arrows
DRAWABLES: dict[str, type[Drawable]] = {c.kind: c for c in (Points, Segments, Curves, Triangles, Arrows)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """One look at a simulation.

    Attributes
    ----------
    number : 0 for the start of the run.
    time : [s].
    ids : shape (n,); an id is never used twice in a run.
    positions : [m], shape (n, 3).
    velocities : [m/s], shape (n, 3).
    drawables : what there is to see. A drawable with the same `name` and `version` as in the frame before is the same.
    quantities : diagnostics by name, such as "energy" [J], which captions show.
    """

    number: int
    time: float
    ids: Ints
    positions: Floats
    velocities: Floats
    drawables: tuple[Drawable, ...] = ()
    quantities: dict[str, float] = field(default_factory=dict)


def last_of(frames: Iterable[Frame]) -> Frame | None:
    """The last one, None if there are none: of a sequence no other is asked for, and of a stream no other is kept."""
    if isinstance(frames, Sequence):
        return frames[len(frames) - 1] if len(frames) else None
    return next(iter(deque(frames, maxlen=1)), None)


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A pin-hole camera; what is not given is chosen to show the whole scene.

    Attributes
    ----------
    position, target : [m]; None = found from the frames.
    up : direction that is up in the picture.
    fov : vertical angle of view [degrees], in (1, 170).
    azimuth, elevation : direction from which an automatic camera looks [degrees]; azimuth 0 looks along -z.
    path : where it is at some times, rows of the time [s], position and target [m]: seven numbers; in between it moves
        smoothly (Fritsch and Carlson's cubics, which do not swing over), before and after it stands.
    dolly : speed towards the target [m/s], below 0 away from it; it never comes nearer than a twentieth of the way.
    orbit : speed of its turn about `up` through the target [degrees/s].
    follow : id of a particle that it keeps in view, from the side from which it would see the target; while there is no
        such particle, it looks at the target.
    """

    position: tuple[float, float, float] | None = None
    target: tuple[float, float, float] | None = None
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fov: float = 35.0
    azimuth: float = 25.0
    elevation: float = 15.0
    path: tuple[tuple[float, ...], ...] = ()
    dolly: float = 0.0
    orbit: float = 0.0
    follow: int | None = None

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            if getattr(self, name) is not None:
                finite_array(f"camera.{name}", getattr(self, name), (3,))
        for name in ("azimuth", "elevation", "fov"):
            number(f"camera.{name}", getattr(self, name), unit="degrees")
        if not 1.0 < self.fov < 170.0:
            raise InvalidInput(f"camera.fov = {self.fov} is not allowed: it must lie between 1 and 170 degrees")
        if not any(self.up):
            raise InvalidInput(f"camera.up = {self.up} is not allowed: it must be a direction, such as (0, 1, 0)")
        if self.position is not None and self.target is not None:
            distance = dist(self.position, self.target)
            if not NEAREST <= distance <= FARTHEST:
                raise InvalidInput(
                    f"camera.position = {self.position} is not allowed: it is {distance:g} m from camera.target, and "
                    f"must be from {NEAREST:g} to {FARTHEST:g} m away"
                )
        number("camera.dolly", self.dolly, unit="m/s")
        number("camera.orbit", self.orbit, unit="degrees/s")
        if self.follow is not None:
            whole_number("camera.follow", self.follow, at_least=0)
        if len(self.path):
            rows = finite_array("camera.path", self.path, (None, 7))
            if (rows[1:, 0] <= rows[:-1, 0]).any():
                raise InvalidInput("camera.path must have times that rise, one for each row")
            if (abs(rows[:, 1:4] - rows[:, 4:]).max(axis=1) < NEAREST).any():
                raise InvalidInput("camera.path must have positions that are not at their targets")
