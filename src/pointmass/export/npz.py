"""Frames as NumPy arrays in one file."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import write_array_header_1_0
from numpy.typing import NDArray

from pointmass.export.exporter import About
from pointmass.frame import Frame

Array = NDArray[Any]

PADDING: dict[str, float] = {"ids": -1, "positions": np.nan, "velocities": np.nan}


def write_npz(frames: Iterable[Frame], path: Path, about: About) -> None:
    """All frames, one row each; rows are as long as the largest frame.

    `time` [s] and `count` of shape (F,); `ids` (F, n), padded with -1; `positions` [m] and `velocities` [m/s] of shape
    (F, n, 3), padded with NaN; `quantity_<name>` (F,), NaN where a frame has none.
    """
    with tempfile.TemporaryDirectory(prefix=f".{path.stem[:32]}-", dir=path.parent) as folder:
        ragged = {name: _Ragged(Path(folder, name)) for name in PADDING}
        times: list[float] = []
        quantities: list[dict[str, float]] = []
        for frame in frames:
            times.append(frame.time)
            quantities.append(frame.quantities)
            for name, column in ragged.items():
                column.add(getattr(frame, name))
        names = dict.fromkeys(name for each in quantities for name in each)
        counts = ragged["ids"].counts
        columns = {"time": np.array(times, np.float64), "count": np.array(counts, np.int64)}
        columns |= {f"quantity_{name}": np.array([q.get(name, np.nan) for q in quantities]) for name in names}
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, values in columns.items():
                with archive.open(f"{name}.npy", "w") as file:
                    np.save(file, values)
            for name, column in ragged.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                    column.pad(file, PADDING[name])


class _Ragged:
    """Rows of different lengths, kept in a file until the longest is known."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.counts: list[int] = []
        self._first = np.zeros(0)

    def add(self, row: Array) -> None:
        """One more; the first one says what kind of number they are."""
        if not self.counts:
            self._first = row
        self.counts.append(len(row))
        with self._path.open("ab") as file:
            file.write(np.ascontiguousarray(row, self._first.dtype).tobytes())

    def pad(self, file: Any, padding: float) -> None:
        """Write them as one array in NumPy's format."""
        dtype, tail, most = self._first.dtype, self._first.shape[1:], max(self.counts)
        shape = (len(self.counts), most, *tail)
        write_array_header_1_0(file, {"descr": dtype.str, "fortran_order": False, "shape": shape})
        entries = int(np.prod(tail, dtype=int))
        filler = np.full(most * entries, padding, dtype)
        with self._path.open("rb") as rows:
            for count in self.counts:
                file.write(rows.read(count * entries * dtype.itemsize))
                file.write(filler[count * entries :].tobytes())
