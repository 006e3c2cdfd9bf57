"""All that goes over the wire, both ways.

A page sends `Inbound` messages as JSON objects with the field `kind`. The server sends `Outbound` messages likewise,
and frames as binary messages: three u32 (1, sequence, length of the head), the head as JSON of a `FrameHead`, padded
with spaces to a multiple of 4, and then the body: arrays, little-endian, each beginning at a multiple of 4 bytes. A
`Block` says where an array is in the body.
"""

from __future__ import annotations

import json
import math
import types
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

from pointmass.errors import InvalidInput

LONGEST = 16384  # bytes of an inbound message
LONGEST_TEXT = 4096  # characters of a text in it
LARGEST = 1e15  # size of a number in it
FRAME = 1  # first number of a binary message

Vector = tuple[float, float, float]
Color = tuple[float, float, float, float]  # linear RGBA
Value = bool | float | str  # of a scene's parameter


def vector(values: Any) -> Vector:
    """Three numbers of any kind."""
    x, y, z = (float(v) for v in values)
    return x, y, z


# ------------------------------------------------------------------------------------------------- from a page


@dataclass(frozen=True, kw_only=True)
class Ack:
    """The page has drawn a frame; so many more may come."""

    kind: ClassVar[str] = "ack"
    sequence: int


@dataclass(frozen=True, kw_only=True)
class Play:
    """Run, or stop for a while."""

    kind: ClassVar[str] = "play"
    on: bool


@dataclass(frozen=True, kw_only=True)
class Step:
    """One frame, and stop."""

    kind: ClassVar[str] = "step"


@dataclass(frozen=True, kw_only=True)
class Reset:
    """Begin again, with the parameters as they are."""

    kind: ClassVar[str] = "reset"


@dataclass(frozen=True, kw_only=True)
class Speed:
    """Simulated seconds for a second on the clock."""

    kind: ClassVar[str] = "speed"
    factor: float = field(metadata={"at_least": 0.001, "at_most": 100.0})


@dataclass(frozen=True, kw_only=True)
class Change:
    """A parameter of the scene."""

    kind: ClassVar[str] = "change"
    name: str
    value: Value


@dataclass(frozen=True, kw_only=True)
class Choose:
    """A preset of the scene; "" = all parameters at their defaults."""

    kind: ClassVar[str] = "choose"
    preset: str


@dataclass(frozen=True, kw_only=True)
class Grab:
    """Take the particle in a row of a frame, and draw it to a place."""

    kind: ClassVar[str] = "grab"
    sequence: int
    row: int
    target: Vector


@dataclass(frozen=True, kw_only=True)
class Drag:
    """Draw the particle that was grabbed to another place."""

    kind: ClassVar[str] = "drag"
    target: Vector


@dataclass(frozen=True, kw_only=True)
class Release:
    """Let it go."""

    kind: ClassVar[str] = "release"


@dataclass(frozen=True, kw_only=True)
class Seek:
    """Show a frame of a cache, counted from 0."""

    kind: ClassVar[str] = "seek"
    frame: int


@dataclass(frozen=True, kw_only=True)
class Loop:
    """Play these frames of a cache again and again, both ends included; off: all of them, once."""

    kind: ClassVar[str] = "loop"
    on: bool
    first: int
    last: int


@dataclass(frozen=True, kw_only=True)
class Resume:
    """Let the simulation go on from a frame of a cache."""

    kind: ClassVar[str] = "resume"
    frame: int


@dataclass(frozen=True, kw_only=True)
class SetSolver:
    """Another solver, by its name, with steps of dt [s]; "" and 0 = those of the scene."""

    kind: ClassVar[str] = "solver"
    name: str
    dt: float = field(metadata={"at_least": 0.0})


@dataclass(frozen=True, kw_only=True)
class SetSwitch:
    """Switch a force or collider on or off, by its place."""

    kind: ClassVar[str] = "switch"
    name: str
    on: bool


@dataclass(frozen=True, kw_only=True)
class SetWind:
    """Another direction of the wind."""

    kind: ClassVar[str] = "wind"
    direction: Vector


@dataclass(frozen=True, kw_only=True)
class Undo:
    """Take the last change of settings back."""

    kind: ClassVar[str] = "undo"


@dataclass(frozen=True, kw_only=True)
class Redo:
    """Make the change that was taken back."""

    kind: ClassVar[str] = "redo"


