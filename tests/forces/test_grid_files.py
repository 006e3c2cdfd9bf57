"""Grids from files, sound and broken."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.forces import Field, Flow, load_grid
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

RNG = np.random.default_rng(9)
VALUES = RNG.standard_normal((3, 4, 5, 3))
MOVING = RNG.standard_normal((2, 3, 4, 5, 3))
ORIGIN, SPACING = (-1.0, 0.5, 2.0), (0.5, 0.25, 1.0)
AXES = {name: o + s * np.arange(n) for name, o, s, n in zip("xyz", ORIGIN, SPACING, (3, 4, 5), strict=True)}


def write_npz(path, **arrays):
    np.savez(path, **arrays)
    return str(path)


def write_netcdf(path, dims="xyz", values=VALUES, coordinates=AXES, names="uvw", **attributes):
    xarray = pytest.importorskip("xarray")
    order = ["time", *"xyz"] if values.ndim == 5 else list("xyz")
    coordinates = {k: v for k, v in coordinates.items() if k in order}
    if values.ndim == 5:
        coordinates = coordinates | {"time": ("time", [0.0, 2.0], attributes)}
    arrays = {n: xarray.DataArray(values[..., k], dims=order).transpose(*dims) for k, n in enumerate(names)}
    xarray.Dataset(arrays, coordinates).to_netcdf(path)
    return str(path)


def write_vti(path, **arrays):
    pyvista = pytest.importorskip("pyvista")
    image = pyvista.ImageData(dimensions=(3, 4, 5), origin=ORIGIN, spacing=SPACING)
    for name, array in (arrays or {"wind": VALUES}).items():
        image.point_data[name] = array.reshape(60, -1, order="F") if array.ndim == 4 else array.ravel(order="F")
    image.save(path)
    return str(path)


def write_classic(path):
    xarray = pytest.importorskip("xarray")
    arrays = {n: (("x", "y", "z"), VALUES[..., k]) for k, n in enumerate("uvw")}
    xarray.Dataset({}, AXES).assign(arrays).to_netcdf(path, engine="scipy")
    return str(path)


def write_raw_vti(path):
    """As ParaView writes: the numbers themselves after the XML."""
    pytest.importorskip("pyvista")
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLImageDataWriter

    reader, writer = vtkXMLImageDataReader(), vtkXMLImageDataWriter()
    reader.SetFileName(write_vti(path))
    writer.SetInputConnection(reader.GetOutputPort())
    writer.SetFileName(str(path.with_name("raw.vti")))
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.Write()
    return str(path.with_name("raw.vti"))


def same(grid, values=VALUES):
    np.testing.assert_array_equal(grid.values.reshape(values.shape), values)
    np.testing.assert_allclose(grid.origin, ORIGIN)
    np.testing.assert_allclose(grid.spacing, SPACING)


def test_npz(tmp_path):
    path = write_npz(tmp_path / "wind.npz", values=VALUES, origin=ORIGIN, spacing=SPACING)
    grid = load_grid(path, outside="clamp")
    same(grid)
    assert (grid.path, grid.outside, grid.variables) == (path, "clamp", None)
    u, v, w = np.moveaxis(VALUES, -1, 0)
    same(load_grid(write_npz(tmp_path / "uvw.npz", u=u, v=v, w=w, origin=ORIGIN, spacing=SPACING)))
    moving = load_grid(write_npz(tmp_path / "t.npz", values=MOVING, origin=ORIGIN, spacing=SPACING, times=[0, 2]))
    same(moving, MOVING)
    assert moving.times.tolist() == [0, 2]


@pytest.mark.parametrize("dims", ["xyz", "zyx", "yxz"])
def test_netcdf_in_any_order(tmp_path, dims):
    same(load_grid(write_netcdf(tmp_path / "wind.nc", dims)))


def test_classic_netcdf(tmp_path):
    same(load_grid(write_classic(tmp_path / "classic.nc")))


def test_netcdf_with_time_falling_axes_and_other_names(tmp_path):
    moving = load_grid(write_netcdf(tmp_path / "moving.nc", ["z", "time", "x", "y"], MOVING, units="s"))
    same(moving, MOVING)
    assert moving.times.tolist() == [0, 2]
    falling = AXES | {"y": AXES["y"][::-1]}
    same(load_grid(write_netcdf(tmp_path / "falling.nc", values=VALUES[:, ::-1], coordinates=falling)))
    path = write_netcdf(tmp_path / "abc.nc", names="abc")
    grid = load_grid(path, variables=["c", "b", "a"])
    same(grid, VALUES[..., ::-1])
    assert grid.variables == ("c", "b", "a")
    with pytest.raises(InvalidInput, match="choose from a, b, c"):
        load_grid(path)


def test_netcdf_of_a_plane(tmp_path):
    xarray = pytest.importorskip("xarray")
    u = xarray.DataArray(VALUES[:, :, 0, 0], dims=["x", "y"])
    data = xarray.Dataset({"u": u, "v": 2 * u}, {"x": AXES["x"], "y": AXES["y"]})
    data.to_netcdf(tmp_path / "plane.nc")
    grid = load_grid(tmp_path / "plane.nc")
    assert grid.shape == (3, 4, 1)
    np.testing.assert_array_equal(grid.values[0, :, :, 0], VALUES[:, :, 0, :1] * [1, 2, 0])


def test_vti(tmp_path):
    same(load_grid(write_vti(tmp_path / "wind.vti")))
    path = write_vti(tmp_path / "two.vti", wind=VALUES, other=2 * VALUES, height=VALUES[..., 0])
    same(load_grid(path, variables="wind"))
    with pytest.raises(InvalidInput, match=r"load_grid\(variables"):
        load_grid(path)


def test_in_a_force_by_its_path(tmp_path):
    path = write_npz(tmp_path / "wind.npz", values=VALUES, origin=ORIGIN, spacing=SPACING)
    corner = Particles([[*ORIGIN]])
    for force in (Flow(grid=path), Field(grid=path, scale=2.0), Field(grid=load_grid(path), scale=2.0)):
        system = ParticleSystem(corner, [force])
        system.deriv_eval()
        np.testing.assert_allclose(corner.f[0], (2 if force.order == 2 else 1) * VALUES[0, 0, 0])
    assert Flow(grid=path).arguments == {"grid": path}


def test_uneven_axes(tmp_path):
    uneven = AXES | {"z": np.array([0.0, 1, 2, 3, 9])}
    with pytest.raises(InvalidInput, match="along z are not evenly spaced"):
        load_grid(write_netcdf(tmp_path / "uneven.nc", coordinates=uneven))


def test_times_in_other_units(tmp_path):
    with pytest.raises(InvalidInput, match="give them in seconds"):
        load_grid(write_netcdf(tmp_path / "h.nc", ["time", *"xyz"], MOVING, units="hours since 2020-01-01"))


def test_nan_names_its_cell(tmp_path):
    bad = VALUES.copy()
    bad[2, 1, 3, 0] = np.nan
    with pytest.raises(InvalidInput, match=r"cell \(2, 1, 3\) is nan"):
        load_grid(write_npz(tmp_path / "bad.npz", values=bad, origin=ORIGIN, spacing=SPACING))


WRITERS = {
    "npz": lambda path: write_npz(path, values=VALUES, origin=ORIGIN, spacing=SPACING),
    "nc": write_netcdf,
    "classic.nc": write_classic,
    "vti": write_vti,
    "raw.vti": write_raw_vti,
}


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("part", [0.0, 0.3, 0.9, 0.98])
def test_cut_off_or_another_kind_of_file(tmp_path, kind, part):
    suffix = f".{kind.split('.')[-1]}"
    whole = Path(WRITERS[kind](tmp_path / f"whole{suffix}"))
    same(load_grid(whole))
    data = whole.read_bytes()
    broken = tmp_path / f"broken{suffix}"
    broken.write_bytes(data[: int(part * len(data))])
    with pytest.raises(InvalidInput) as error:
        load_grid(broken)
    assert str(broken) in str(error.value)
    assert "\n" not in str(error.value)
    broken.write_text("this is not a grid")
    with pytest.raises(InvalidInput):
        load_grid(broken)


@pytest.mark.parametrize("kind", WRITERS)
def test_libraries_say_nothing_on_stderr(tmp_path, kind):
    """They write to the file of the process, or make loggers, so a test in this process would miss it."""
    suffix = f".{kind.split('.')[-1]}"
    data = Path(WRITERS[kind](tmp_path / f"whole{suffix}")).read_bytes()
    (tmp_path / f"cut{suffix}").write_bytes(data[: len(data) // 2])
    (tmp_path / f"text{suffix}").write_text("this is not a grid")
    (tmp_path / f"empty{suffix}").write_bytes(b"")
    code = """if True:
        import sys, pointmass as pm
        for path in sys.argv[1:]:
            try:
                pm.load_grid(path)
            except pm.InvalidInput as error:
                print(error, file=sys.stderr)
    """
    paths = [str(tmp_path / f"{name}{suffix}") for name in ("cut", "text", "empty")]
    done = subprocess.run([sys.executable, "-c", code, *paths], capture_output=True, text=True, check=True)
    lines = done.stderr.splitlines()
    assert len(lines) == 3, done.stderr
    assert all(line.startswith(f"grid file {path!r}") for line, path in zip(lines, paths, strict=True))


@pytest.mark.parametrize(
    ("arrays", "hint"),
    [
        ({"values": VALUES}, "no array 'origin'"),
        ({"origin": ORIGIN, "spacing": SPACING}, "it has no u, v, w"),
        (
            {"u": VALUES[..., 0], "v": VALUES[:2, ..., 0], "w": VALUES[..., 0], "origin": ORIGIN, "spacing": SPACING},
            "different shapes",
        ),
        ({"values": VALUES, "origin": ORIGIN, "spacing": 0.0}, "above 0"),
        ({"values": np.array([{}]), "origin": ORIGIN, "spacing": 1.0}, "damaged"),
        ({"values": VALUES + 1j, "origin": ORIGIN, "spacing": 1.0}, "must be real numbers"),
        ({"values": VALUES.astype(str), "origin": ORIGIN, "spacing": 1.0}, "must be real numbers"),
        ({"values": VALUES.astype("M8[s]"), "origin": ORIGIN, "spacing": 1.0}, "must be real numbers"),
        ({"u": VALUES[..., 0] + 1j, "v": VALUES[..., 0], "origin": ORIGIN, "spacing": 1.0}, "must be real numbers"),
        ({"values": VALUES, "origin": np.array([1j, 0, 0]), "spacing": 1.0}, "origin of the grid must be numbers"),
        ({"values": VALUES, "origin": ORIGIN, "spacing": np.array(1j)}, "spacing of the grid must be numbers"),
        ({"values": VALUES[None], "origin": ORIGIN, "spacing": 1.0, "times": ["0"]}, "times of the grid must be"),
    ],
)
def test_npz_that_does_not_fit(tmp_path, arrays, hint):
    with pytest.raises(InvalidInput, match=hint):
        load_grid(write_npz(tmp_path / "odd.npz", **arrays))


def test_paths(tmp_path):
    with pytest.raises(InvalidInput, match="does not exist"):
        load_grid(tmp_path / "none.npz")
    with pytest.raises(InvalidInput, match=r"must end in .npz, .nc, .vti, not in '.csv'"):
        load_grid("wind.csv")
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(InvalidInput, match="does not exist"):
        load_grid(tmp_path / "folder.npz")
    np.save(tmp_path / "one", VALUES)
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    with pytest.raises(InvalidInput, match=r"np\.savez"):
        load_grid(tmp_path / "one.npz")


@pytest.mark.parametrize(("suffix", "library"), [(".nc", "xarray"), (".vti", "pyvista")])
def test_a_library_that_is_not_installed(tmp_path, monkeypatch, suffix, library):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / f"wind{suffix}").write_text("")
    with pytest.raises(InvalidInput, match=rf'needs the library {library}: pip install "pointmass\[grids\]"'):
        load_grid(tmp_path / f"wind{suffix}")
