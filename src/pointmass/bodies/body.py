"""Builders of particles with the forces that hold them together."""

from __future__ import annotations

import functools
import inspect
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from pointmass.description import bind
from pointmass.errors import InvalidInput, unknown
from pointmass.laws.elements import ElementForce
from pointmass.laws.force import Force
from pointmass.particles import Particles

P = ParamSpec("P")


@dataclass(eq=False)
class Body:
    """Particles and the forces between them.

    Attributes
    ----------
    particles : with ids 0, 1, 2, ...
    forces : their ids are those of the particles.
    kind, arguments : how it was built, to write it as text and build it again.
    """

    particles: Particles
    forces: list[Force] = field(default_factory=list)
    kind: str = ""
    arguments: dict[str, Any] = field(default_factory=dict)

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Ids of the corners of its surface, shape (k, 3)."""
        surfaces = self.particles.surfaces.values()
        return np.concatenate([np.zeros((0, 3), np.int64), *(s.triangles for s in surfaces)])


BODIES: dict[str, Callable[..., Body]] = {}


def body(build: Callable[P, Body]) -> Callable[P, Body]:
    """Register a builder under its name; its bodies remember how they were built."""

    @functools.wraps(build)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Body:
        arguments = bind(build, *args, **kwargs)
        result = build(*args, **kwargs)
        result.kind, result.arguments = build.__name__, arguments
        return result

    wrapper.__signature__ = inspect.signature(build)  # type: ignore[attr-defined]
    BODIES[build.__name__] = wrapper
    return wrapper


def pin_parts(particles: Particles, pinned: Any) -> None:
    """Pin groups by their names.

    Parameters
    ----------
    pinned : the name of a group, a list of names, or "none".

    Raises
    ------
    InvalidInput
        A name of no group.
    """
    for name in [pinned] if isinstance(pinned, str) or not isinstance(pinned, Sequence) else pinned:
        if name != "none" and name not in list(particles.groups):
            raise unknown("value of pinned", name, [*particles.groups, "none"])
        if name != "none":
            particles.pin(name)


def join(bodies: Sequence[Body], names: Sequence[str], dtype: Any) -> tuple[Particles, list[Force]]:
    """One set of particles from several bodies, each a group under its name, and all their forces.

    Forces of the same law are one force, with the elements of all the bodies: one kernel for all, and the same sums,
    as no particle has elements of two bodies and each keeps the order of its own.

    A body's own group, such as "top edge", is a group "NAME top edge"; where no other body has one of that name, also
    "top edge". Its surface and its skin have its name.

    Raises
    ------
    InvalidInput
        Two bodies of one name, or one that has the name of a group of another.
    """
    if len(set(names)) < len(names):
        raise InvalidInput(f"bodies need different names, not {', '.join(names)}")
    attributes = sorted({a for b in bodies for a in b.particles.attributes})
    whole = Particles(np.zeros((0, 3)), dtype=dtype, **{a: np.zeros(0) for a in attributes})
    shared = Counter(group for b in bodies for group in b.particles.groups)
    forces: list[Force] = []
    for name, part in zip(names, bodies, strict=True):
        p, offset = part.particles, len(whole)
        whole.add(p.x, p.v, p.m, p.radius, lifetime=p.lifetime, **p.attributes)
        rows = np.arange(offset, offset + len(p))
        own = {f"{name} {group}": mask for group, mask in p.groups.items()}
        own |= {group: mask for group, mask in p.groups.items() if shared[group] == 1}
        for group, mask in {name: np.ones(len(p), bool), **own}.items():
            if group in whole.groups:
                raise InvalidInput(f"two bodies have a group {group!r}: name one of them otherwise")
            whole.tag(group, rows[mask])
        for surface, drawn in p.surfaces.items():
            called = name if len(p.surfaces) == 1 else f"{name} {surface}"
            skin = drawn.skin and drawn.skin.shifted(offset)
            whole.cover(called, drawn.triangles + offset, drawn.uv, drawn.inside + offset, skin)
        whole.pin(rows[p.pinned])
        place = 0  # in `forces`, from which on the body's next force may be: its own keep their order
        for force in part.forces:
            if isinstance(force, ElementForce):
                force.shifted(offset)
                place = _put(force, forces, place) + 1
            else:
                forces.append(_limited(force, rows))
                place = len(forces)
    return whole, forces


def _put(force: ElementForce, forces: list[Force], begin: int) -> int:
    """Where a force is now: in the first one from `begin` on that can have its elements, or by itself at the end."""
    for k, mate in enumerate(forces[begin:], begin):
        if isinstance(mate, ElementForce) and mate.joins(force):
            mate.take_in(force)
            return k
    forces.append(force)
    return len(forces) - 1


def _limited(force: Force, rows: Any) -> Force:
    """A force of one body acts on that body only."""
    force.on = rows if force.on is None else force.on
    return force