@dataclass(frozen=True, kw_only=True)
class Pick:
    """Pick the particle in a row of a frame; the last two that were picked can be joined."""

    kind: ClassVar[str] = "pick"
    sequence: int
    row: int


@dataclass(frozen=True, kw_only=True)
class PinPicked:
    """Pin the particle that was picked last, or let it go if it is pinned."""

    kind: ClassVar[str] = "pin"


@dataclass(frozen=True, kw_only=True)
class JoinPicked:
    """Put a spring between the two particles that were picked last."""

    kind: ClassVar[str] = "join"


@dataclass(frozen=True, kw_only=True)
class AddParticle:
    """Put a particle at a place [m]."""

    kind: ClassVar[str] = "add"
    place: Vector


@dataclass(frozen=True, kw_only=True)
class ShootBall:
    """Shoot a ball of a radius [m] from a place [m] with a velocity [m/s]."""

    kind: ClassVar[str] = "shoot"
    place: Vector
    velocity: Vector
    radius: float = field(metadata={"at_least": 1e-6})


@dataclass(frozen=True, kw_only=True)
class PushAt:
    """Push with a sphere of a radius [m], that comes to a place [m]."""

    kind: ClassVar[str] = "push"
    place: Vector
    radius: float = field(metadata={"at_least": 1e-6})


@dataclass(frozen=True, kw_only=True)
class Clear:
    """Take ball and sphere away."""

    kind: ClassVar[str] = "clear"


@dataclass(frozen=True, kw_only=True)
class Plot:
    """Plot an expression over the particles from now on, such as "mean(y)"; or no longer."""

    kind: ClassVar[str] = "plot"
    text: str
    on: bool


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Look at the particle in a row of a frame: its numbers, its springs."""

    kind: ClassVar[str] = "inspect"
    sequence: int
    row: int


@dataclass(frozen=True, kw_only=True)
class Dismiss:
    """Look at no particle."""

    kind: ClassVar[str] = "dismiss"


@dataclass(frozen=True, kw_only=True)
class Lens:
    """Colour by a quantity, one of `Instruments.lenses`; "" = as the scene says."""

    kind: ClassVar[str] = "lens"
    name: str


@dataclass(frozen=True, kw_only=True)
class Vectors:
    """Show arrows or streamlines, one of `Instruments.vectors`, or no longer."""

    kind: ClassVar[str] = "vectors"
    name: str
    on: bool


@dataclass(frozen=True, kw_only=True)
class StartCurve:
    """Begin an integral curve of the field at a place [m], by each solver that is chosen."""

    kind: ClassVar[str] = "curve"
    place: Vector


@dataclass(frozen=True, kw_only=True)
class ChooseCurveSolver:
    """Draw integral curves by a solver, one of `Instruments.curves`, or no longer."""

    kind: ClassVar[str] = "curve_solver"
    name: str
    on: bool


@dataclass(frozen=True, kw_only=True)
class SetCurveStep:
    """Integral curves in steps of dt, for a time span [s]."""

    kind: ClassVar[str] = "curve_step"
    dt: float = field(metadata={"at_least": 1e-9})
    span: float = field(metadata={"at_least": 1e-9})


@dataclass(frozen=True, kw_only=True)
class ClearCurves:
    """Take the integral curves away."""

    kind: ClassVar[str] = "clear_curves"


@dataclass(frozen=True, kw_only=True)
class Arrange:
    """Those who are in a duel: one beside the other, or all in one place."""

    kind: ClassVar[str] = "arrange"
    beside: bool


Playing = Ack | Play | Step | Reset | Speed
Settings = Change | Choose | SetSolver | SetSwitch | SetWind | Undo | Redo
Tools = Grab | Drag | Release | Pick | PinPicked | JoinPicked | AddParticle | ShootBall | PushAt | Clear
Scrubbing = Seek | Loop | Resume
Curving = StartCurve | ChooseCurveSolver | SetCurveStep | ClearCurves
Showing = Plot | Inspect | Dismiss | Lens | Vectors | Arrange | Curving
Inbound = Playing | Settings | Tools | Scrubbing | Showing

# ------------------------------------------------------------------------------------------------- from the server


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of the scene, as the scene declares it, and its value now.

    Attributes
    ----------
    minimum, maximum : None = none is declared.
    whole : whether it is a whole number.
    choices : if not empty, the value is one of them.
    """

    name: str
    summary: str
    unit: str
    value: Value
    minimum: float | None
    maximum: float | None
    whole: bool
    choices: list[str]


