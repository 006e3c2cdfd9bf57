"""Extended position-based dynamics."""

from __future__ import annotations

from typing import ClassVar, final

import numpy as np

from pointmass.errors import InvalidInput, whole_number
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.dense import straight
from pointmass.solvers.islands import largest, moved, number_of


@final
class XPBD(Solver):
    """A step of symplectic Euler by all other forces, and then its elastic elements one after the other: order 1.

    An element is a damped spring of a scalar C(x1, ..., xk), such as a length or an angle. Its force along dC/dx is
    made to fit the place where it brings its particles itself, and is noted; the next sweep goes on from there. In the
    limit of many sweeps that is backward Euler with the same stiffness and damping, but that forces keep the directions
    they had. With fewer sweeps structures are softer, and the more so the stiffer and finer they are: many short steps
    of one sweep do better than long steps of many. No stiffness makes it unstable.

    Parameters
    ----------
    iterations : sweeps in a step, at least 1.

    Notes
    -----
    Macklin, Mueller and Chentanez, XPBD (2016), eq. 18 and 26, multiplied by the stiffness, so that it may be 0.
    Macklin et al., Small steps in physics simulation (2019). Colours of elements that share no particle take turns, so
    that a sweep does not depend on the number of threads.
    """

    name: ClassVar[str] = "xpbd"
    order: ClassVar[int] = 1
    evaluations: ClassVar[int] = 1
    implicit: ClassVar[bool] = True
    relaxes: ClassVar[bool] = True
    moves_masses: ClassVar[bool] = True

    def __init__(self, iterations: int = 1) -> None:
        self.iterations = whole_number("iterations", iterations, at_least=1)

    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h."""
        if system.order != 2:
            raise InvalidInput(f"{self.name} needs x'' = f/m, but this system has order {system.order}: use rk4")
        n = len(y) // 2
        length = np.broadcast_to(np.asarray(h, y.dtype), y.shape)
        hx, hv = length[:n], length[n:]
        x, v = y[:n], y[n:]
        slope = system.external(t, y)
        led, lead = slope[:n] != v, slope[:n]  # where the system moves x on its own: pinned or led by hand
        v1 = v + hv * slope[n:]
        free = hx * np.where(led, lead, v1)
        rise = system.relaxed(t + h, length, x, free, self.iterations)
        v1 = v1 + (rise - free) / np.where(hx == 0.0, 1.0, hx)
        y1 = moved(h, y, np.concatenate([x + rise, v1]))
        return Step(t, h, y, y1, straight(h, y, y1, True), memory)

    def residual(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory, y1: Array) -> Array:
        """v1 - v - h a, with the a of the elastic elements at the end of the step and of all else at its start."""
        n = len(y) // 2
        elastic = system.deriv_eval(t + h, y1) - system.external(t + h, y1)
        change, islands = y1[n:] - y[n:], system.islands[n:]
        count = number_of(islands)
        size = largest(y[n:], islands, count) + largest(change, islands, count)
        gap = change - np.broadcast_to(h, y.shape)[n:] * (system.external(t, y) + elastic)[n:]
        result: Array = gap / np.where(size > 0.0, size, 1.0)[islands]
        return result
