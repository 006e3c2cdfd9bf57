"""The artificial fish of Tu and Terzopoulos."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import Body, body
from pointmass.errors import InvalidInput, finite_array, number, whole_number
from pointmass.forces.air import Velocity
from pointmass.forces.fins import Fins
from pointmass.forces.muscles import Muscles
from pointmass.forces.springs import Springs
from pointmass.forces.water import Water
from pointmass.particles import Particles
from pointmass.skin import Skin, subdivided

NODES = 23
NOSE, UPPER, LOWER = 0, 21, 22  # and the two ends of the tail fin; rings of four in between
RINGS = np.arange(1, 21).reshape(5, 4)  # from head to tail: upper left, upper right, lower right, lower left
# Place along the body from the nose, half of the width and of the height of each ring, in lengths of the body.
ALONG = (0.1, 0.27, 0.48, 0.67, 0.82)
WIDE = (0.045, 0.075, 0.065, 0.035, 0.012)
HIGH = (0.06, 0.115, 0.115, 0.065, 0.03)
EYE = (0.4, 0.02)  # ahead of the middle, and above it
TAIL = 0.125  # half of the height of the tail fin
MASSES = np.repeat((1.1, 6.6, 11.0, 6.6, 1.1, 0.165), (1, 4, 4, 4, 8, 2))  # in units of the model
CROSS, MUSCLE, OTHER, VISCOSITY = 38.0, 28.0, 30.0, 0.1  # likewise
MOST_DETAIL = 3
GRAVITY = 9.81  # [m/s^2]


def _pairs(a: Any, b: Any) -> NDArray[np.int64]:
    return np.stack([np.ravel(a), np.ravel(b)], axis=1)


def _graph() -> dict[str, NDArray[np.int64]]:
    """Ends of the springs of one fish by family: 46 "cross", 12 "muscles" and 33 "other".

    Springs of one kind follow each other from ring to ring, at even distances: few loops for the engine.
    """
    around = np.roll(RINGS, -1, axis=1)
    front, back = RINGS[:-1].T, RINGS[1:].T
    upper, lower = RINGS[-1, :2], RINGS[-1, 2:]
    cross = [
        _pairs(front, np.roll(back, -1, axis=0)),
        _pairs(np.roll(front, -1, axis=0), back),
        _pairs(RINGS[:, :2].T, RINGS[:, 2:].T),
        _pairs((UPPER, UPPER, LOWER, LOWER), (*lower, *upper)),
    ]
    other = [
        _pairs(RINGS.T, around.T),
        _pairs((NOSE,) * 4, RINGS[0]),
        _pairs(RINGS[3], RINGS[4]),
        _pairs((UPPER, UPPER, LOWER, LOWER, UPPER), (*upper, *lower, LOWER)),
    ]
    return {"cross": np.concatenate(cross), "muscles": _pairs(RINGS[:3], RINGS[1:4]), "other": np.concatenate(other)}


def _faces() -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Triangles of the skin of one fish, counter-clockwise seen from outside, shape (42, 3); those that feel the water,
    and which part of a triangle each of them is.

    Faces with four corners feel the water by both of their diagonals, half by each: left and right, back and belly are
    mirror images then, and a fish that swims straight drifts nowhere.
    """
    ends = [(NOSE, RINGS[0, k], RINGS[0, (k + 1) % 4]) for k in range(4)]
    ul, ur, lr, ll = RINGS[-1]
    ends += [(ur, ul, UPPER), (ll, lr, LOWER)]
    quads = [
        (front[k], front[(k + 1) % 4], back[(k + 1) % 4], back[k]) for k in range(4) for front, back in pairwise(RINGS)
    ]
    quads += [(ur, lr, LOWER, UPPER), (ll, ul, UPPER, LOWER)]
    one = [*((a, c, b) for a, b, c, _ in quads), *((a, d, c) for a, _, c, d in quads)]
    two = [*((a, d, b) for a, b, _, d in quads), *((b, d, c) for _, b, c, d in quads)]
    share = np.repeat((1.0, 0.5), (len(ends), len(one) + len(two)))
    return np.array(ends + one, np.int64), np.array(ends + one + two, np.int64), share


def _shape() -> NDArray[np.float64]:
    """Places of the nodes of a fish of length 1 that looks along x, its middle at the origin, shape (23, 3)."""
    x = np.zeros((NODES, 3))
    for ring, along, wide, high in zip(RINGS, ALONG, WIDE, HIGH, strict=True):
        x[ring] = [(-along, y, z) for y, z in ((high, -wide), (high, wide), (-high, wide), (-high, -wide))]
    x[[UPPER, LOWER]] = (-1.0, TAIL, 0.0), (-1.0, -TAIL, 0.0)
    return np.asarray(x + np.array([0.5, 0.0, 0.0]))


