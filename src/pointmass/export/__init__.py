"""Frames for other programs. A new format is a file, a line in `EXPORTERS` and a test."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from pointmass.beside import beside, check_place
from pointmass.errors import InvalidInput, unknown
from pointmass.export.exporter import About, Exporter
from pointmass.export.glb import write_glb
from pointmass.export.gsd_file import write_gsd
from pointmass.export.meshes import write_obj
from pointmass.export.npz import write_npz
from pointmass.export.ply import write_ply
from pointmass.export.table import write_csv
from pointmass.export.usd import write_usd
from pointmass.export.vtkhdf import write_vtkhdf
from pointmass.export.vtp import write_pvd, write_vtp
from pointmass.frame import Frame, last_of
from pointmass.libraries import check_library
from pointmass.sequences import is_sequence

EXPORTERS: dict[str, Exporter] = {
    ".npz": Exporter(write=write_npz),
    ".csv": Exporter(write=write_csv),
    ".usd": Exporter(write=write_usd),
    ".usdc": Exporter(write=write_usd),
    ".usda": Exporter(write=write_usd),
    ".pvd": Exporter(write=write_pvd),
    ".vtkhdf": Exporter(write=write_vtkhdf, ahead=True),
    ".vtp": Exporter(write=write_vtp, still=True),
    ".gsd": Exporter(write=write_gsd),
    ".ply": Exporter(write=write_ply, still=True),
    ".obj": Exporter(write=write_obj, still=True),
    ".glb": Exporter(write=write_glb),
}

__all__ = ["EXPORTERS", "About", "Exporter", "check_export", "export"]


def check_export(path: str | Path) -> Exporter:
    """What writes a file of this name.

    Raises
    ------
    InvalidInput
        The suffix is not known, its library is not installed, a % in the name is no number, or there is no folder to
        write into.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in EXPORTERS:
        raise unknown("kind of export", path.suffix, EXPORTERS)
    check_library("writing", suffix)
    is_sequence(path)
    check_place(path)
    return EXPORTERS[suffix]


def export(
    frames: Iterable[Frame],
    path: str | Path,
    progress: Callable[[int], None] | None = None,
    about: About | None = None,
) -> None:
    """Write frames to a file; its suffix says which kind. Files appear when all are complete.

    Parameters
    ----------
    frames : such as a cache, or `sim.frames(240)` while it runs; each is read once and then let go.
    path : `.npz`, `.csv`, `.usd`, `.pvd`, `.vtkhdf`, `.gsd`, `.glb`: all frames; `.vtp`, `.ply`, `.obj`: the last one.
        A name such as `x_%04d.ply` makes a file of any kind for each frame.
    progress : called with the number of frames written so far.
    about : what frames do not say: the frame rate and the camera, which `.usd` keeps.

    Raises
    ------
    InvalidInput
        The suffix is not known, its library is not installed, there are no frames, or the file cannot be written; or
        it is a `.vtkhdf`, and the frames are not a sequence, such as a cache or a list.

    Examples
    --------
    >>> export(pm.Cache.open("swing.zarr"), "swing.usd")
    """
    path = Path(path)
    exporter = check_export(path)
    about = about or About(name=path.stem)
    if exporter.still and not is_sequence(path):
        last = last_of(frames)
        frames = [] if last is None else [last]
    if exporter.ahead and not is_sequence(path):
        about = replace(about, times=_times(frames, path.suffix))
    with beside(path) as part:
        counted = _counted(frames, progress)
        if is_sequence(path):
            for frame in counted:
                exporter.write([frame], part.with_name(part.name % frame.number), replace(about, times=(frame.time,)))
        else:
            exporter.write(counted, part, about)


def _times(frames: Iterable[Frame], suffix: str) -> tuple[float, ...]:
    if not isinstance(frames, Sequence):
        raise InvalidInput(f"a {suffix} file begins with the times of all its frames: record a cache, and export that")
    return tuple(frame.time for frame in frames)


def _counted(frames: Iterable[Frame], progress: Callable[[int], None] | None) -> Iterator[Frame]:
    """The frames; when the next one is asked for, one more was written."""
    count = 0
    for frame in frames:
        yield frame
        count += 1
        if progress is not None:
            progress(count)
    if not count:
        raise InvalidInput("there are no frames to export")
