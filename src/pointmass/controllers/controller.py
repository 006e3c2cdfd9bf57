"""What sets parameters of forces between steps, from what it sees: a brain."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.description import Described
from pointmass.errors import InvalidInput, number
from pointmass.laws.elements import ElementForce
from pointmass.laws.parameter import Parameter, Rows
from pointmass.system import ParticleSystem


def elements_of(
    system: ParticleSystem, kind: type[ElementForce], ids: NDArray[np.int64]
) -> list[tuple[ElementForce, Rows]]:
    """Forces of a kind that act between particles with some ids, each with the numbers of the elements that do.

    A force may have elements of several bodies, see `bodies.join`.
    """
    found = [(force, force.among(ids)) for force in system.forces if isinstance(force, kind)]
    return [(force, rows) for force, rows in found if len(rows)]


class Controller(Described):
    """Looks at the system from time to time, and sets parameters of its forces until it looks again.

    Between two looks the laws run as they are compiled, so thousands of brains that think ten times a second cost next
    to nothing. Looks are on the grid of steps: how often frames are made changes nothing.

    Parameters
    ----------
    period : time between two looks [s], at least 0; a run rounds it to whole steps of dt, at least one.

    Attributes
    ----------
    memory : all that it remembers from one look to the next, arrays by name: with them, another one of the same kind
        goes on with the same bits.

    Examples
    --------
    >>> class Turn(pm.Controller):
    ...     def bind(self, system, seed):
    ...         self.muscles = next(f for f in system.forces if isinstance(f, pm.Muscles))
    ...     def control(self, system, t):
    ...         self.muscles.put(offset=0.1 if system.particles.x[0, 2] < 1.0 else 0.0)
    >>> sim = pm.Simulation(system, controllers=[Turn(period=0.1)])
    """

    def __init__(self, period: float = 0.1) -> None:
        self.period = number("period", period, at_least=0, unit="s")
        self.memory: dict[str, Any] = {}

    def bind(self, system: ParticleSystem, seed: int) -> None:
        """Look at the start of a run, once: find what is to be controlled. All chance comes from `seed`.

        Raises
        ------
        InvalidInput
            The system has nothing that this can control.
        """
        raise NotImplementedError

    def control(self, system: ParticleSystem, t: float) -> None:
        """Set parameters for the time from t on."""
        raise NotImplementedError

    @staticmethod
    def check_goal(system: ParticleSystem, goal: Parameter) -> None:
        """Refuse a goal that nobody can reach.

        Raises
        ------
        InvalidInput
            It is inside of a collider, now, or depends on more than t.
        """
        if not goal.common:
            raise InvalidInput(f"{goal.name} may depend on t and nothing else")
        place = np.array([goal.at(system.t)], np.float64)
        for collider in system.colliders:
            if collider.distance(place, system.t)[0] < 0:
                where = f"{goal.name} = {place[0].tolist()}"
                raise InvalidInput(f"{where} is not allowed: it is inside {collider.name}, where nobody can be")

    def smooth(self, name: str, now: Any, delay: float) -> Any:
        """What is remembered under a name, drawn from look to look towards what is seen now, over `delay` [s]."""
        share = self.period / (self.period + delay) if delay else 1.0
        self.memory[name] = self.memory[name] + share * (now - self.memory[name])
        return self.memory[name]

    def every(self, dt: float) -> int:
        """Steps of dt between two looks."""
        return max(1, round(self.period / dt))
