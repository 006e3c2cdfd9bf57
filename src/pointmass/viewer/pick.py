"""The particle that is looked at: its numbers, its springs, and where it has been in phase space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pointmass.colors import linear
from pointmass.frame import Drawable, Frame, Ints
from pointmass.simulation import Simulation
from pointmass.viewer import shading, springs
from pointmass.viewer.columns import Columns
from pointmass.viewer.messages import Column, Inspected, vector
from pointmass.viewer.track import Track

COLOR = linear("#ffb454", 1.4)
WIDTH = 0.009  # of its springs, of the scene's size
COLUMNS = [
    *(Column(plot="phase", name=a, unit="m") for a in "xyz"),
    *(Column(plot="phase", name=f"v{a}", unit="m/s") for a in "xyz"),
]


@dataclass(frozen=True, eq=False)
class Found:
    """Where the picked particle is in a frame.

    Attributes
    ----------
    row : -1 if it is no longer there.
    sim, own : its simulation, and its row there; None for a cache.
    springs : those that end at it, as rows of the frame, shape (k, 2).
    """

    id: int
    row: int
    sim: Simulation | None
    own: int
    springs: Ints


class Pick:
    """Looks at one particle.

    Attributes
    ----------
    track : its positions and velocities since it was picked.
    """

    def __init__(self) -> None:
        self.track = Track("picked")
        self._who: tuple[int, int] | None = None  # number of its simulation, and its id

    def choose(self, frame: Frame, sims: Sequence[Simulation], row: int) -> None:
        """Look at who is in a row of a frame, or with -1 at nobody."""
        self.track.begin(COLUMNS if row >= 0 else [])
        self._who = (springs.section_of(sims, row), int(frame.ids[row])) if row >= 0 else None

    def forget(self) -> None:
        """Look at nobody."""
        self.track.begin([])
        self._who = None

    def find(self, frame: Frame, sims: Sequence[Simulation]) -> Found | None:
        """Where it is in a frame; None while nobody is picked."""
        if self._who is None:
            return None
        number, wanted = self._who
        rows: list[int] = np.flatnonzero(frame.ids == wanted).tolist()
        row = next((row for row in rows if springs.section_of(sims, row) == number), -1)
        sections = list(springs.sections(sims))
        if row < 0 or not sections:
            return Found(wanted, row, None, row, np.zeros((0, 2), np.intp))
        sim, begin = sections[number]
        return Found(wanted, row, sim, row - begin, springs.ending_at(sim, row - begin) + begin)

    def measure(self, frame: Frame, found: Found | None) -> None:
        """Take a frame into the track."""
        if found is not None and found.row >= 0:
            row = found.row
            self.track.add(frame.time, [*frame.positions[row].tolist(), *frame.velocities[row].tolist()])


def numbers(frame: Frame, columns: Columns, found: Found | None) -> Inspected | None:
    """What is known of the picked particle; None while nobody is picked."""
    if found is None:
        return None
    if found.row < 0:
        return Inspected(
            row=-1,
            id=str(found.id),
            position=(0.0, 0.0, 0.0),
            velocity=(0.0, 0.0, 0.0),
            force=None,
            mass=None,
            age=None,
            pinned=False,
            springs=0,
        )
    row, sim = found.row, found.sim
    masses = sim is not None and sim.system.order == 2
    return Inspected(
        row=row,
        id=str(found.id),
        position=vector(frame.positions[row]),
        velocity=vector(frame.velocities[row]),
        force=vector(columns.forces[row]) if masses else None,
        mass=float(columns["m"][row]) if masses else None,
        age=float(columns["age"][row]) if sim is not None else None,
        pinned=sim is not None and bool(sim.system.particles.pinned[found.own]),
        springs=len(found.springs),
    )


def drawn(frame: Frame, found: Found | None, version: int) -> list[Drawable]:
    """Its springs."""
    if found is None or not len(found.springs):
        return []
    width = WIDTH * shading.extent(frame.positions)
    return [shading.lines("springs of the picked particle", found.springs, COLOR, width, version)]
