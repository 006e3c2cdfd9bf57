"""Snakes and worms: chains of cubes whose edges are muscles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import Body, body
from pointmass.bodies.gaits import PERISTALTIC, Gait, gait_of
from pointmass.errors import InvalidInput, finite_array, number, whole_number
from pointmass.forces.muscles import Muscles
from pointmass.forces.scales import Scales
from pointmass.forces.springs import Springs
from pointmass.particles import Particles
from pointmass.skin import Skin, splines, tube

SINK = 0.02  # of the width: how deep a body lies in the ground
WEIGHT = 9.81  # [m/s^2], for which the ground is made so firm
REBOUND = 3.0  # damping of the ground [s/m]
SIDE = np.array([1.0, -1.0, -1.0, 1.0])  # of the four corners of a ring, from the upper left one on
HEIGHT = np.array([1.0, 1.0, -1.0, -1.0])
GIRTH = 1 / 6  # of the pattern on the skin, relative to its length: a whole and even number of fields
EYE = 0.1  # radius of an eye, in widths
EYES_AT = (-0.3, 0.74, 0.54)  # in rings, and how far out and up of the skin's radius
Ids = NDArray[np.int64]
Profile = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Form:
    """How a kind of body looks.

    Attributes
    ----------
    front, back : (place, radius) of its skin, see `tube`, but in rings from the first one, and from the last one.
    eyes : whether it has any.
    """

    front: Profile
    back: Profile
    eyes: bool


SNAKE = Form(
    front=((-0.7, 0.0), (-0.65, 0.35), (-0.5, 0.75), (-0.2, 0.98), (0.3, 1.0), (1.2, 0.72), (3.0, 0.95)),
    back=((-6.0, 0.85), (0.0, 0.35), (1.2, 0.0)),
    eyes=True,
)
WORM = Form(
    front=((-0.6, 0.0), (-0.5, 0.5), (-0.2, 0.85), (0.5, 1.0)),
    back=((-0.5, 1.0), (0.2, 0.85), (0.5, 0.5), (0.6, 0.0)),
    eyes=False,
)


@body
def snake(
    segments: int = 24,
    length: float = 1.2,
    width: float = 0.05,
    *,
    gait: str = "serpentine",
    amplitude: float | None = None,
    waves: float | None = None,
    frequency: float | None = None,
    center: Any = (0.0, 0.025, 0.0),
    heading: float = 0.0,
    mass: float = 0.6,
    stiffness: float = 1500.0,
    damping: float = 0.3,
    forward: float = 0.1,
    backward: float = 0.5,
    sideways: float = 0.5,
) -> Body:
    """A snake on level ground: a chain of cubes with a spring at every edge and both diagonals of every face, whose
    lengthwise edges are muscles (Miller, The Motion Dynamics of Snakes and Worms, SIGGRAPH 1988).

    It has 4 (segments + 1) equal masses and 18 segments + 6 springs, and it lies on scales (`Scales`). Groups are
    "head" and "tail", its first and last ring, "left" and "right"; `Steer` turns it.

    Parameters
    ----------
    segments : cubes, at least 3.
    length, width : [m].
    gait : "serpentine", "rectilinear", "sidewinding" or "concertina".
    amplitude : of the muscles, as a part of their lengths, at least 0 and below 0.6; None = that of the gait.
    waves : on the body, at most half a wave for each segment; None likewise.
    frequency : [1/s], at least 0; None likewise.
    center : of the body [m]; the ground is half a width below it.
    heading : direction of the head about the y axis [degrees]: 0 is along x, 90 along -z.
    mass : of the whole body [kg].
    stiffness : of each spring [N/m].
    damping : ratio of each spring with its two masses, at least 0.
    forward, backward, sideways : coefficients of friction, at least 0.

    Raises
    ------
    InvalidInput
        An unknown gait, a number that is not allowed, a gait that the body cannot have.

    Notes
    -----
    Friction that is alike in all directions gives no or little way, and without friction the centre of mass stays.
    """
    return _crawler(
        "snake", SNAKE, gait_of(gait), segments, length, width, amplitude, waves, frequency, center, heading, mass,
        stiffness, damping, forward, backward, sideways,
    )  # fmt: skip


@body
def worm(
    segments: int = 16,
    length: float = 0.6,
    width: float = 0.05,
    *,
    amplitude: float | None = None,
    waves: float | None = None,
    frequency: float | None = None,
    center: Any = (0.0, 0.025, 0.0),
    heading: float = 0.0,
    mass: float = 0.4,
    stiffness: float = 1500.0,
    damping: float = 0.3,
    forward: float = 0.1,
    backward: float = 0.5,
    sideways: float = 0.5,
) -> Body:
    """A worm: the chain of cubes of `snake`, with muscles along and around it, of which one kind is short where the
    other is long. Its waves run from head to tail, and where it is thick it holds on to the ground.

    Parameters are those of `snake`.

    Raises
    ------
    InvalidInput
        A number that is not allowed, waves that the body cannot have.
    """
    return _crawler(
        "worm", WORM, PERISTALTIC, segments, length, width, amplitude, waves, frequency, center, heading, mass,
        stiffness, damping, forward, backward, sideways,
    )  # fmt: skip


def _crawler(
    kind: str, form: Form, gait: Gait, segments: int, length: float, width: float, amplitude: float | None,
    waves: float | None, frequency: float | None, center: Any, heading: float, mass: float, stiffness: float,
    damping: float, forward: float, backward: float, sideways: float,
) -> Body:  # fmt: skip
    count = whole_number("segments", segments, at_least=3)
    long, wide = number("length", length, above=0, unit="m"), number("width", width, above=0, unit="m")
    part = number("amplitude", gait.amplitude if amplitude is None else amplitude, at_least=0)
    if not part < 0.6:
        raise InvalidInput(f"amplitude = {part} is not allowed: it must be below 0.6, or muscles would have no length")
    number_of_waves = number("waves", gait.waves if waves is None else waves, at_least=0)
    if number_of_waves > count / 2:
        raise InvalidInput(
            f"waves = {number_of_waves:g} is not allowed: {count} segments have at most {count / 2:g}, two for a wave"
        )
    rate = number("frequency", gait.frequency if frequency is None else frequency, at_least=0, unit="1/s")
    middle = finite_array("center", center, (3,))
    turn = math.radians(number("heading", heading, unit="degrees"))
    m = number("mass", mass, above=0, unit="kg") / (4 * (count + 1))
    k_s = number("stiffness", stiffness, above=0, unit="N/m")
    k_d = 2 * number("damping", damping, at_least=0) * math.sqrt(k_s * m / 2)

    ahead, left = np.array([math.cos(turn), 0.0, -math.sin(turn)]), np.array([-math.sin(turn), 0.0, -math.cos(turn)])
    rings = np.arange(4 * (count + 1)).reshape(-1, 4)
    back = long * (0.5 - np.arange(count + 1) / count)
    corners = 0.5 * wide * (SIDE[:, None] * left + HEIGHT[:, None] * np.array([0.0, 1.0, 0.0]))
    x = middle + back[:, None, None] * ahead + corners
    particles = Particles(x.reshape(-1, 3), m=m)
    for name, ids in {"head": rings[0], "tail": rings[-1], "left": rings[:, [0, 3]], "right": rings[:, [1, 2]]}.items():
        particles.tag(name, ids.ravel())
    particles.cover(kind, _sides(rings), skin=_skin(form, rings, wide))

    lengthwise, around, braces = _edges(rings)
    s = np.repeat((np.arange(count) + 0.5) / count, 4)
    wave = gait.along(part, number_of_waves, s, np.tile(SIDE, count), np.tile(HEIGHT, count))
    forces: list[Any] = [Muscles(lengthwise, k_s, k_d, long / count, wave.offset, wave.amplitude, rate, wave.phase)]
    braced = Springs(braces, k_s, k_d, family="brace")
    if gait.rings:
        wave = gait.around(part, number_of_waves, np.tile(np.arange(count + 1) / count, 4))
        ring = Muscles(around, k_s, k_d, wide, wave.offset, wave.amplitude, rate, wave.phase, family="ring")
        forces += [ring, braced]
    else:
        forces += [braced, Springs(around, k_s, k_d, family="ring")]
    links = np.concatenate([np.stack([rings[:-1, c], rings[1:, c]], axis=1) for c in (2, 3)])
    ground = Scales(
        links, float(middle[1]) - 0.5 * wide, m * WEIGHT / (SINK * wide), REBOUND, forward, backward, sideways
    )  # fmt: skip
    return Body(particles, [*forces, ground])


def _edges(rings: Ids) -> tuple[Ids, Ids, Ids]:
    """Ends of the edges of the cubes along the body and around it, and of the diagonals of their faces."""
    lengthwise = np.stack([rings[:-1].ravel(), rings[1:].ravel()], axis=1)
    around = np.concatenate([rings[:, [c, (c + 1) % 4]] for c in range(4)])
    braces = [rings[:, [0, 2]], rings[:, [1, 3]]]
    for c in range(4):
        d = (c + 1) % 4
        braces += [np.stack([rings[:-1, a], rings[1:, b]], axis=1) for a, b in ((c, d), (d, c))]
    return lengthwise, around, np.concatenate(braces)


def _skin(form: Form, rings: Ids, width: float) -> Skin:
    count = len(rings) - 1
    profile = [(at / count, radius) for at, radius in form.front]
    profile += [(1.0 + at / count, radius) for at, radius in form.back]
    weights, faces, uv = tube(profile, count + 1, GIRTH)
    eyes = _eyes(count + 1) if form.eyes else np.zeros((0, rings.size))
    return Skin(rings.reshape(1, -1), weights, faces, uv, eyes, EYE * width)


def _sides(rings: Ids) -> Ids:
    """Triangles of the box around the masses, counter-clockwise seen from outside, shape (k, 3)."""
    faces = [(rings[0, 0], rings[0, 1], rings[0, 2]), (rings[0, 0], rings[0, 2], rings[0, 3])]
    faces += [(rings[-1, 0], rings[-1, 2], rings[-1, 1]), (rings[-1, 0], rings[-1, 3], rings[-1, 2])]
    for front, back in pairwise(rings):
        for c in range(4):
            d = (c + 1) % 4
            faces += [(front[c], back[d], front[d]), (front[c], back[c], back[d])]
    return np.array(faces)


def _eyes(rings: int) -> NDArray[np.float64]:
    """Weights of the middle of both eyes, before the first ring."""
    at, out, up = EYES_AT
    along = splines(np.array([at]), rings)[0]
    result = []
    for side in (1, -1):
        corner = 0.25 * (1 + HEIGHT * up * math.sqrt(2) + side * SIDE * out * math.sqrt(2))
        result.append((along[:, None] * corner).ravel())
    return np.array(result)