GRAPH, SHAPE = _graph(), _shape()
FACES, WET, SHARE = _faces()


def _skin(detail: int, nodes: NDArray[np.int64], length: float) -> Skin:
    """The triangles, divided and smoothed `detail` times, with fins on the back, at the sides and at the tail."""
    unit = np.eye(NODES)
    weights, faces = unit, FACES
    for _ in range(detail):
        weights, faces = subdivided(weights, faces)
    smooth = weights @ SHAPE
    eyes = weights[[int(np.linalg.norm(smooth - (*EYE, side * 0.04), axis=1).argmin()) for side in (-1, 1)]]
    ul, ur, lr, ll = (unit[RINGS[:, k]] for k in range(4))
    top, bottom = 0.5 * (ul + ur), 0.5 * (ll + lr)
    rise, last = top - bottom, 0.5 * (top[4] + bottom[4])
    back = [top[1] - 0.05 * rise[1], top[1] + 0.2 * (top[2] - top[1]) + 0.3 * rise[1], top[2] + 0.22 * rise[2],
            top[3] + 0.1 * rise[3], top[3] - 0.2 * rise[3], top[2] - 0.1 * rise[2]]  # fmt: skip
    span = unit[UPPER] - unit[LOWER]
    tail = [last, unit[UPPER] + 0.2 * span, 0.3 * last + 0.35 * (unit[UPPER] + unit[LOWER]), unit[LOWER] - 0.2 * span]
    under = [bottom[2] + 0.1 * rise[2], bottom[2] + 0.6 * (bottom[3] - bottom[2]) - 0.3 * rise[2], bottom[3]]
    corners = [*back, *tail, *under]
    flat = [(0, 1, 5), (1, 2, 5), (2, 3, 5), (3, 4, 5), (6, 7, 8), (6, 8, 9), (10, 11, 12)]
    for low, high, other in ((ll, ul, lr), (lr, ur, ll)):
        root = 0.7 * low[1] + 0.3 * high[1]
        aft, out = low[2] - low[1], low[1] - other[1]
        k = len(corners)
        corners += [root, root + 0.75 * aft + 0.5 * out - 0.05 * rise[1], root + 0.3 * aft - 0.12 * rise[1]]
        flat.append((k, k + 1, k + 2))
    faces = np.concatenate([faces, np.array(flat, np.int64) + len(weights)])
    weights = np.concatenate([weights, corners])
    return Skin(nodes, weights, faces, _pattern(weights @ SHAPE)[faces], eyes, 0.014 * length)


