"""What every scene that is shipped with us is: named parameters with units, a scene built from them, a final check."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body
from pointmass.errors import InvalidInput, PointmassError, number, unknown
from pointmass.forces import Bulk, Springs, Volumes
from pointmass.forces.bulk import steepness
from pointmass.frame import Frame
from pointmass.scene import Scene
from pointmass.solvers.base import Solver
from pointmass.solvers.stability import largest_safe_step


class CheckFailed(PointmassError):
    """A scene did not end as its physics says."""


def knob(
    default: Any,
    summary: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
) -> Any:
    """A parameter of a scene: its default, what it means, its unit, and the values that are allowed."""
    return field(
        default=default,
        metadata={"summary": summary, "unit": unit, "low": low, "high": high, "choices": tuple(choices)},
    )


@dataclass(frozen=True, kw_only=True)
class ShippedScene(ABC):
    """One phenomenon. A leaf is a frozen dataclass of `knob`s; its docstring's first line says what one sees.

    Attributes
    ----------
    presets : settings of the knobs that belong together, by name.

    Raises
    ------
    InvalidInput
        A value that a parameter does not allow.
    """

    name: ClassVar[str]
    presets: ClassVar[dict[str, dict[str, Any]]] = {}

    def __post_init__(self) -> None:
        for f in fields(self):
            object.__setattr__(self, f.name, _allowed(f, getattr(self, f.name)))

    @abstractmethod
    def build(self) -> Scene:
        """The scene with these parameters."""

    @abstractmethod
    def check(self, frames: Sequence[Frame]) -> None:
        """Compare a run with what physics says.

        Raises
        ------
        CheckFailed
            One sentence with the figures.
        """

    @classmethod
    def summary(cls) -> str:
        """One line about the scene."""
        return (cls.__doc__ or "").strip().splitlines()[0]

    @classmethod
    def parameters(cls) -> list[dict[str, Any]]:
        """Its parameters, for lists and forms."""
        return [
            {
                "name": f.name,
                "default": f.default,
                "unit": f.metadata["unit"],
                "minimum": f.metadata["low"],
                "maximum": f.metadata["high"],
                "choices": list(f.metadata["choices"]),
                "summary": f.metadata["summary"],
            }
            for f in fields(cls)
        ]

    @classmethod
    def with_settings(cls, settings: Mapping[str, Any], preset: str | None = None) -> ShippedScene:
        """The scene with some parameters set, given as numbers or as text from a command line, over a preset."""
        if preset is not None:
            if preset not in cls.presets:
                raise unknown(f"preset of scene {cls.name}:", preset, cls.presets)
            settings = {**cls.presets[preset], **settings}
        known = {f.name for f in fields(cls)}
        for name in settings:
            if name not in known:
                raise unknown(f"parameter of scene {cls.name}:", name, known)
        return cls(**settings)


def expect(holds: bool, sentence: str) -> None:
    """Fail a scene's check with a sentence unless it holds."""
    if not holds:
        raise CheckFailed(sentence)


def substeps(solver: Solver, stiffness: float, damping: float) -> int:
    """Steps in a sixtieth of a second that keep the stiffest motion of a body stable, with some room.

    Parameters
    ----------
    stiffness, damping : of that motion, x'' = -stiffness x - damping x' [1/s^2, 1/s]; slower ones have parts of both.
    """
    parts = np.linspace(0.1, 1.0, 10)
    return math.ceil(1 / 60 / (0.8 * largest_safe_step(solver, parts * stiffness, parts * damping)))


def stiffest(body: Body, part: float = 1.0) -> tuple[float, float]:
    """Bounds of the stiffness and the damping of the springs and volumes of a body [1/s^2, 1/s], for `substeps`.

    An element with k nodes adds at most k k_s |dC/dx|^2 |x|^2 of each of them to x K x: for a spring 2 k_s |x|^2 of
    each end, whichever way it points and as long as it is not stretched beyond all measure. So no frequency^2 is above
    the largest sum of that over m at a particle, however a body of springs is folded; volumes are taken as they are.

    Parameters
    ----------
    part : of its volume to which each tetrahedron of a solid (`Bulk`) is squeezed.
    """
    p = body.particles
    total = np.zeros((2, len(p)))
    for force in body.forces:
        if isinstance(force, (Springs, Volumes)):
            rows = force.rows(p)
            settings = force.settings(p, 0.0, np.arange(len(rows)))
            slope = np.ones(rows.shape) if isinstance(force, Springs) else (force.slopes(p.x[rows]) ** 2).sum(axis=2)
            for k, name in enumerate(("k_s", "k_d")):
                value = force.nodes * np.broadcast_to(settings[name][0], len(rows))[:, None] * slope
                if name == "k_s" and isinstance(force, Bulk):
                    value = steepness(part) * value
                total[k] += np.bincount(rows.ravel(), value.ravel(), len(p))
    stiffness, damping = (total / p.m).max(axis=1)
    return float(stiffness), float(damping)


def _allowed(f: Any, value: Any) -> Any:
    assert f.default is not MISSING
    if f.metadata["choices"]:
        if value not in f.metadata["choices"]:
            raise unknown(f"value of {f.name}:", value, f.metadata["choices"])
        return value
    if isinstance(f.default, bool):
        if str(value).lower() not in ("true", "false", "1", "0"):
            raise InvalidInput(f"{f.name} = {value} is not allowed: it must be true or false")
        return str(value).lower() in ("true", "1")
    if isinstance(f.default, str):
        return str(value)
    result = number(f.name, value, at_least=f.metadata["low"], at_most=f.metadata["high"], unit=f.metadata["unit"])
    if isinstance(f.default, int):
        if result != int(result):
            raise InvalidInput(f"{f.name} = {value} is not allowed: it must be a whole number")
        return int(result)
    return result
