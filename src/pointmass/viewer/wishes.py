"""What a page asks for, as an input of the player."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.viewer.history import History
from pointmass.viewer.inputs import (
    Blow,
    Drop,
    Hold,
    Input,
    Join,
    Lead,
    LetGo,
    Pin,
    Push,
    Shoot,
    Solve,
    Toggle,
    Turn,
    Vanish,
)
from pointmass.viewer.messages import (
    AddParticle,
    Change,
    Choose,
    Clear,
    Drag,
    Grab,
    Inbound,
    JoinPicked,
    PinPicked,
    PushAt,
    Redo,
    Release,
    SetSolver,
    SetSwitch,
    SetWind,
    ShootBall,
    Undo,
)
from pointmass.viewer.player import Player

Identify = Callable[[int, int], int]  # the id of the particle in a row of a frame


def wish(message: Inbound, player: Player, history: History, identify: Identify) -> Input | None:
    """The input of a message; None if it asks for nothing.

    Raises
    ------
    InvalidInput
        It cannot be, whatever the state of the run.
    """
    if isinstance(message, Undo | Redo):
        return history.undone() if isinstance(message, Undo) else history.redone()
    if isinstance(message, Grab):
        return Hold(identify(message.sequence, message.row), message.target)
    asked = WISHES.get(type(message))
    return None if asked is None else asked(message, player)


def _picked(player: Player, count: int) -> list[int]:
    if len(player.picked) < count:
        raise InvalidInput("pick a particle first" if count == 1 else "pick two particles first, one after the other")
    return player.picked[:count]


WISHES: dict[type, Callable[[Any, Player], Input | None]] = {
    Change: lambda m, _: Turn({m.name: m.value}),
    Choose: lambda m, player: player.preset(m.preset),
    SetSolver: lambda m, _: Solve(m.name, m.dt),
    SetSwitch: lambda m, _: Toggle(m.name, m.on),
    SetWind: lambda m, _: Blow(m.direction),
    Drag: lambda m, _: Lead(m.target),
    Release: lambda _, __: LetGo(),
    ShootBall: lambda m, _: Shoot(m.place, m.velocity, m.radius),
    PushAt: lambda m, _: Push(m.place, m.radius),
    Clear: lambda _, __: Vanish(),
    PinPicked: lambda _, player: Pin(_picked(player, 1)[0], not player.pinned),
    JoinPicked: lambda _, player: Join(*_picked(player, 2)),
    AddParticle: lambda m, _: Drop(m.place),
}
