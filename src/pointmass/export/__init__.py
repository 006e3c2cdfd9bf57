"""Frames for other programs. A new format is a file, a line in `EXPORTERS` and a test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from pointmass.beside import beside, check_place
from pointmass.errors import InvalidInput, unknown
from pointmass.export.meshes import WRITERS, write_meshes
from pointmass.export.npz import write_npz
from pointmass.frame import Frame
from pointmass.sequences import is_sequence

Exporter = Callable[[Sequence[Frame], Path, Callable[[int], None] | None], None]

EXPORTERS: dict[str, Exporter] = {".npz": write_npz, **dict.fromkeys(WRITERS, write_meshes)}

__all__ = ["EXPORTERS", "check_export", "export", "write_meshes", "write_npz"]


def check_export(path: str | Path) -> Exporter:
    """What writes a file of this name.

    Raises
    ------
    InvalidInput
        The suffix is not known, a % in the name is no number, or there is no folder to write into.
    """
    path = Path(path)
    if path.suffix.lower() not in EXPORTERS:
        raise unknown("kind of export", path.suffix, EXPORTERS)
    if path.suffix.lower() in WRITERS:
        is_sequence(path)
    check_place(path)
    return EXPORTERS[path.suffix.lower()]


def export(frames: Sequence[Frame], path: str | Path, progress: Callable[[int], None] | None = None) -> None:
    """Write frames to a file; its suffix says which kind. Files appear when all are complete.

    Parameters
    ----------
    frames : such as a cache.
    path : `.npz`: all frames as arrays; `.obj`, `.ply` or `.glb`: the surfaces of the last frame, or of each frame for
        a name such as `x_%04d.obj`.
    progress : called with the number of frames written so far.

    Raises
    ------
    InvalidInput
        The suffix is not known, there are no frames, a frame has no surface, or the file cannot be written.
    """
    path = Path(path)
    write = check_export(path)
    if not len(frames):
        raise InvalidInput("there are no frames to export")
    with beside(path) as part:
        write(frames, part, progress)
