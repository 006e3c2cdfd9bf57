"""Pins that move: pinned particles that follow a motion instead of staying where they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import unit
from pointmass.description import Described
from pointmass.errors import InvalidInput, finite_array, shown
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.particles import Array, Particles, Selection, read_only
from pointmass.solvers.base import Solver
from pointmass.tracing import functions as fn


class RigidMotion(Described):
    """Pinned particles move as one rigid body: they turn about an axis, and are shifted.

    x(t) = center + R(angle(t) - angle(0)) (x(0) - center) + shift(t) - shift(0), and v(t) is its derivative. What hangs
    at the particles is pulled along by its springs; colliders move by formulas of their own.

    A solver sees the particles once in each step, at rest at the place and with the velocity that belong to its
    evaluation of the forces: at the start of a step of `symplectic_euler` and `euler` and at the end of one of
    `implicit_euler` and `bdf2`, which is what these methods ask for; in the middle for all others, which are of order 2
    at most for the particles that hang there. At the end of each step, and in frames, they are where they have to be.

    Parameters
    ----------
    on : of these, those that are pinned are led.
    shift : [m], three numbers, formulas or functions of t.
    angle : right-handed about the axis [rad], a formula or a function of t.
    axis : direction.
    center : a point of the axis [m].

    Examples
    --------
    >>> pm.RigidMotion("hair", angle="0.8*sin(3*t)")
    """

    def __init__(
        self,
        on: Selection = None,
        *,
        shift: Vector = (0.0, 0.0, 0.0),
        angle: Scalar = 0.0,
        axis: Any = (0.0, 1.0, 0.0),
        center: Any = (0.0, 0.0, 0.0),
    ) -> None:
        self.on = on
        self.axis, self.center = unit("axis", axis), finite_array("center", center, (3,))
        self._shift = Parameter("shift", shift, vector=True, unit="m")
        self._angle = Parameter("angle", angle, unit="rad")
        for parameter in (self._shift, self._angle):
            if not parameter.common:
                raise InvalidInput(f"{parameter.name} may depend on t and nothing else")
        self._rates = self._shift.rate(), self._angle.rate()
        self.ids: NDArray[np.int64] = np.zeros(0, np.int64)
        self.arms: Array = np.zeros((0, 3))
        self._start = 0.0
        x, y, z = self.axis
        self._across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # times a vector: axis x vector
        self._twice = self._across @ self._across

    def bind(self, particles: Particles, t: float) -> None:
        """Note who is led, and from where.

        Raises
        ------
        InvalidInput
            None of the particles is pinned.
        """
        rows = particles.select(self.on)
        rows = rows[particles.pinned[rows]]
        if not len(rows):
            who = "of the particles" if self.on is None else f"of {self.on!r}"
            raise InvalidInput(f"a motion leads pinned particles, and none {who} is pinned: pin those that it leads")
        self.ids, self._start = particles.id[rows], t
        self.arms = particles.x[rows].astype(np.float64) - self.center

    def maps(self, times: Array) -> Array:
        """What takes `arms` to places and velocities at some times, shape (times, 2, 3, 4).

        A place is M arm + b [m], with M and b the first three columns and the last one of the first 3x4 matrix; a
        velocity [m/s] likewise, by the second one. R = 1 + sin(a) K + (1 - cos(a)) K^2, where K r = axis x r
        (Rodrigues).

        Raises
        ------
        InvalidInput
            A formula is not finite at one of the times.
        """
        (angle,), (angle0,), (spin,) = self._angle.at(times), self._angle.at(self._start), self._rates[1].at(times)
        c, s = (np.broadcast_to(f(angle - angle0), times.shape)[:, None, None] for f in (fn.cos, fn.sin))
        result = np.zeros((len(times), 2, 3, 4))
        result[:, 0, :, :3] = np.eye(3) + s * self._across + (1.0 - c) * self._twice
        result[:, 1, :, :3] = np.broadcast_to(spin, times.shape)[:, None, None] * (c * self._across + s * self._twice)
        moves = zip(self._shift.at(times), self._shift.at(self._start), self._rates[0].at(times), strict=True)
        for axis, (shift, shift0, speed) in enumerate(moves):
            result[:, 0, axis, 3] = self.center[axis] + (shift - shift0)
            result[:, 1, axis, 3] = speed
        return result


MOTIONS: Mapping[str, type[RigidMotion]] = {"rigid": RigidMotion}


@dataclass(frozen=True, eq=False)
class Led:
    """Those of some particles who are led.

    Attributes
    ----------
    rows : of them, in the order of their motions.
    motion : number of the motion of each.
    arms : places seen from the center of that motion at the start [m], shape (k, 3).
    columns : the same for all particles: number of the motion, from 1 on, or 0, and arms, shape (4, n).
    """

    rows: NDArray[np.intp]
    motion: NDArray[np.intp]
    arms: Array
    columns: list[Array]


NOBODY = Led(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 3)), [])


@dataclass(eq=False)
class Motions:
    """The motions of a run, and what a solver sees of them."""

    motions: Sequence[RigidMotion] = ()
    stage: float = 0.0  # where in a step, from 0 to 1, the solver sees pins that move
    _led: tuple[Any, Led | None] = field(default=(None, None), init=False)
    _next: tuple[float, Array] = field(default=(math.nan, np.zeros(0)), init=False)  # maps of the end of steps

    @classmethod
    def of(cls, motions: Sequence[RigidMotion], solver: Solver, particles: Particles, t: float) -> Motions:
        """Motions that begin at time t.

        Raises
        ------
        InvalidInput
            One leads nobody, two lead the same particle.
        """
        for motion in motions:
            if not isinstance(motion, RigidMotion):
                raise InvalidInput(f"motions must be motions, such as pm.RigidMotion(), not {shown(motion)}")
            motion.bind(particles, t)
        led, times = np.unique(np.concatenate([[-1], *(m.ids for m in motions)]), return_counts=True)
        if (times > 1).any():
            raise InvalidInput(f"two motions lead particle {int(led[times > 1][0])}: give each motion its own")
        return cls(motions, stage_of(solver))

    def __bool__(self) -> bool:
        return len(self.motions) > 0

    def led(self, particles: Particles) -> Led:
        """Who of those that are there is led."""
        if not self.motions:
            return NOBODY  # at once: particles come and go in each step of a run
        ids, found = self._led
        if found is None or ids is not particles.id:
            rows = [particles.rows(motion.ids) for motion in self.motions]
            row = np.concatenate([np.zeros(0, np.intp), *(r[r >= 0] for r in rows)])
            number = np.repeat(np.arange(len(rows)), [int((r >= 0).sum()) for r in rows])
            arms = [m.arms[r >= 0] for m, r in zip(self.motions, rows, strict=True)]
            arm = np.concatenate([np.zeros((0, 3)), *arms])
            columns = np.zeros((4, len(particles)))
            columns[:, row] = np.stack([number + 1, *arm.T])
            found = Led(row, number, arm, [read_only(column) for column in columns])
            self._led = particles.id, found
        return found

    def seen(self, starts: Array, ends: Array) -> Array:
        """Maps of all motions where a solver sees them in steps, shape (steps, motions, 2, 3, 4).

        Raises
        ------
        InvalidInput
            A formula is not finite in one of the steps.
        """
        times = np.append(starts + self.stage * (ends - starts), ends[-1:])
        found = np.stack([motion.maps(times) for motion in self.motions], axis=1)
        self._next = (float(ends[-1]), found[-1]) if len(ends) else (math.nan, found)
        return found[: len(starts)]

    def put(self, particles: Particles, x: Array, v: Array, t: float) -> NDArray[np.intp]:
        """Put who is led where they are at time t; returns their rows."""
        led, begin = self.led(particles), 0
        known = self._next[1] if self._next[0] == t else None
        for k, motion in enumerate(self.motions):
            end = int(np.searchsorted(led.motion, k, side="right"))
            rows, (a, b, c) = led.rows[begin:end], led.arms[begin:end].T
            maps = motion.maps(np.array([t]))[0] if known is None else known[k]
            for column, m in zip((x, v), maps, strict=True):
                for axis in range(3):  # added up as in kernels
                    column[rows, axis] = a * m[axis, 0] + b * m[axis, 1] + c * m[axis, 2] + m[axis, 3]
            begin = end
        return led.rows

    def put_in_step(self, particles: Particles, start: float, end: float) -> NDArray[np.intp]:
        """Put who is led where the solver wants to see them in a step; returns their rows."""
        return self.put(particles, particles.x, particles.v, start + self.stage * (end - start))


NO_MOTIONS = Motions()


def stage_of(solver: Solver) -> float:
    """Where in a step, from 0 to 1, a solver sees pins that move."""
    if solver.implicit:
        return float(getattr(solver, "c", 1.0))
    return 0.0 if solver.evaluations == 1 else 0.5
