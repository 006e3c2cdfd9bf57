"""Pins that move: pinned particles that follow a motion instead of staying where they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import unit
from pointmass.description import Described
from pointmass.errors import InvalidInput, finite_array
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.particles import Array, Particles, Selection
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
        self._start: tuple[float, Array] = 0.0, np.zeros((0, 3))
        self._rows: tuple[int, NDArray[np.intp], NDArray[np.bool_]] | None = None

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
        self.ids, self._start = particles.id[rows], (t, particles.x[rows].astype(np.float64))

    def rows(self, particles: Particles) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Rows of those of `ids` who are still there, and who that is."""
        if self._rows is None or self._rows[0] != particles.version:
            rows = particles.rows(self.ids)
            self._rows = particles.version, rows[rows >= 0], rows >= 0
        return self._rows[1:]

    def at(self, t: float) -> tuple[Array, Array]:
        """Places [m] and velocities [m/s] at time t, shape (k, 3), of the particles `ids`."""
        t0, start = self._start
        (angle,), (angle0,), (spin,) = self._angle.at(t), self._angle.at(t0), self._rates[1].at(t)
        shift = np.array(self._shift.at(t), np.float64) - np.array(self._shift.at(t0), np.float64)
        c, s = float(fn.cos(angle - angle0)), float(fn.sin(angle - angle0))
        arm = start - self.center
        along = (arm[:, :1] * self.axis[0] + arm[:, 1:2] * self.axis[1] + arm[:, 2:] * self.axis[2]) * self.axis
        flat = arm - along  # turned in the plane across the axis, where (flat, side) are at right angles
        side = np.cross(self.axis, flat)
        velocity = np.array(self._rates[0].at(t), np.float64) + float(spin) * (c * side - s * flat)
        return self.center + along + c * flat + s * side + shift, velocity


MOTIONS: Mapping[str, type[RigidMotion]] = {"rigid": RigidMotion}


def stage_of(solver: Solver) -> float:
    """Where in a step, from 0 to 1, a solver sees pins that move."""
    if solver.implicit:
        return float(getattr(solver, "c", 1.0))
    return 0.0 if solver.evaluations == 1 else 0.5
