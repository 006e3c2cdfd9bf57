"""Particles that come from particles: who follows whom, and which children there will be.

The paths of parents are found first, in a rehearsal that leaves no trace, step by step and generation by generation.
Then all who are born in a span are known before it is run, each with its own time and place, as if an emitter had
made them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.impacts import NO_IMPACTS, Impacts
from pointmass.collisions.swept import Paths
from pointmass.emitters.emitter import Array, Birth, Emitter, Parents
from pointmass.engine.engine import Engine
from pointmass.engine.island import Span
from pointmass.errors import InvalidInput, unknown
from pointmass.zones import Zone, killed

Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Kin:
    """Living particles of an emitter that others follow.

    Attributes
    ----------
    ids, birth, death : of each, shape (k,).
    """

    ids: NDArray[np.int64]
    birth: Array
    death: Array

    def joined(self, other: Kin) -> Kin:
        """These and others."""
        return Kin(
            np.concatenate([self.ids, other.ids]),
            np.concatenate([self.birth, other.birth]),
            np.concatenate([self.death, other.death]),
        )

    def take(self, rows: NDArray[np.bool_]) -> Kin:
        """Some of them."""
        return Kin(self.ids[rows], self.birth[rows], self.death[rows])


class Lineage:
    """Which emitters follow which, and the living particles that may have children.

    Attributes
    ----------
    order : numbers of the emitters, those that are followed before those that follow them.
    taken, spared : ids of the parents that die before their time in the span that was foreseen last, and of others that
        do not. Where particles act on each other, the newborn turn the step a little from its rehearsal: what that has
        shown is then what counts, so that who dies has children, and once.

    Raises
    ------
    InvalidInput
        An emitter follows one that does not exist, or itself by whatever detours; two have one name.
    """

    def __init__(self, emitters: Sequence[Emitter], zones: Sequence[Zone] = ()) -> None:
        self.emitters, self.zones = emitters, zones
        named = [e.name for e in emitters if e.name]
        for name in named:
            if named.count(name) > 1:
                raise InvalidInput(f"name = {name!r} is that of {named.count(name)} emitters: give each its own")
        for e in emitters:
            if e.of and e.of not in named:
                raise unknown("name of an emitter in of:", e.of, named)
        self.parent = {k: [f.name for f in emitters].index(e.of) for k, e in enumerate(emitters) if e.of}
        self.order: list[int] = []
        while len(self.order) < len(emitters):
            known = [-1, *self.order]
            ready = [k for k in range(len(emitters)) if k not in known and self.parent.get(k, -1) in known]
            if not ready:
                left = next(e.of for k, e in enumerate(emitters) if k not in known)
                raise InvalidInput(f"of = {left!r} goes round in a circle: an emitter cannot follow its own children")
            self.order += ready
        self.followed = {p: [k for k in self.parent if self.parent[k] == p] for p in set(self.parent.values())}
        nobody = Kin(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        self.kin = dict.fromkeys(self.followed, nobody)
        self.taken = self.spared = nobody.ids

    def settle(self, born: Sequence[Sequence[Birth]], t: float) -> None:
        """Know who was born, and forget who is dead by a time."""
        for k in self.kin:
            for births in born:
                self.kin[k] = self.kin[k].joined(_kin(k, births[k]))
            self.kin[k] = self.kin[k].take(self.kin[k].death > t)

    def forget(self, gone: dict[int, NDArray[np.bool_]]) -> None:
        """Forget those of each emitter that a mask marks."""
        self.kin = {k: kin.take(~gone[k]) for k, kin in self.kin.items()}

    def foresee(
        self, engine: Engine, span: Span, born: list[list[Birth]], compiled: bool, seed: int, streams: Sequence[str]
    ) -> list[list[Birth]]:
        """Who will be born in each step of a span, of each emitter.

        Parameters
        ----------
        born : the births that have no parents.
        compiled : whether parents are taken ahead by kernels.
        streams : names of the emitters, for chance.

        Raises
        ------
        Diverged
            A parent goes astray.
        """
        self.taken = self.spared = self.taken[:0]
        if not any(len(self.kin[k].ids) or any(len(step[k].number) for step in born) for k in self.kin):
            return born
        with engine.rehearsal():
            rehearsal = _Rehearsal(self, engine, span, compiled)
            for number, known in enumerate(born):
                step = replace(span, first=span.first + number, count=1)
                rehearsal.begin(step)
                stretch: dict[int, Parents] = {}
                for k in self.order:
                    if k in self.parent:
                        parents = stretch[self.parent[k]]
                        known[k] = self.emitters[k].offspring(parents, step.start, step.end, seed, streams[k])
                    if k in self.followed:
                        stretch[k] = rehearsal.stretch(k, known[k], step)
        return born


@dataclass(frozen=True, eq=False)
class _Met:
    """Where all particles come in a step, shape (n, 3), and what they meet on their way."""

    x: Array
    v: Array
    died: Rows
    impacts: Impacts


class _Rehearsal:
    """Parents on their way through a span."""

    def __init__(self, lineage: Lineage, engine: Engine, span: Span, compiled: bool) -> None:
        self.lineage, self.engine, self.span, self.compiled = lineage, engine, span, compiled
        self.system = engine.system
        self.rows = {k: self.system.particles.rows(kin.ids) for k, kin in lineage.kin.items()}
        lineage.forget({k: rows < 0 for k, rows in self.rows.items()})  # whom a hand, a zone or a surface took away
        self.kin = dict(lineage.kin)
        self.rows = {k: rows[rows >= 0] for k, rows in self.rows.items()}
        self.perilous = engine.deadly or bool(lineage.zones)
        self.met: _Met | None = None  # by everybody, where particles act on each other

    def begin(self, step: Span) -> None:
        """Find where those who are joined to others will be at the end of a step."""
        p = self.system.particles
        if self.engine.coupled:
            self.met = _Met(p.x, p.v, np.zeros(0, np.intp), NO_IMPACTS)
        if self.engine.coupled and len(p):
            with self.engine.rehearsal():
                met = self._ahead(np.arange(len(p)), np.full(len(p), step.start), step)
                self.met = replace(met, x=met.x.copy(), v=met.v.copy())

    def stretch(self, k: int, newborn: Birth, step: Span) -> Parents:
        """The particles of an emitter in a step, which is the next one for them."""
        p, alive = self.system.particles, self.kin[k].death > step.start
        old, rows = self.kin[k].take(alive), self.rows[k][alive]
        kin, count = old.joined(_kin(k, newborn)), len(rows)
        clock = np.maximum(kin.birth, step.start)
        x0 = np.concatenate([p.x[rows], newborn.x]).astype(np.float64)
        v0 = np.concatenate([p.v[rows], newborn.v]).astype(np.float64)
        still = Paths(x0, v0, x0, v0, clock, step.end - clock, np.zeros(len(clock)))
        parents = Parents(kin.ids, kin.birth, kin.death, np.arange(len(clock)) >= count, still, NO_IMPACTS, step.first)
        awaited = np.zeros(len(clock), bool)
        for follower in self.lineage.followed[k]:
            awaited |= self.lineage.emitters[follower].awaits(parents, self.span.end, self.perilous)
        rows = np.append(rows, self._added(newborn, kin.ids[count:], awaited[count:]))
        parents = self._gone(parents, rows, awaited, step)
        self.kin[k] = replace(kin, death=parents.death).take(rows >= 0)
        self.rows[k] = rows[rows >= 0]
        return parents

    def _added(self, newborn: Birth, ids: NDArray[np.int64], awaited: NDArray[np.bool_]) -> Rows:
        """Rows of the newborn, -1 for those who need not go along."""
        rows = np.full(len(awaited), -1)
        if awaited.any():
            rows[awaited] = len(self.system.particles) + np.arange(int(awaited.sum()))
            columns = {name: np.broadcast_to(c, len(awaited))[awaited] for name, c in newborn.columns.items()}
            lifetime = newborn.lifetime[awaited]
            self.system.add(newborn.x[awaited], newborn.v[awaited], lifetime=lifetime, id=ids[awaited], **columns)
        return rows

    def _gone(self, parents: Parents, rows: Rows, awaited: NDArray[np.bool_], step: Span) -> Parents:
        """Parents who have gone their ways, those that are awaited.

        The newborn on whom others act go straight, and meet nothing.
        """
        p, still, dead = self.system.particles, parents.paths, np.zeros(len(rows), bool)
        x0, v0 = still.x0, still.v0
        x1, v1 = x0 + still.h[:, None] * v0, v0.copy()
        impacts: list[Impacts] = []
        for goes, met in self._ways(rows, awaited, still.t0, step):
            x1[goes], v1[goes] = met.x[rows[goes]], met.v[rows[goes]]
            dead[goes] = np.isin(rows[goes], met.died)
            dead |= goes & killed(self.lineage.zones, x1, step.end, still.t0 < step.end)
            whose = np.full(len(p), -1)
            whose[rows[goes]] = np.flatnonzero(goes)
            mine = met.impacts.take(whose[met.impacts.rows] >= 0)
            impacts.append(replace(mine, rows=whose[mine.rows]))
        if self.system.order == 1:
            v0 = v1 = (x1 - x0) / np.where(still.h > 0, still.h, 1)[:, None]
        death = np.where(dead, np.minimum(parents.death, step.end), parents.death)
        self.lineage.taken = np.append(self.lineage.taken, parents.ids[dead])
        if self.met is not None:
            self.lineage.spared = np.append(self.lineage.spared, parents.ids[awaited & ~dead])
        return replace(parents, death=death, paths=replace(still, v0=v0, x1=x1, v1=v1), impacts=Impacts.of(impacts))

    def _ways(
        self, rows: Rows, awaited: NDArray[np.bool_], clock: Array, step: Span
    ) -> Iterator[tuple[NDArray[np.bool_], _Met]]:
        """Which parents go where: those whom everybody's step has shown, and those that go by themselves."""
        goes = awaited & (rows >= 0)
        if self.met is not None:
            known = goes & (rows < len(self.met.x))
            yield known, self.met
            goes &= ~known
            goes[goes] = self.engine.alone(rows[goes])
        if goes.any():
            births = np.full(len(self.system.particles), step.start)
            births[rows[goes]] = clock[goes]
            yield goes, self._ahead(np.sort(rows[goes]), births, step)

    def _ahead(self, rows: Rows, births: Array, step: Span) -> _Met:
        """Take some particles over a step."""
        p, engine = self.system.particles, self.engine
        engine.ahead(rows, step, births, self.compiled)
        return _Met(p.x, p.v, engine.died, engine.impacts)


def _kin(emitter: int, births: Birth) -> Kin:
    return Kin(births.ids(emitter), births.time, births.death)
