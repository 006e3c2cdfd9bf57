"""A sphere that pushes: shot as a ball, or led by the cursor."""

from __future__ import annotations

from typing import Any

import numpy as np

from pointmass.frame import Points
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.simulation import Simulation
from pointmass.tracing import functions as fn
from pointmass.viewer import messages
from pointmass.viewer.inputs import Input, Shoot, Vanish
from pointmass.viewer.mouse import STIFFEST

RATE = 200.0  # of the push [1/s]: who comes with the speed v goes v / RATE deep
DAMPING = 0.3  # of the push [s/m]
MOST_DAMPED = 0.4  # h times the damping of the deepest [1], where the solver is not implicit
FOLLOWS = 1 / 60  # how long it takes to where it is led: a frame [s]
ALWAYS = 1e9  # [s]
COLOR = (1.0, 0.46, 0.09, 1.0)


class MovingSphere(UnaryForce):
    """f = m rate^2 s max(1 - damping (v - u) . n, 0) n where a particle is s > 0 deep in a sphere that moves.

    Its centre is center + velocity T with T = t - since within 0 and `duration`, and u is the velocity in that time. It
    is `Cushion` on a ball, but by mass, so that all are pushed alike, and its way is numbers, so that no shot compiles.

    Parameters
    ----------
    center : where it begins [m].
    velocity : [m/s].
    since, duration : when it begins to move, and for how long [s].
    radius : [m]; 0 = there is none.
    rate : [1/s].
    damping : share of the push that is lost for each m/s outwards, and added for each m/s inwards [s/m].
    """

    def __init__(
        self,
        center: Vector = (0.0, 0.0, 0.0),
        velocity: Vector = (0.0, 0.0, 0.0),
        since: Scalar = 0.0,
        duration: Scalar = 0.0,
        radius: Scalar = 0.0,
        rate: Scalar = 0.0,
        damping: Scalar = 0.0,
    ) -> None:
        super().__init__(
            [
                Parameter("center", center, vector=True, unit="m"),
                Parameter("velocity", velocity, vector=True, unit="m/s"),
                Parameter("since", since, unit="s"),
                Parameter("duration", duration, unit="s", at_least=0),
                Parameter("radius", radius, unit="m", at_least=0),
                Parameter("rate", rate, unit="1/s", at_least=0),
                Parameter("damping", damping, unit="s/m", at_least=0),
            ]
        )

    @staticmethod
    def law(
        x: Any,
        v: Any,
        m: Any,
        t: Any,
        center: Any,
        velocity: Any,
        since: Any,
        duration: Any,
        radius: Any,
        rate: Any,
        damping: Any,
    ) -> Any:
        """Force [N]."""
        gone = t - since
        moves = fn.where((gone > 0.0) & (gone < duration), 1.0, 0.0)
        way = fn.minimum(fn.maximum(gone, 0.0), duration)
        d = fn.sub(x, fn.add(center, fn.scale(way, velocity)))
        length = fn.length(d)
        n = fn.scale(1.0 / fn.where(length > 0.0, length, 1.0), d)
        outwards = fn.dot(fn.sub(v, fn.scale(moves, velocity)), n)
        depth = fn.maximum(radius - length, 0.0)
        return fn.scale(m * rate * rate * depth * fn.maximum(1.0 - damping * outwards, 0.0), n)


class Sphere:
    """Pushes what it meets out of its way, and is not held up by it: it flies straight on.

    Attributes
    ----------
    radius : [m]; 0 = there is none.
    """

    def __init__(self, sim: Simulation) -> None:
        found = [force for force in sim.system.forces if isinstance(force, MovingSphere)]
        self._sim, self._force = sim, found[-1] if found else None
        self.radius = 0.0
        self._start, self._velocity = np.zeros(3), np.zeros(3)
        self._since = self._duration = 0.0

    def shoot(self, place: messages.Vector, velocity: messages.Vector, radius: float) -> None:
        """Fly from a place [m] with a velocity [m/s], for ever."""
        self._go(np.array(place), np.array(velocity), ALWAYS, radius)

    def lead(self, place: messages.Vector, radius: float) -> None:
        """Come to a place within a frame; at once if it was not there."""
        here = self.at(self._sim.t) if self.radius > 0 else np.array(place)
        self._go(here, (np.array(place) - here) / FOLLOWS, FOLLOWS, radius)

    def vanish(self) -> None:
        """Be gone."""
        self._go(np.zeros(3), np.zeros(3), 0.0, 0.0)

    def undoing(self, what: Shoot | Vanish) -> Input | None:
        """What takes back a shot, or that a ball is gone: a ball that flies now will fly on from here."""
        if self.radius > 0 and self._duration == ALWAYS:
            return Shoot(messages.vector(self.at(self._sim.t)), messages.vector(self._velocity), self.radius)
        return Vanish() if isinstance(what, Shoot) else None

    def again(self) -> None:
        """Go on likewise under another solver or step."""
        self._push()

    def at(self, t: float) -> Any:
        """Where its centre is [m], shape (3,)."""
        return self._start + self._velocity * min(max(t - self._since, 0.0), self._duration)

    def drawn(self, t: float, number: int) -> list[Points]:
        """What is to be seen of it."""
        if self.radius == 0:
            return []
        return [
            Points(name="pushing sphere", version=number, vertices=self.at(t)[None], radius=self.radius, color=COLOR)
        ]

    def _go(self, start: Any, velocity: Any, duration: float, radius: float) -> None:
        self._start, self._velocity, self._duration, self.radius = start, velocity, duration, radius
        self._since = self._sim.t
        self._push()

    def _push(self) -> None:
        if self._force is None:
            return
        rate, damping, h = RATE, DAMPING, self._sim.dt
        if not self._sim.solver.implicit:
            rate = min(rate, STIFFEST / h)
            damping = min(damping, MOST_DAMPED / (h * rate**2 * max(self.radius, 1e-9)))
        self._force.set(
            center=self._start.tolist(),
            velocity=self._velocity.tolist(),
            since=self._since,
            duration=self._duration,
            radius=self.radius,
            rate=rate,
            damping=damping,
        )
