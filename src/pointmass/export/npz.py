"""Frames as NumPy arrays in one file."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from pointmass.frame import Frame

Array = NDArray[Any]


def write_npz(frames: Sequence[Frame], path: Path, progress: Callable[[int], None] | None = None) -> None:
    """All frames, one row each; rows are as long as the largest frame.

    `time` [s] and `count` of shape (F,); `ids` (F, n), padded with -1; `positions` [m] and `velocities` [m/s] of shape
    (F, n, 3), padded with NaN; `quantity_<name>` (F,), NaN where a frame has none.

    Parameters
    ----------
    frames : read twice, one at a time: whole runs need not fit into memory.
    path : is written over.
    progress : called with the number of frames written so far.
    """
    counts, names = _measure(frames)
    with tempfile.TemporaryDirectory(prefix=f".{path.stem[:32]}-", dir=path.parent) as folder:
        columns = _columns(Path(folder), frames[0], counts, names)
        for k, frame in enumerate(frames):
            _fill(columns, k, frame)
            if progress is not None:
                progress(k + 1)
        for column in columns.values():
            column.flush()
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
            for name in columns:
                archive.write(Path(folder, f"{name}.npy"), f"{name}.npy")


def _measure(frames: Sequence[Frame]) -> tuple[list[int], list[str]]:
    """Particles of each frame, and the names of all quantities in the order in which they appear."""
    counts: list[int] = []
    names: dict[str, None] = {}
    for frame in frames:
        counts.append(len(frame.ids))
        names |= dict.fromkeys(frame.quantities)
    return counts, list(names)


def _columns(folder: Path, first: Frame, counts: list[int], names: list[str]) -> dict[str, Any]:
    """Arrays on disk, filled with their padding."""
    rows, most = len(counts), max(counts)
    kinds: dict[str, tuple[Any, tuple[int, ...], float]] = {
        "time": (np.float64, (rows,), 0.0),
        "count": (np.int64, (rows,), 0),
        "ids": (np.int64, (rows, most), -1),
        "positions": (first.positions.dtype, (rows, most, 3), np.nan),
        "velocities": (first.velocities.dtype, (rows, most, 3), np.nan),
        **{f"quantity_{name}": (np.float64, (rows,), np.nan) for name in names},
    }
    result: dict[str, Any] = {}
    for name, (dtype, shape, padding) in kinds.items():
        if 0 in shape:  # nothing can be mapped
            result[name] = _Empty(folder / f"{name}.npy", dtype, shape)
            continue
        result[name] = open_memmap(folder / f"{name}.npy", "w+", dtype, shape)
        result[name][:] = padding
    return result


class _Empty:
    """An array on disk without entries."""

    def __init__(self, path: Path, dtype: Any, shape: tuple[int, ...]) -> None:
        np.save(path, np.zeros(shape, dtype))

    def __setitem__(self, place: Any, value: Any) -> None:
        """There is no place to set."""

    def flush(self) -> None:
        """It is on disk."""


def _fill(columns: dict[str, Any], k: int, frame: Frame) -> None:
    n = len(frame.ids)
    columns["time"][k], columns["count"][k] = frame.time, n
    columns["ids"][k, :n] = frame.ids
    columns["positions"][k, :n] = frame.positions
    columns["velocities"][k, :n] = frame.velocities
    for name, value in frame.quantities.items():
        columns[f"quantity_{name}"][k] = value
