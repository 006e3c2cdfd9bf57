"""Frames for other programs. A new format is a file, a line in `EXPORTERS` and a test."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from pointmass.errors import InvalidInput, unknown
from pointmass.export.npz import write_npz
from pointmass.frame import Frame

Exporter = Callable[[Sequence[Frame], Path, Callable[[int], None] | None], None]

EXPORTERS: dict[str, Exporter] = {".npz": write_npz}

__all__ = ["EXPORTERS", "check_export", "export", "write_npz"]


def check_export(path: str | Path) -> Exporter:
    """What writes a file of this name.

    Raises
    ------
    InvalidInput
        The suffix is not known, or there is no folder to write into.
    """
    path = Path(path)
    if path.suffix.lower() not in EXPORTERS:
        raise unknown("kind of export", path.suffix, EXPORTERS)
    if not path.parent.is_dir():
        raise InvalidInput(f"cannot write {str(path)!r}: there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise InvalidInput(f"cannot write {str(path)!r}: it is a folder")
    return EXPORTERS[path.suffix.lower()]


def export(frames: Sequence[Frame], path: str | Path, progress: Callable[[int], None] | None = None) -> None:
    """Write frames to a file; its suffix says which kind. The file appears when it is complete.

    Parameters
    ----------
    frames : such as a cache.
    path : `.npz`.
    progress : called with the number of frames written so far.

    Raises
    ------
    InvalidInput
        The suffix is not known, there are no frames, or the file cannot be written.
    """
    path = Path(path)
    write = check_export(path)
    if not len(frames):
        raise InvalidInput("there are no frames to export")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.stem[:32]}-", dir=path.parent) as folder:
            part = Path(folder) / path.name
            write(frames, part, progress)
            part.replace(path)
    except OSError as error:
        raise InvalidInput(f"cannot write {str(path)!r}: {error.strerror}") from None
