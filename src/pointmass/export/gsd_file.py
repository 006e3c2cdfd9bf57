"""Frames as a GSD file, the format of HOOMD-blue and OVITO."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pointmass.export.exporter import About
from pointmass.export.particles import radii_and_colors, sticks
from pointmass.frame import Frame


def write_gsd(frames: Iterable[Frame], path: Path, about: About) -> None:
    """All frames: positions [m], velocities [m/s], diameters [m], and straight lines between particles as bonds.

    The schema is HOOMD's, in single precision. What it has no place for is logged: `particles/id`, `time` [s]. The box
    is a cube about the origin that holds all particles of a frame; it means nothing else.
    """
    import gsd.hoomd

    with gsd.hoomd.open(str(path), "w") as file:
        for frame in frames:
            file.append(_snapshot(frame))


def _snapshot(frame: Frame) -> object:
    import gsd.hoomd

    pairs = sticks(frame)
    side = 2.0 * max(1.0, 1.001 * float(np.abs(frame.positions).max(initial=0.0)))
    result = gsd.hoomd.Frame()
    result.configuration.step = frame.number
    result.configuration.box = [side, side, side, 0, 0, 0]
    result.particles.N = len(frame.ids)
    result.particles.types = ["particle"]
    result.particles.position = frame.positions.astype(np.float32)
    result.particles.velocity = frame.velocities.astype(np.float32)
    result.particles.diameter = 2 * radii_and_colors(frame)[0]
    result.bonds.N = len(pairs)
    result.bonds.types = ["stick"]
    result.bonds.group = pairs.astype(np.uint32)
    result.log["particles/id"] = frame.ids.astype(np.int64)
    result.log["time"] = np.array([frame.time])
    return result