def _pattern(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where places on a fish of length 1 are on the pattern: along it from the nose, and up, shape (k, 2)."""
    return np.stack([0.5 - x[:, 0], 0.5 + x[:, 1] / 0.3], axis=1).clip(0.0, 1.0)


def _frames(directions: Any, count: int) -> NDArray[np.float64]:
    """Axes ahead, up and to the right of each fish, shape (count, 3, 3)."""
    ahead = np.broadcast_to(finite_array("headings", np.atleast_2d(directions), (None, 3)), (count, 3))
    size = np.linalg.norm(ahead, axis=1, keepdims=True)
    right = np.cross(ahead, (0.0, 1.0, 0.0))
    wide = np.linalg.norm(right, axis=1, keepdims=True)
    if (wide <= 1e-6 * size).any():
        raise InvalidInput("headings must be directions that are not straight up or down, and not 0")
    ahead, right = ahead / size, right / wide
    return np.stack([ahead, np.cross(right, ahead), right], axis=1)


@body
def fish(
    count: int = 1,
    places: Any = (0.0, 0.0, 0.0),
    headings: Any = (1.0, 0.0, 0.0),
    *,
    length: float = 0.3,
    time: float = 0.02,
    cross: float = CROSS,
    muscle: float = MUSCLE,
    other: float = OTHER,
    viscosity: float = VISCOSITY,
    density: float = 1000.0,
    drag: float = 400.0,
    fins: float = 0.02,
    upright: float = 0.02,
    current: Velocity = (0.0, 0.0, 0.0),
    detail: int = 1,
) -> Body:
    """Artificial fish of 23 particles and 91 springs each, of which 12 are muscles, in water that they push away.

    Five rings of four particles lie between the nose and the two ends of the tail fin. Lengthwise springs of the first
    three of four segments are muscles (the front ones turn, the others swim), set by a controller such as `FishBrain`.
    A fish is as heavy as the water that it displaces, so neither gravity nor buoyancy acts.

    Parameters
    ----------
    count : how many.
    places : of the middle of each [m], shape (count, 3), or one point.
    headings : directions in which they look, likewise; not straight up or down. Heads are upright.
    length : of a fish [m].
    time : unit of time of the model [s]: the shorter, the stiffer are the springs.
    cross, muscle, other : stiffness of the three kinds of springs, in units of the model: 1/107 of the mass of the fish
        over `time` squared.
    viscosity : damping of all springs, likewise: 1/107 of the mass over `time`.
    density : of fish and water [kg/m^3].
    drag : of the skin in the water, force for each area and speed [N s/m^3].
    fins : area of the pectoral fins, in squares of the length.
    upright : force up on the upper and down on the lower corners of the section with the fins, in weights of the fish.
    current : velocity of the water [m/s]: three numbers or formulas, a velocity field such as `Gust(...)`, or a list of
        both.
    detail : how often the triangles of the skin are divided, 0 to 3.

    Raises
    ------
    InvalidInput
        A number that is not allowed, no fish, places that are not one for each, a heading straight up or down.

    Notes
    -----
    Tu & Terzopoulos, Artificial Fishes: Physics, Locomotion, Perception, Behavior (SIGGRAPH 1994). Stiffness 38, 28 and
    30 and viscosity 0.1 are from there; masses and the counts of springs by kind are those of a public version
    (UnityFishSimulation); the shape, and with it the layout of the springs, is our own. Groups are "nose", "head" (the
    nose and the first ring), "tail", "left", "right", "upper" and "lower".
    """
    count = whole_number("count", count, at_least=1)
    length = number("length", length, above=0, unit="m")
    tick = number("time", time, above=0, unit="s")
    middle = finite_array("places", np.atleast_2d(places), (None, 3))
    if len(middle) not in (1, count):
        raise InvalidInput(f"places has {len(middle)} points for {count} fish: give one for each")
    looking = np.atleast_2d(headings)
    if len(looking) not in (1, count):
        raise InvalidInput(f"headings has {len(looking)} directions for {count} fish: give one for each")
    x = middle[:, None] + length * SHAPE @ _frames(looking, count)
    x = x.reshape(-1, 3)
    first = NODES * np.arange(count)[:, None, None]
    corners = SHAPE[FACES]
    volume = float((corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() / 6) * length**3
    mass = number("density", density, above=0, unit="kg/m^3") * volume
    unit = mass / MASSES.sum()
    particles = Particles(x, m=np.tile(unit * MASSES, count))
    sides: dict[str, Any] = {
        "left": RINGS[:, [0, 3]],
        "right": RINGS[:, 1:3],
        "upper": RINGS[:, :2],
        "lower": RINGS[:, 2:],
    }
    sides |= {"nose": [NOSE], "head": np.append(NOSE, RINGS[0]), "tail": [UPPER, LOWER]}
    for name, nodes in sides.items():
        particles.tag(name, (first[:, 0] + np.ravel(nodes)).ravel())
    uv = _pattern(SHAPE)[FACES]
    triangles = (FACES + first).reshape(-1, 3)
    if whole_number("detail", detail, at_least=0) > MOST_DETAIL:
        raise InvalidInput(f"detail = {detail} is not allowed: it must be at most {MOST_DETAIL}")
    skin = _skin(detail, first[:, 0] + np.arange(NODES), length)
    particles.cover("fish", triangles, np.tile(uv, (count, 1, 1)), skin=skin)
    damping = number("viscosity", viscosity, at_least=0) * unit / tick
    stiffness = {"cross": cross, "muscles": muscle, "other": other}
    ends = {family: (pairs + first).reshape(-1, 2) for family, pairs in GRAPH.items()}
    k = {name: number(name, value, above=0) * unit / tick**2 for name, value in stiffness.items()}
    zero = np.zeros(len(ends["muscles"]))
    rest = np.linalg.norm(x[ends["muscles"][:, 0]] - x[ends["muscles"][:, 1]], axis=1)
    thick = number("drag", drag, at_least=0, unit="N s/m^3")
    area = number("fins", fins, at_least=0) * length**2
    couple = number("upright", upright, at_least=0) * mass * GRAVITY
    sections = (RINGS[1] + first[:, 0]).reshape(-1, 4)
    forces: list[Any] = [
        Springs(ends["cross"], k["cross"], damping, family="cross"),
        Muscles(ends["muscles"], k["muscles"], damping, rest, zero, zero, zero, zero),
        Springs(ends["other"], k["other"], damping, family="other"),
        Water((WET + first).reshape(-1, 3), np.tile(thick * SHARE, count), current),
        Fins(sections, np.full(count, math.pi / 2), area, thick, couple, current),
    ]
    return Body(particles, forces)