@dataclass(frozen=True, kw_only=True)
class Switch:
    """A force or collider: its place, such as "forces.1", what people call it, and whether it acts."""

    name: str
    label: str
    on: bool


@dataclass(frozen=True, kw_only=True)
class View:
    """Where the camera stands until the user moves it [m], its vertical angle of view [degrees], and the tangent of
    half the angle to the sides in which there is something to be seen: a narrow page shows that."""

    kind: ClassVar[str] = "view"
    position: Vector
    target: Vector
    up: Vector
    fov: float
    wide: float


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """What is looked at; the first message, and again when parameters were changed by somebody.

    Attributes
    ----------
    fps : frames per simulated second at speed 1.
    grabs : whether particles can be grabbed.
    frames : how many there are, for a cache; None: there is no end.
    solver : name of the solver and its step [s], 0 if not known.
    solvers : that can be chosen.
    switches : forces and colliders.
    wind : its mean [m/s], if there is one that can be turned.
    """

    kind: ClassVar[str] = "welcome"
    name: str
    summary: str
    parameters: list[Parameter]
    presets: list[str]
    fps: float
    grabs: bool
    frames: int | None
    solver: str
    dt: float
    solvers: list[str]
    switches: list[Switch]
    wind: Vector | None


@dataclass(frozen=True, kw_only=True)
class Status:
    """How it runs, and whether changes of settings can be undone and redone."""

    kind: ClassVar[str] = "status"
    playing: bool
    speed: float
    undo: bool = False
    redo: bool = False


@dataclass(frozen=True, kw_only=True)
class Advice:
    """The largest step with which the solver amplifies no motion now [s]; None = any, 0 = not known."""

    kind: ClassVar[str] = "advice"
    solver: str
    largest: float | None


@dataclass(frozen=True, kw_only=True)
class Note:
    """A sentence for the user; "" takes the last one away."""

    kind: ClassVar[str] = "note"
    level: Literal["info", "error"]
    text: str


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """The frames that there are; only caches and films have one.

    Attributes
    ----------
    frames : how many, so far.
    loop, first, last : whether some of them are played again and again, and which.
    resumable : whether a simulation can go on from them.
    live : whether one does: what is seen is no longer from the cache.
    computing : the frame up to which it is being computed again, and how far it is; -1: it is not.
    """

    kind: ClassVar[str] = "timeline"
    frames: int
    loop: bool
    first: int
    last: int
    resumable: bool
    live: bool
    computing: int
    computed: int


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Something that can be shown, by its name; for people: what it is, and its unit."""

    name: str
    title: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class CurveSolver:
    """A solver of integral curves: colour (sRGB) and dashes, drawn and left out, and whether it is chosen."""

    name: str
    color: str
    dash: tuple[float, float]
    on: bool


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Integral curves of the field.

    Attributes
    ----------
    solvers : that there are.
    dt, span : their steps, and how long they are [s].
    count : how many were started.
    low, high : corners of the box in which the field is drawn [m].
    """

    solvers: list[CurveSolver]
    dt: float
    span: float
    count: int
    low: Vector
    high: Vector


@dataclass(frozen=True, kw_only=True)
class Instruments:
    """What is measured and shown beside the scene itself; the same on all pages.

    Attributes
    ----------
    lenses : by what particles or springs can be coloured, and `lens`, by what they are, "" = as the scene says.
    vectors : which arrows and lines there can be, and which are `shown`.
    expressions : that are plotted.
    names : what expressions may refer to.
    curves : integral curves, None where there is no field.
    duel : whether several solvers run beside each other, and whether they are `beside` each other in the picture.
    """

    kind: ClassVar[str] = "instruments"
    lenses: list[Choice]
    lens: str
    vectors: list[Choice]
    shown: list[str]
    expressions: list[str]
    names: list[str]
    curves: Curves | None
    duel: bool
    beside: bool


Outbound = Welcome | View | Status | Note | Advice | Timeline | Instruments


@dataclass(frozen=True, kw_only=True)
class FilmHead:
    """What a file that plays without a server holds beside its frames."""

    welcome: Welcome
    view: View
    timeline: Timeline


# ------------------------------------------------------------------------------------------------- within a frame


