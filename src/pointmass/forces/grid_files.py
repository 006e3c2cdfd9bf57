"""Fields on grids, read from files: NumPy (.npz), NetCDF (.nc) and VTK image data (.vti)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, floats
from pointmass.laws.grid import Grid, Outside

Array = NDArray[np.float64]
Contents = tuple[Any, Any, Any, Any]  # values, origin, spacing, times
NAMES = ("u", "v", "w")  # of the components along x, y and z
AXES = ("time", "x", "y", "z")


def load_grid(path: str | Path, *, variables: Sequence[str] | None = None, outside: Outside = "zero") -> Grid:
    """Read a field on a regular grid.

    Parameters
    ----------
    path : `.npz` with the arrays `values` (shape as for `Grid`), `origin`, `spacing` and perhaps `times`, or with u, v
        and w in place of values; `.nc` with coordinates x, y, z and perhaps time [s], in any order, evenly spaced;
        `.vti` with a vector at each point.
    variables : names of the three components, or of the one vector, in the file; None = u, v, w, or the only vector.
    outside : what holds beyond the box: "zero", "clamp" or "wrap", see `Grid`.

    Returns
    -------
    Grid
        It remembers the path, so that a scene that uses it can be written as text.

    Raises
    ------
    InvalidInput
        No such file, a file that is cut off or of another kind, uneven spacing, a missing library, a cell that is NaN.

    Examples
    --------
    >>> pm.Wind(pm.Flow(grid=pm.load_grid("storm.nc", outside="clamp")))
    """
    file = Path(path)
    if file.suffix not in READERS:
        raise InvalidInput(f"grid file {str(path)!r} must end in {', '.join(READERS)}, not in {file.suffix!r}")
    if not file.is_file():
        raise InvalidInput(f"grid file {str(path)!r} does not exist")
    names = None if variables is None else ([variables] if isinstance(variables, str) else list(variables))
    try:
        values, origin, spacing, times = READERS[file.suffix](file, names)
        return Grid(values, origin, spacing, times, outside, path=str(path), variables=names)
    except InvalidInput as error:
        raise InvalidInput(f"grid file {str(path)!r}: {error}") from None
    except ImportError as error:
        missing = error.name or re.sub(r".*No module named '(\w+)'.*", r"\1", str(error))
        raise InvalidInput(
            f'grid file {str(path)!r} needs the library {missing}: pip install "pointmass[grids]"'
        ) from None
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, RuntimeError, TypeError) as error:
        raise InvalidInput(
            f"grid file {str(path)!r} is damaged or not what its ending says ({type(error).__name__}): write it again"
        ) from None


def as_grid(grid: Grid | str | Path | None) -> Grid | None:
    """A grid as it is, or read from its path."""
    if grid is None or isinstance(grid, Grid):
        return grid
    if isinstance(grid, (str, Path)):
        return load_grid(grid)
    raise InvalidInput(f"grid must be a Grid or the path of a file, not {type(grid).__name__}")


def _read_npz(file: Path, names: list[str] | None) -> Contents:
    data = np.load(file, allow_pickle=False)
    if isinstance(data, np.ndarray):
        raise InvalidInput("it holds one array, and a grid needs values, origin and spacing: use np.savez")
    with data:
        arrays = {name: data[name] for name in data.files}
    for name in ("origin", "spacing"):
        if name not in arrays:
            raise InvalidInput(f"it has no array {name!r}; it has {', '.join(arrays) or 'none'}")
    chosen = ["values"] if names is None and "values" in arrays else _chosen(names, arrays)
    values = _together([_pick(arrays, name) for name in chosen])
    return values, arrays["origin"], arrays["spacing"], arrays.get("times")


def _read_netcdf(file: Path, names: list[str] | None) -> Contents:
    import xarray

    with file.open("rb") as opened:
        classic = opened.read(4) in (b"CDF\x01", b"CDF\x02")  # libnetcdf reads zeros where such a file is cut off
    options: dict[str, Any] = {"engine": "scipy", "mmap": False} if classic else {}
    with xarray.open_dataset(file, decode_times=False, **options) as data:
        variables = {str(name): variable for name, variable in data.data_vars.items()}
        parts = [_ordered(_pick(variables, name)) for name in _chosen(names, variables)]
        coordinates = {axis: np.asarray(data[axis].values, np.float64) for axis in AXES if axis in data.coords}
        units = str(data["time"].attrs.get("units", "s")) if "time" in data.coords else "s"
    if units.split()[:1] not in ([], ["s"], ["seconds"], ["second"], ["sec"]):
        raise InvalidInput(f"its times are in {units!r}: give them in seconds")
    values = _together(parts)
    for axis, coordinate in coordinates.items():
        if len(coordinate) > 1 and coordinate[0] > coordinate[-1]:
            coordinates[axis] = coordinate[::-1]
            values = np.flip(values, AXES.index(axis))
    even = [_even(axis, coordinates.get(axis, np.zeros(1))) for axis in AXES[1:]]
    return values, [e[0] for e in even], [e[1] for e in even], coordinates.get("time")


def _read_vti(file: Path, names: list[str] | None) -> Contents:
    import pyvista
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(file))
    with _vtk_silenced() as complaints:
        reader.Update()
    mesh = pyvista.wrap(reader.GetOutput())
    if _cut_off(file) or "ERROR" in complaints.GetOutput() or mesh.n_points == 0:
        raise InvalidInput("it is damaged, or holds no image data")
    if not np.allclose(mesh.direction_matrix, np.eye(3)):
        raise InvalidInput("its axes are turned: resample it to axes along x, y and z")
    arrays = {name: np.asarray(mesh.point_data[name]) for name in mesh.point_data}
    vectors = [name for name, array in arrays.items() if array.ndim == 2 and array.shape[1] == 3]
    if names is None and len(vectors) == 1:
        names = vectors
    parts = [_pick(arrays, name) for name in _chosen(names, arrays)]
    shape = tuple(mesh.dimensions)
    values = _together([part.reshape(*shape, *part.shape[1:], order="F") for part in parts])
    spacing = [step if count > 1 else 1.0 for step, count in zip(mesh.spacing, shape, strict=True)]
    return values, mesh.origin, spacing, None


@contextmanager
def _vtk_silenced() -> Iterator[Any]:
    """Keep what VTK says about a file, which it reads as far as it can, in a window of text instead of on stderr."""
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    complaints, window = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkOutputWindow.SetInstance(complaints)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield complaints
    finally:
        vtkLogger.SetStderrVerbosity(verbosity)
        vtkOutputWindow.SetInstance(window)


def _cut_off(file: Path) -> bool:
    """Whether a VTK file has no end: of raw data that are cut off, VTK reads what is there and makes up the rest."""
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - 1000))
        return not opened.read().rstrip().endswith(b"</VTKFile>")


READERS: dict[str, Callable[[Path, list[str] | None], Contents]] = {
    ".npz": _read_npz,
    ".nc": _read_netcdf,
    ".vti": _read_vti,
}


def _chosen(names: list[str] | None, variables: dict[str, Any]) -> list[str]:
    """The variables that make up the vector."""
    if names is not None:
        if len(names) not in (1, 2, 3):
            raise InvalidInput(f"variables must name one vector or its components, not {len(names)} variables")
        return names
    found = [name for name in NAMES if name in variables]
    if found[:2] == ["u", "v"]:
        return found
    if len(variables) == 1:
        return list(variables)
    raise InvalidInput(
        f"it has no u, v, w: choose from {', '.join(variables) or 'none'} with load_grid(variables=[...])"
    )


def _pick(variables: dict[str, Any], name: str) -> Any:
    if name not in variables:
        raise InvalidInput(f"it has no variable {name!r}; it has {', '.join(variables) or 'none'}")
    return variables[name]


def _together(parts: list[Any]) -> Array:
    """Components as the last axis; one vector stays as it is, and a missing third component is 0."""
    arrays = [array for part in parts if (array := floats(part)) is not None]
    if len(arrays) < len(parts):
        raise InvalidInput("its values must be real numbers, not text or complex numbers")
    if len(arrays) == 1:
        return arrays[0]
    if len({a.shape for a in arrays}) > 1:
        raise InvalidInput(f"its components have different shapes: {', '.join(str(a.shape) for a in arrays)}")
    if len(arrays) == 2:
        arrays.append(np.zeros_like(arrays[0]))
    return np.stack(arrays, axis=-1)


def _ordered(variable: Any) -> Any:
    """A variable with the axes time, x, y, z in this order, and its components last, whatever the file's order."""
    others = [dim for dim in variable.dims if dim not in AXES]
    if len(others) > 1 or (others and variable.sizes[others[0]] != 3):
        names = ", ".join(map(str, variable.dims))
        raise InvalidInput(f"variable {variable.name!r} has the dimensions {names}: a grid has x, y, z, time")
    missing = [axis for axis in AXES if axis not in variable.dims]
    return variable.expand_dims(missing).transpose(*AXES, *others).values


def _even(axis: str, coordinate: Array) -> tuple[float, float]:
    """First value and spacing of an axis."""
    steps = np.diff(coordinate)
    if len(steps) == 0:
        return float(coordinate[0]) if len(coordinate) else 0.0, 1.0
    if not np.isfinite(steps).all() or np.ptp(steps) > 1e-4 * abs(steps).max():
        raise InvalidInput(f"its points along {axis} are not evenly spaced: resample it to a regular grid")
    return float(coordinate[0]), float(np.mean(steps))
