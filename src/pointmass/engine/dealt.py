"""A grid of particles dealt out to decks, so that the elements of a colour lie side by side.

The columns of a row go to decks in turn, column c to deck c % `decks`: neighbours of one colour are neighbours in a
deck, and every colour of a stencil is a few loops with constant offsets.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import lcm
from typing import Any

import numpy as np

from pointmass.engine.binding import Table, Watched
from pointmass.laws.stencils import Grid, Stencil
from pointmass.particles import Array

MOST = 8  # decks: each is a loop for every colour, and they are compiled
BYTES = 64  # the rows of a deck are a multiple of so many
# First components: how far a particle comes, place, inverse mass, where it is free.
RISE, PLACE, MASS, FREE = 0, 3, 6, 7


@dataclass(frozen=True)
class Piece:
    """Decks of corners in one loop.

    Attributes
    ----------
    first, count : of the decks.
    at : for each node the deck of the first one, and how many places further on it is.
    """

    first: int
    count: int
    at: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Colour:
    """The elements of a stencil whose rows have the same turn; those of one row follow by the turns of columns.

    Attributes
    ----------
    rows : of the box of an element.
    before : rows of the boxes of all colours before.
    """

    stencil: int
    step: int
    count: int
    turn: int
    rows: int
    before: int


class Dealt:
    """A grid dealt out to decks.

    Attributes
    ----------
    led : whether there are pins that move, which are put in place between steps.
    decks, lanes : of a row, and of a deck.
    components : of a row, of `width` numbers each.
    speed : components of the velocity.
    particle, tables : columns of the particles, and of the elements of each stencil.
    """

    def __init__(self, found: Grid, dtype: Any, projected: bool, noting: bool, led: bool) -> None:
        self.grid, self.dtype, self.led = found, np.dtype(dtype), led
        self.decks = decks_of(found)
        whole = BYTES // self.dtype.itemsize
        self.lanes = -(-found.n // (self.decks * whole)) * whole
        self.width = self.decks * self.lanes + whole  # an element may look one place beyond the last
        self.components = FREE + 9 * projected
        self.masks = {c: self.component() for c in sorted({s.box[1] for s in found.stencils})}
        self.noted = [self.component() for _ in found.stencils if noting]
        self.speed = [self.component() for _ in range(3)]
        self.particle = Columns("C", self)
        self.tables = [Columns(f"D{k}", self) for k in range(len(found.stencils))]
        self._array: Array | None = None
        self._watched = Watched()

    def component(self) -> int:
        """A new one."""
        self.components += 1
        return self.components - 1

    @property
    def constants(self) -> str:
        """Text that names the sizes."""
        row = f"ROW = {self.components} * WIDTH"
        return "\n".join([f"DECKS = {self.decks}", f"DECK = {self.lanes}", f"WIDTH = {self.width}", row, "", "", ""])

    def pieces(self, stencil: Stencil) -> Iterator[list[Piece]]:
        """The loops of each turn of columns."""
        right = stencil.turns[1]
        for turn in range(right.count):
            found: list[Piece] = []
            for deck in range(self.decks):
                if deck // right.step % right.count != turn:
                    continue
                at = tuple(((deck + c) % self.decks, (deck + c) // self.decks) for _, c in stencil.shifts)
                last = found[-1] if found else Piece(-1, 0, ())
                more = Piece(last.first, last.count + 1, last.at)
                goes_on = deck == more.first + last.count and at == tuple((d + last.count, far) for d, far in last.at)
                if goes_on and self._apart(stencil, more):
                    found[-1] = more
                else:
                    found.append(Piece(deck, 1, at))
            yield found

    def _apart(self, stencil: Stencil, piece: Piece) -> bool:
        """Whether a loop meets no number as two nodes: else it is no vector."""
        begins = [
            (row, deck * self.lanes + far) for (row, _), (deck, far) in zip(stencil.shifts, piece.at, strict=True)
        ]
        beside = [abs(a - b) for k, (row, a) in enumerate(begins) for other, b in begins[:k] if other == row]
        return bool(min(beside, default=self.width) >= piece.count * self.lanes)

    def colours(self) -> list[Colour]:
        """All colours, in order."""
        result, before = [], 0
        for k, stencil in enumerate(self.grid.stencils):
            down, rows = stencil.turns[0], stencil.box[0]
            for turn in range(down.count):
                result.append(Colour(k, down.step, down.count, turn, rows, before))
                before += rows
        return result

    def arrays(self, w: Array) -> list[Any]:
        """Room for the state of all rows, with inverse masses, masks and columns as they are now; and its columns."""
        m, n = self.grid.m, self.grid.n
        if self._array is None:
            self._array = np.zeros((m, self.components, self.width), self.dtype)
            for columns, component in self.masks.items():
                self._deal(component, np.ones((m, n - columns)))
        orders = [self.grid.members.reshape(m, n), *(stencil.own for stencil in self.grid.stencils)]
        tables = [self.particle, *self.tables]
        owned = [(get, own) for own, table in zip(orders, tables, strict=True) for get in table.getters]
        raw = [w, *(get() for get, _ in owned)]
        if self._watched.changed(raw):
            self._deal(MASS, w[self.grid.members].reshape(m, n))
            places = [component for table in tables for component in table.components]
            for (_, own), column, component in zip(owned, raw[1:], places, strict=True):
                self._deal(component, column[own])
        return [self._array.reshape(-1), np.array([n])]

    def _deal(self, component: int, values: Array) -> None:
        assert self._array is not None
        for deck in range(self.decks):
            mine = values[:, deck :: self.decks]
            begin = deck * self.lanes
            self._array[: len(mine), component, begin : begin + mine.shape[1]] = mine


class Columns(Table):
    """Columns of the elements of a stencil, as components of a row."""

    def __init__(self, name: str, dealt: Dealt) -> None:
        super().__init__(name)
        self.dealt = dealt
        self.components: list[int] = []

    def entry(self, column: int, index: str) -> str:
        while len(self.components) <= column:
            self.components.append(self.dealt.component())
        return number(self.components[column], index)


def number(component: int, place: str, rows: int = 0) -> str:
    """A number of lane `i` of a row `q`, or of one `rows` further down."""
    return f"q[{f'{rows} * ROW + ' * (rows > 0)}{component} * WIDTH + {place} + i]"


def decks_of(found: Grid) -> int:
    """How many decks put the elements of every colour side by side."""
    return lcm(*(right.step * right.count for _, right in (s.turns for s in found.stencils) if right.count > 1))


def fits(found: Grid) -> bool:
    """Whether a grid can be dealt out."""
    return decks_of(found) <= MOST
