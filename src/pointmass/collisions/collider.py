"""What every collider is: a signed distance, its normal, a motion, a material."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.laws import Laws, laws_of
from pointmass.collisions.motion import Motion
from pointmass.description import Described
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple

Array = NDArray[np.floating[Any]]
Contact = Literal["swept", "discrete"]
Response = Literal["bounce", "stick", "slide", "kill"]


class Collider(Described, ABC):
    """A surface that particles bounce off: V' = V_T - k_r V_N (lecture, "Collision Response").

    Coulomb friction acts on V_T. The free side is where the signed distance is positive. Its shape is two laws of
    numbers, `distance_law` and `normal_law`, that are traced; both paths are printed from them, and distances are
    computed in float64 in both.

    Attributes
    ----------
    restitution : k_r in [0, 1].
    friction : Coulomb's mu, at least 0.
    eps : how near is in contact [m].
    response : what becomes of a particle that hits it. "bounce": as above. "stick": it stays where it hit, and so does
        whoever comes within eps; it moves with the surface, whatever pulls at it. "slide": it loses its velocity into
        the surface and nothing else, as with k_r = mu = 0. "kill": it stays where it hit until the step ends, and is
        then taken away. `restitution` and `friction` count for "bounce" alone.
    contact : "swept": nothing tunnels, the time of impact is found; "discrete": the lecture's test at the end of each
        step.
    motion : of the reference point, in time.
    place : name of that point among the arguments.
    bulges : True where the solid is convex (ball, block): a line between two free points may pass through it. False
        where the free space is convex (plane, inside of a sphere).
    curved : False where the surface is flat everywhere, and only there.
    lookup : in what kind of data the distance is looked up: see `LookedUp`. "" where laws give it.
    steepness : the distance changes by at most so many times the way, 1 or more.
    smooth : True where pictures shade its mesh round.
    """

    bulges: ClassVar[bool] = True
    curved: ClassVar[bool] = True
    lookup: ClassVar[str] = ""
    steepness: float = 1.0
    smooth: ClassVar[bool] = False
    place: ClassVar[str] = "center"

    def __init__(
        self,
        place: Vector,
        restitution: float,
        friction: float,
        eps: float,
        contact: Contact,
        response: Response = "bounce",
    ) -> None:
        self.motion = Motion(place, self.place)
        self.restitution = number("restitution", restitution, at_least=0, at_most=1)
        self.friction = number("friction", friction, at_least=0)
        self.eps = number("eps", eps, above=0, unit="m")
        if contact not in ("swept", "discrete"):
            raise InvalidInput(f"contact = {contact!r} is not allowed: it must be 'swept' or 'discrete'")
        self.contact = contact
        if response not in get_args(Response):
            raise InvalidInput(
                f"response = {response!r} is not allowed: it must be 'bounce', 'stick', 'slide' or 'kill'"
            )
        self.response = response

    @property
    def material(self) -> dict[str, Any]:
        """Restitution, friction, eps, contact and response, by name."""
        return {name: getattr(self, name) for name in ("restitution", "friction", "eps", "contact", "response")}

    @property
    def impact(self) -> tuple[float, float]:
        """k_r and mu as the response wants them."""
        if self.response == "bounce":
            return self.restitution, self.friction
        return 0.0, np.inf if self.response == "stick" else 0.0

    @property
    def name(self) -> str:
        """Name for messages and pictures."""
        return type(self).__name__

    @property
    def moves(self) -> bool:
        """Whether the place depends on t."""
        return self.motion.fixed is None

    @staticmethod
    @abstractmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        """Signed distance [m] of a point relative to the place; `shape` are the numbers of `shape`."""

    @staticmethod
    @abstractmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        """Gradient of the distance, a unit vector."""

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """Whether all that lies between points, relative to the place, is farther away than `room` [m].

        A quick test: it may fail to hold where it could, and never holds where it must not. False: there is none.
        """
        return False

    @property
    @abstractmethod
    def shape(self) -> tuple[float, ...]:
        """Numbers that the laws of the shape take."""

    @property
    def laws(self) -> Laws:
        """The laws of the shape as programs."""
        return _traced(type(self), len(self.shape))

    def local_distance(self, x: Array) -> Array:
        """Signed distance [m] of points given relative to the place, shape (k,)."""
        (result,) = self.laws.distance.columns(*_components(x), *self.shape)
        return np.broadcast_to(result, len(x))

    def local_normal(self, x: Array) -> Array:
        """Gradient of the distance, unit vectors, shape (k, 3)."""
        parts = self.laws.normal.columns(*_components(x), *self.shape)
        return np.stack([np.broadcast_to(p, len(x)) for p in parts], axis=1)

    def bending(self, x: Array, v: Array) -> Array:
        """How fast the surface curves away under a velocity [m/s^2], shape (k,); 0 for flat surfaces.

        It is v . H v with H the Hessian of the distance; `x` is relative to the place.
        """
        (result,) = self.laws.bending.columns(*_components(x), *_components(v), *self.shape)
        return np.broadcast_to(result, len(x))

    @property
    def detail(self) -> float:
        """Within a triangle whose corners are not farther than this from its middle, the distance is convex [m]."""
        return np.inf

    @property
    def surfaces(self) -> Sequence[Collider]:
        """The surfaces that it consists of, each with a smooth distance: a room has six walls."""
        return (self,)

    @abstractmethod
    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        """Corners relative to the place and triangles, for pictures; what is infinite is drawn `size` [m] wide."""

    def distance(self, x: Array, t: Any) -> Array:
        """Signed distance [m] of points, shape (k, 3), at time t (a number or shape (k,))."""
        return self.local_distance(x - self.motion.place(t))

    def normal(self, x: Array, t: Any) -> Array:
        """Outward unit normals at the points, shape (k, 3)."""
        return self.local_normal(x - self.motion.place(t))

    def at(self, t: Any) -> Array:
        """The place [m], shape (3,) or (k, 3)."""
        return self.motion.place(t)

    def velocity(self, t: Any) -> Array:
        """Velocity of the surface [m/s], shape (3,) or (k, 3)."""
        return self.motion.velocity(t)

    def acceleration(self, t: Any) -> Array:
        """Acceleration of the surface [m/s^2], shape (3,) or (k, 3)."""
        return self.motion.acceleration(t)


@cache
def _traced(kind: type[Collider], count: int) -> Laws:
    return laws_of(kind.__name__, kind.distance_law, kind.normal_law, kind.apart_law, count, kind.curved)


def _components(x: Array) -> list[NDArray[np.float64]]:
    return [x[:, k].astype(np.float64) for k in range(3)]


def unit(name: str, value: Any) -> NDArray[np.float64]:
    """A direction as a unit vector."""
    array = finite_array(name, value, (3,))
    largest = float(np.abs(array).max())
    if largest == 0:
        raise InvalidInput(f"{name} = {value} is not allowed: it must not be zero")
    array = array / largest  # squares of tiny and huge numbers would leave the range of floats
    return array / np.linalg.norm(array)


def rows_dot(a: Array, b: Array) -> Array:
    """Scalar product row by row, added left to right (not np.einsum, whose order depends on the machine)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def lengths(a: Array) -> Array:
    """Length of each row."""
    return np.sqrt(rows_dot(a, a))


def directions(a: Array, size: Array, otherwise: Array) -> Array:
    """Rows divided by their lengths `size`; `otherwise` where that is 0."""
    long = (size > 0)[:, None]
    return np.where(long, a / np.where(long, size[:, None], 1), otherwise)