@dataclass(frozen=True, kw_only=True)
class Block:
    """An array in the body: where it begins [bytes], how many numbers it has, and of which type."""

    offset: int
    count: int
    type: Literal["i8", "u8", "u16", "u32", "f32"]


@dataclass(frozen=True, kw_only=True)
class Places:
    """Positions as four u16 for each: x, y, z from 0 to 65535 over a box [m], and 0."""

    low: Vector
    size: Vector
    data: Block


@dataclass(frozen=True, kw_only=True)
class Colors:
    """RGBA as four u8 for each item: the square root of linear light over `scale`, and alpha."""

    scale: float
    data: Block


@dataclass(frozen=True, kw_only=True)
class PointsPart:
    """Particles; see `frame.Points`. Item k is at row `rows[k]` of the places, or at row k."""

    kind: ClassVar[str] = "points"
    places: Places | None
    count: int
    rows: Block | None
    radius: float | Block
    color: Color | Colors
    glow: bool
    soft: bool
    flat: bool
    daylight: float


@dataclass(frozen=True, kw_only=True)
class SegmentsPart:
    """Straight lines between rows of the places, two u32 for each; see `frame.Segments`."""

    kind: ClassVar[str] = "segments"
    places: Places | None
    pairs: Block
    width: float | Block
    color: Color | Colors
    glow: bool


@dataclass(frozen=True, kw_only=True)
class CurvesPart:
    """Polylines, one after another: u32 rows of the places, with 2^31 added where a polyline ends."""

    kind: ClassVar[str] = "curves"
    places: Places | None
    rows: Block
    width: float | Block
    color: Color | Colors
    glow: bool


@dataclass(frozen=True, kw_only=True)
class TrianglesPart:
    """A mesh; see `frame.Triangles`.

    Attributes
    ----------
    faces : rows of the places, three u32 for each.
    uv : six f32 for each face.
    normals : four i8 for each place, where the mesh has places of its own.
    pattern : 0 plain, 1 checker, 2 stripes, 3 bands.
    """

    kind: ClassVar[str] = "triangles"
    places: Places | None
    faces: Block
    color: Color | Colors
    smooth: bool
    normals: Block | None
    uv: Block | None
    pattern: int
    pattern_count: int
    pattern_color: Vector


@dataclass(frozen=True, kw_only=True)
class ArrowsPart:
    """Arrows from places along vectors [m], three f32 for each; see `frame.Arrows`."""

    kind: ClassVar[str] = "arrows"
    places: Places
    vectors: Block
    width: float | Block
    color: Color | Colors
    glow: bool


Part = PointsPart | SegmentsPart | CurvesPart | TrianglesPart | ArrowsPart


@dataclass(frozen=True, kw_only=True)
class Item:
    """A drawable: its part if it is new to the page, and what changes in every frame.

    Attributes
    ----------
    normals : of a mesh on the frame's places, four i8 for each place.
    """

    name: str
    version: int
    part: Part | None
    normals: Block | None


@dataclass(frozen=True, kw_only=True)
class Column:
    """A quantity that is plotted: on which plot, its name there, its unit, and whether on a logarithmic scale."""

    plot: str
    name: str
    unit: str
    log: bool = False


@dataclass(frozen=True, kw_only=True)
class TrackRows:
    """What was measured since the last frame that the page got.

    Attributes
    ----------
    generation : another one than before means that it began anew: all that the page has of this track is gone.
    data : f32, one row after another: the time [s], and then a number for each column.
    """

    name: str
    generation: int
    columns: list[Column]
    data: Block


@dataclass(frozen=True, kw_only=True)
class Legend:
    """What colours mean: sRGB from `low` to `high`, evenly.

    Attributes
    ----------
    mark : a value that matters, such as 1 where a step is no longer stable; and what it means.
    """

    title: str
    unit: str
    low: float
    high: float
    colors: list[str]
    mark: float | None
    meaning: str


@dataclass(frozen=True, kw_only=True)
class Inspected:
    """The numbers of the particle that is looked at, in SI units.

    Attributes
    ----------
    row : in the frame, -1 if it is no longer there.
    force : all that act on it, None in a flow and for a cache; likewise `mass` and `age`.
    springs : how many end at it.
    """

    row: int
    id: str
    position: Vector
    velocity: Vector
    force: Vector | None
    mass: float | None
    age: float | None
    pinned: bool
    springs: int


