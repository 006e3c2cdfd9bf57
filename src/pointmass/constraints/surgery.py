"""Cuts surfaces at a vertex: triangles come apart, and with them all elements that joined them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pointmass.laws.elements import ElementForce
from pointmass.particles import Array, Particles, Surface
from pointmass.system import ParticleSystem

if TYPE_CHECKING:
    from collections.abc import Iterable

Ids = NDArray[np.int64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Star:
    """The triangles around a vertex.

    Attributes
    ----------
    vertex : its id.
    others : ids of both other corners of each triangle, shape (k, 2).
    places : surface of each triangle, and its number there.
    areas : of the triangles as they were at the start, shape (k,); all 1 where one has none.
    around : all triangles that have a corner in common with these, shape (j, 3); those of the star are left out.
    """

    vertex: int
    others: Ids
    places: list[tuple[str, int]]
    areas: Array
    around: Ids

    @property
    def neighbours(self) -> Ids:
        """Ids of the vertices that it has edges to, ascending."""
        return np.unique(self.others)

    @property
    def open(self) -> bool:
        """Whether the vertex is at a border: its triangles do not go all the way round it."""
        return len(self.neighbours) != len(self.places)

    def sides(self, particles: Particles, direction: Array) -> Mask:
        """Which triangles have their middle in a direction from the vertex, shape (k,)."""
        centre, ends = (particles.x[particles.rows(ids)].astype(np.float64) for ids in (self.vertex, self.others))
        return np.asarray(((ends.sum(axis=1) - 2 * centre) * direction).sum(axis=1) > 0)

    def fans(self, sides: Mask | None = None) -> Rows:
        """Number of the fan that each triangle is in, shape (k,): in a fan each shares an edge with the next.

        Parameters
        ----------
        sides : triangles on different sides of a cut are not in one fan.
        """
        label = np.arange(len(self.places))
        for i, mine in enumerate(self.others):
            for j in range(i):
                together = sides is None or sides[i] == sides[j]
                if together and label[i] != label[j] and (mine[:, None] == self.others[j]).any():
                    label[label == max(label[i], label[j])] = min(label[i], label[j])
        return np.unique(label, return_inverse=True)[1]


def star(particles: Particles, vertex: int) -> Star:
    """The triangles around a vertex, in all surfaces."""
    nothing = np.zeros((0, 3), np.int64)
    others, places, areas, around = [nothing[:, :2]], [], [np.zeros(0)], [nothing]
    for name, surface in particles.surfaces.items():
        mine = (surface.triangles == vertex).any(axis=1)
        numbers = np.flatnonzero(mine)
        if len(numbers):
            corners = surface.triangles[numbers]
            others.append(corners[corners != vertex].reshape(-1, 2))
            places += [(name, int(k)) for k in numbers]
            areas.append(surface.areas[numbers])
            near = np.isin(surface.triangles, others[-1]).any(axis=1)
            around.append(surface.triangles[near & ~mine])
    area = np.concatenate(areas)
    area = area if (area > 0).all() else np.ones(len(area))
    return Star(vertex, np.concatenate(others), places, area, np.concatenate(around))


def cut(system: ParticleSystem, vertex: int, direction: Array) -> Ids:
    """Cut through a vertex across a direction; returns the ids of all vertices that have become several.

    Triangles on different sides come apart, and so do fans at neighbours that now hang together at nothing but a point.
    Nothing happens where all triangles are on one side.
    """
    p = system.particles
    here = star(p, vertex)
    fans = here.fans(here.sides(p, direction))
    if not len(fans) or not fans.any():
        return np.zeros(0, np.int64)
    found = [divided(system, here, fans)]
    for neighbour in here.neighbours:
        next_to = star(p, int(neighbour))
        fans = next_to.fans()
        if fans.any() and not p.pinned[p.rows(neighbour)]:
            found.append(divided(system, next_to, fans))
    return np.concatenate(found)


def divided(system: ParticleSystem, here: Star, fans: Rows) -> Ids:
    """Give each fan a vertex of its own; returns the ids of all of them.

    Each has the part of the mass that its triangles have of the area; the largest fan keeps the vertex. Elements follow
    the triangles that they belong to. A spring on an edge along which triangles come apart becomes two, each with its
    part of the stiffness; what joined triangles that have come apart is gone.
    """
    p = system.particles
    part = np.bincount(fans, here.areas) / here.areas.sum()
    order = np.argsort(-part, kind="stable")
    fans, part = np.argsort(order)[fans], part[order]  # the largest one is the first
    owners = np.append(here.vertex, system.divide(int(p.rows(here.vertex)), part))
    for force in system.forces:
        if isinstance(force, ElementForce) and len(force.ids):
            (_follow_pairs if force.nodes == 2 else _follow)(force, here, fans, owners)
    for name in dict(here.places):
        surface = p.surfaces[name]
        triangles = surface.triangles.copy()
        for (where, number), fan in zip(here.places, fans, strict=True):
            if where == name:
                triangles[number, triangles[number] == here.vertex] = owners[fan]
        p.surfaces[name] = Surface(triangles, surface.uv, surface.areas, surface.inside)
    p.version += 1
    return owners


def snapped(force: ElementForce, pair: Ids) -> None:
    """Take one spring out of a force, the first that joins a pair."""
    kept = np.delete(np.arange(len(force.ids)), np.flatnonzero((force.ids == pair).all(axis=1))[0])
    force.remake(force.ids[kept], kept, np.ones(len(kept)))


def _follow(force: ElementForce, here: Star, fans: Rows, owners: Ids) -> None:
    """Elements of three and more particles go with their triangles; those whose triangles have come apart are gone."""
    touched = np.flatnonzero((force.ids == here.vertex).any(axis=1))
    if not len(touched):
        return
    ids, kept = force.ids.copy(), np.ones(len(force.ids), bool)
    for element in touched:
        its = np.unique(fans[np.isin(here.others, ids[element]).all(axis=1)])
        kept[element] = len(its) < 2
        ids[element, ids[element] == here.vertex] = owners[its[0] if len(its) else 0]
    source = np.flatnonzero(kept)
    force.remake(ids[source], source, np.ones(len(source)))


def _follow_pairs(force: ElementForce, here: Star, fans: Rows, owners: Ids) -> None:
    """Springs from the vertex go with their triangles, as one or as several; those across it go if nothing bears them
    any more."""
    at = force.ids == here.vertex
    touched = np.flatnonzero(at.any(axis=1))
    between = np.flatnonzero(np.isin(force.ids, here.neighbours).all(axis=1))
    gone = [element for element in between if _is_torn(here, fans, *force.ids[element])]
    if not len(touched) and not gone:
        return
    ids, share, kept = force.ids.copy(), np.ones(len(force.ids)), np.ones(len(force.ids), bool)
    kept[gone] = False
    more: list[tuple[Ids, int, float]] = []
    for element in touched:
        node = int(at[element, 1])
        its = _bearers(here, int(ids[element, 1 - node]))
        parts = np.bincount(fans[its], here.areas[its], len(owners)) if its.any() else np.eye(len(owners))[0]
        parts /= parts.sum()
        first, *others = np.flatnonzero(parts)
        for fan in others:
            pair = ids[element].copy()
            pair[node] = owners[fan]
            more.append((pair, int(element), parts[fan]))
        ids[element, node], share[element] = owners[first], parts[first]
    source = np.flatnonzero(kept)
    pairs, numbers, parts = zip(*more, strict=True) if more else ((), (), ())
    force.remake(
        np.concatenate([ids[source], np.reshape(pairs, (-1, 2)).astype(np.int64)]),
        np.concatenate([source, np.array(numbers, np.intp)]),
        np.concatenate([share[source], parts]),
    )


def _bearers(here: Star, end: int) -> Mask:
    """The triangles of a star that bear a spring from its vertex to an end, shape (k,).

    Those that it is an edge of; else the one in which it begins, if it ends in the one next to that; else those on its
    first half, if it goes on over a neighbour. None bears what has nothing to do with the surface.
    """
    edge = (here.others == end).any(axis=1)
    if edge.any():
        return np.asarray(edge)
    reached = here.around[(here.around == end).any(axis=1)]
    across = np.array([_holds(reached, pair) for pair in here.others], bool)
    if across.any():
        return across
    return np.asarray(np.isin(here.others, reached).any(axis=1))


def _is_torn(here: Star, fans: Rows, a: int, b: int) -> bool:
    """Whether nothing bears a spring between two neighbours of a vertex any more that a cut has come between."""
    at_a, at_b = ((here.others == end).any(axis=1) for end in (a, b))
    from_a, from_b = (here.around[(here.around == end).any(axis=1)] for end in (a, b))
    if (at_a & at_b).any() or _holds(from_a, [b]):  # an edge
        return False
    tips = [(i, j) for i in np.flatnonzero(at_a) for j in np.flatnonzero(at_b) if _shared(here.others[[i, j]])]
    faces = [corners[corners != a] for corners in from_a]
    if tips or any(_holds(from_b, pair) for pair in faces):  # from triangle to triangle
        elsewhere = any(_holds(from_b, pair) for pair in faces)
        return not elsewhere and all(fans[i] != fans[j] for i, j in tips)
    common = np.intersect1d(from_a, from_b)
    over_others = common[(common != a) & (common != b)]
    return not len(over_others) and not np.intersect1d(fans[at_a], fans[at_b]).size


def _shared(pairs: Ids) -> bool:
    """Whether two pairs have an id in common."""
    return bool((pairs[0][:, None] == pairs[1]).any())


def _holds(triangles: Ids, ids: Iterable[int]) -> bool:
    """Whether one of some triangles has all these corners."""
    return bool(np.all([(triangles == corner).any(axis=1) for corner in ids], axis=0).any())
