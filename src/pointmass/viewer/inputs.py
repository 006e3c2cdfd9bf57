"""What a user does to a running simulation, as it is recorded: the same inputs at the same steps give the same bits."""

from __future__ import annotations

from dataclasses import dataclass, field

from pointmass.viewer.messages import Value, Vector
from pointmass.viewer.setup import Setup


@dataclass(frozen=True)
class Hold:
    """The spring of the mouse takes a particle, by its id, and draws it to a place [m]."""

    particle: int
    target: Vector


@dataclass(frozen=True)
class Lead:
    """It draws it to another place [m]."""

    target: Vector


@dataclass(frozen=True)
class LetGo:
    """It lets go."""


@dataclass(frozen=True)
class Turn:
    """Parameters of the scene have other values."""

    settings: dict[str, Value]


@dataclass(frozen=True)
class Solve:
    """Another solver solves, with steps of dt [s]; "" and 0 = those of the scene."""

    solver: str
    dt: float


@dataclass(frozen=True)
class Toggle:
    """A force or collider, by its place, is switched on or off."""

    name: str
    on: bool


@dataclass(frozen=True)
class Blow:
    """The wind blows in another direction."""

    direction: Vector


@dataclass(frozen=True)
class Restore:
    """All settings are those of another time."""

    setup: Setup


@dataclass(frozen=True)
class Shoot:
    """A ball flies from a place [m] with a velocity [m/s]; it has a radius [m]."""

    place: Vector
    velocity: Vector
    radius: float


@dataclass(frozen=True)
class Push:
    """A sphere of a radius [m] comes to a place [m]."""

    place: Vector
    radius: float


@dataclass(frozen=True)
class Vanish:
    """Ball and sphere are gone."""


@dataclass(frozen=True)
class Pin:
    """A particle, by its id, is held where it is, or let go."""

    particle: int
    on: bool


@dataclass(frozen=True)
class Join:
    """A spring joins two particles, by their ids; at rest it has a length [m], None = as they are apart."""

    first: int
    second: int
    rest: float | None = None


@dataclass(frozen=True)
class Cut:
    """The newest spring that joined two particles in this way is gone."""

    first: int
    second: int


@dataclass(frozen=True)
class Drop:
    """There is one more particle, at a place [m], with an id that one had who is gone, None = a new one."""

    place: Vector
    particle: int | None = None


@dataclass(frozen=True)
class Remove:
    """A particle, by its id, is gone."""

    particle: int


Settings = Turn | Solve | Toggle | Blow | Restore
Addition = Pin | Join | Cut | Drop | Remove
Input = Hold | Lead | LetGo | Shoot | Push | Vanish | Settings | Addition
PASSING = (Hold, Lead, LetGo, Push)  # those that are not undone
NUMBERS = (*PASSING, Shoot, Vanish)  # those for which no kernel is compiled


@dataclass
class Recording:
    """A run: the settings that it began with, and each input with the number of steps made before it."""

    setup: Setup = field(default_factory=Setup)
    inputs: list[tuple[int, Input]] = field(default_factory=list)


def changed(setup: Setup, what: Input) -> Setup | None:
    """The settings after an input; None if it has nothing to do with them."""
    match what:
        case Turn(settings):
            return setup.changed(parameters=settings)
        case Solve(solver, dt):
            return setup.changed(solver=solver, dt=dt)
        case Toggle(name, on):
            return setup.changed(switches={name: on})
        case Blow(direction):
            return setup.changed(wind=direction)
        case Restore(other):
            return other
    return None