@dataclass(frozen=True, kw_only=True)
class Contender:
    """One of those in a duel.

    Attributes
    ----------
    color : sRGB of its particles, springs and lines.
    error : root mean square distance of its particles from those of the reference [m]; None for the reference itself.
    energy : [J], None in a flow.
    cost : what a frame takes on the clock, on average [s].
    ended : why it does not go on; "" while it does.
    """

    name: str
    color: str
    error: float | None
    energy: float | None
    cost: float
    ended: str


@dataclass(frozen=True, kw_only=True)
class CurveEnd:
    """How far a solver's newest integral curve ends from the field's own [m]; None if either ends early."""

    name: str
    error: float | None


@dataclass(frozen=True, kw_only=True)
class FrameHead:
    """A frame.

    Attributes
    ----------
    count : particles.
    cost : what it took to simulate, on the clock [s].
    held : row of the particle that is grabbed, or -1; `target` is where it is drawn to.
    picked : rows of the particles that were picked last, the newest first, at most two.
    pinned : whether the newest is pinned.
    tracks, legend, inspected, duel, curves : what instruments say.
    """

    number: int
    time: float
    count: int
    cost: float
    held: int
    target: Vector
    picked: list[int]
    pinned: bool
    quantities: dict[str, float]
    places: Places
    items: list[Item]
    tracks: list[TrackRows]
    legend: Legend | None
    inspected: Inspected | None
    duel: list[Contender]
    curves: list[CurveEnd]


# ------------------------------------------------------------------------------------------------- to and from JSON


def kind_of(message: Any) -> str | None:
    """The `kind` of a message or part, if it has one."""
    return getattr(type(message), "kind", None)


def plain(value: Any) -> Any:
    """A message as JSON has it; numbers that are not finite become null."""
    if is_dataclass(value) and not isinstance(value, type):
        own = {f.name: plain(getattr(value, f.name)) for f in fields(value)}
        kind = kind_of(value)
        return own if kind is None else {"kind": kind, **own}
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def encode(message: Any) -> str:
    """A message as JSON."""
    return json.dumps(plain(message), separators=(",", ":"), allow_nan=False)


def decode(text: str | bytes) -> Inbound:
    """A message from a page; nothing in it is trusted.

    Raises
    ------
    InvalidInput
        It is too long, no JSON, of no known kind, or a field is missing, unknown, of another type or not allowed.
    """
    if len(text) > LONGEST:
        raise InvalidInput(f"a message of {len(text)} bytes is not allowed: at most {LONGEST} are")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidInput("a message must be JSON") from None
    kind = document.pop("kind", None) if isinstance(document, dict) else None
    if not isinstance(kind, str) or kind not in INBOUND:
        raise InvalidInput(f"a message must be an object with a kind: {', '.join(INBOUND)}")
    message = INBOUND[kind]
    known = {f.name: f for f in fields(message)}
    missing = [name for name, f in known.items() if name not in document and f.default is MISSING]
    strange = [name for name in document if name not in known]
    if missing or strange:
        raise InvalidInput(f"message {kind} has the fields {', '.join(known) or 'none'}, no others and no fewer")
    hints = _hints(message)
    values = {n: _checked(f"{kind}.{n}", hints[n], v, known[n].metadata) for n, v in document.items()}
    result: Inbound = message(**values)
    return result


INBOUND: dict[str, Any] = {message.kind: message for message in get_args(Inbound)}


@cache
def _hints(message: type) -> dict[str, Any]:
    return get_type_hints(message)


def _checked(name: str, hint: Any, value: Any, bounds: Any) -> Any:
    """A value of a field, if it is of its type and allowed."""
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        for option in get_args(hint):
            try:
                return _checked(name, option, value, bounds)
            except InvalidInput:
                pass
    elif origin is tuple:
        parts = get_args(hint)
        if isinstance(value, list) and len(value) == len(parts):
            return tuple(_checked(name, part, v, bounds) for part, v in zip(parts, value, strict=True))
    elif hint is bool:
        if isinstance(value, bool):
            return value
    elif hint is str:
        if isinstance(value, str) and len(value) <= LONGEST_TEXT:
            return value
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        low, high = bounds.get("at_least", 0 if hint is int else -LARGEST), bounds.get("at_most", LARGEST)
        if low <= value <= high and (hint is float or value == int(value)):  # NaN is in no bounds
            return hint(value)
    raise InvalidInput(f"{name} of a message is not allowed: it must be {getattr(hint, '__name__', hint)} in bounds")
