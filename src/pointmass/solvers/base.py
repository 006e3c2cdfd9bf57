"""What a solver may know of a system (four verbs and little more), and what it gives back.

A solver sees numbers `y`, a clock `t` and the four verbs of the lecture: `dim`, `get_state`, `set_state`, `deriv_eval`.
It knows neither particles nor forces. Independent parts of a system (islands) may each have a clock and
a step of their own: `t` and `h` are then arrays of shape (dim,), and nothing else changes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from pointmass.description import Described

Array = NDArray[np.floating[Any]]
Clock = float | Array  # a number, or one for each entry of y
Memory = dict[str, NDArray[Any]]


class System(Protocol):
    """The side of a system that solvers see.

    `y = [x, v]` for order 2 (x' = v, v' = a), any layout for order 1 (x' = g).
    """

    @property
    def dim(self) -> int:
        """How many numbers the state has."""

    @property
    def order(self) -> int:
        """1: y' = g(t, y). 2: y = [x, v] with x' = v, v' = a(t, x, v)."""

    @property
    def velocity_dependent(self) -> bool:
        """Whether a depends on v (order 2)."""

    @property
    def islands(self) -> NDArray[np.intp]:
        """Island of each entry of y, shape (dim,), counted from 0."""

    @property
    def inertia(self) -> Array:
        """Mass that belongs to each entry of v, shape (dim // 2,); order 2 only. M v' = f has a symmetric df/dx."""

    def deriv_eval(self, t: Clock, y: Array) -> Array:
        """dy/dt, shape (dim,): a new array, a pure function of (t, y)."""

    def jacobian(self, t: Clock, y: Array, share: Array | None = None) -> Any:
        """d(deriv_eval)/dy, a scipy.sparse CSR array of shape (dim, dim).

        Parameters
        ----------
        share : of what may make the matrix of an implicit step indefinite, shape (dim,); None = all of it. A system
            that knows no such part gives all of it.
        """

    def external(self, t: Clock, y: Array) -> Array:
        """dy/dt without the elements that `relaxed` stands for, shape (dim,)."""

    def relaxed(self, t: Clock, h: Array, x: Array, rise: Array, sweeps: int) -> Array:
        """How far positions come in a step with elements that are relaxed one by one (order 2).

        Parameters
        ----------
        t, h : end and length of the step, each a number or of shape (dim,).
        x : positions at its start, shape (dim // 2,).
        rise : how far they come without the elements.
        sweeps : times that every element is looked at.
        """


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a solver.

    Attributes
    ----------
    t, h : start and length of the step [s], numbers or arrays of shape (dim,).
    y0, y1 : state before and after, shape (dim,).
    memory : what the solver wants back at its next step; entries of shape (dim,) or (islands,).
    error : estimate of the local error, shape (dim,), from methods that have one.
    iterations : linear systems that Newton's method solved, counted for each island; 0 for explicit methods.
    cg_iterations : of conjugate gradients, counted for each island.
    rejected : trials whose equations were not solved, so that the step was divided, counted for each island.
    dense : theta in [0, 1] (a number or an array of shape (dim,)) -> state at t + theta h.
    """

    t: Clock
    h: Clock
    y0: Array
    y1: Array
    dense: Callable[[Clock], Array]
    memory: Memory = field(default_factory=dict)
    error: Array | None = None
    iterations: int = 0
    cg_iterations: int = 0
    rejected: int = 0


class Solver(Described, ABC):
    """Advances y by one step. A leaf is numbers and a docstring; the loops are its family's.

    Attributes
    ----------
    name : as in scene files and on the command line.
    order : of convergence.
    evaluations : of deriv_eval for one step (implicit methods: at least).
    implicit : whether resting contact is that of the start of a step.
    relaxes : whether it asks for `System.external` and `relaxed` instead of `deriv_eval`.
    moves_masses : whether it solves x'' = f/m only, so that it cannot solve a flow.
    """

    name: ClassVar[str]
    order: ClassVar[int]
    evaluations: ClassVar[int]
    implicit: ClassVar[bool] = False
    relaxes: ClassVar[bool] = False
    moves_masses: ClassVar[bool] = False

    @abstractmethod
    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h. An entry whose h is 0 keeps its bits.

        Raises
        ------
        InvalidInput
            The method needs order 2 and the system has order 1.
        Diverged
            The equations of an implicit step could not be solved.
        """

    def residual(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory, y1: Array) -> Array | None:
        """What a step to y1 leaves of the equations that it had to solve; the other arguments are those of `step`.

        Returns
        -------
        Array or None
            One number for each velocity (order 1: for each entry), relative to the size of the equation's terms on its
            island, shape (dim / order,). None: an explicit method solves no equations.
        """
        return None

    @property
    def braking(self) -> float:
        """Where in a step the velocity lies at which friction may be a drag, since the equations solve for it; 0:
        they do not, and friction is a force."""
        return 0.0

    def start(self, system: System) -> Memory:
        """Memory before the first step, and for islands that were set anew (after a collision, at birth)."""
        return {}
