"""Frames as a table of text."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pointmass.export.exporter import About
from pointmass.frame import Frame

COLUMNS = ("frame", "time", "id", "x", "y", "z", "vx", "vy", "vz")


def write_csv(frames: Iterable[Frame], path: Path, about: About) -> None:
    """A row for each particle of each frame: `frame`, `time` [s], `id`, `x`, `y`, `z` [m], `vx`, `vy`, `vz` [m/s].

    Numbers have all the digits that they need to be read back with the same bits.
    """
    with path.open("w", newline="", encoding="ascii") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(COLUMNS)
        for frame in frames:
            states = np.column_stack([frame.positions, frame.velocities]).tolist()
            rows.writerows(
                (frame.number, frame.time, i, *state) for i, state in zip(frame.ids.tolist(), states, strict=True)
            )
