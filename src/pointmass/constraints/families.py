"""What constraints are about, by its names; springs by those of their families."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pointmass.errors import InvalidInput, shown, unknown
from pointmass.laws.elements import ConstraintForce
from pointmass.system import ParticleSystem

Families = str | Sequence[str]


def families_of(value: Any) -> tuple[str, ...] | None:
    """Names of families, from one name or several; None = all.

    Raises
    ------
    InvalidInput
        Something that is no name.
    """
    return names_of("families", value, "the name of a family of springs, such as 'stretch'")


def names_of(parameter: str, value: Any, what: str) -> tuple[str, ...] | None:
    """Names, from one or several; None = all.

    Raises
    ------
    InvalidInput
        Something that is no name, or none.
    """
    if value is None:
        return None
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
        raise InvalidInput(f"{parameter} = {shown(value)} is not allowed: it must be {what}, or a list of names")
    return tuple(names)


def of_families(system: ParticleSystem, families: tuple[str, ...] | None) -> list[ConstraintForce]:
    """The springs of some families, in the order of the forces.

    Raises
    ------
    InvalidInput
        No springs at all, or none of one of the families.
    """
    springs = [f for f in system.forces if isinstance(f, ConstraintForce) and f.nodes == 2]
    if not springs:
        raise InvalidInput("this system has no springs that a constraint could be about")
    for name in families or ():
        if name not in [force.family for force in springs]:
            raise unknown("family of springs", name, {force.family for force in springs})
    return [force for force in springs if families is None or force.family in families]
