"""A run on disk: a folder in Zarr format 3 that is valid after a kill at any moment."""

from __future__ import annotations

import hashlib
import math
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from pointmass.cache.checks import check_frame
from pointmass.cache.drawables import folder_of, read_drawable, write_drawable
from pointmass.cache.groups import (
    METADATA,
    Array,
    Damaged,
    packed,
    read_attributes,
    read_group,
    stated_attributes,
    unpacked,
    write_attributes,
    write_group,
)
from pointmass.cache.provenance import Making
from pointmass.errors import InvalidInput, number, shown
from pointmass.frame import Camera, Drawable, Frame
from pointmass.lock import hidden

if TYPE_CHECKING:
    from pointmass.scene import Scene

FORMAT = "pointmass cache"
VERSION = 2
CHECKPOINTS = "checkpoints"
LIBRARIES = ("numpy", "scipy", "numba", "zarr")


class Cache(Sequence[Frame]):
    """The frames of a run, in a folder that other programs can read with zarr alone.

    The root's attributes say what the run was: scene (TOML), scene_hash, seed, dt [s], fps [1/s], solver, dtype,
    camera, versions. `frames/000000` holds `ids`, `positions` [m], `velocities` [m/s] and the attributes number,
    time [s], quantities, made_by (the hash of what it follows from) and drawables, as pairs of name and version;
    `drawables/<name>/<version>` holds what there is to see, once; `checkpoints/<step>` the whole state at a step. Each
    group is written beside and renamed into place, and a frame after all that it refers to: at any moment the folder is
    a valid cache of the frames that are complete.

    Attributes
    ----------
    path : of the folder.
    attributes : what the run was.

    Examples
    --------
    >>> cache = pm.record(sim, "swing.zarr", frames=240, fps=60)
    >>> pm.Cache.open("swing.zarr")[100].positions
    """

    def __init__(self, path: Path, attributes: dict[str, Any], count: int) -> None:
        self.path = path
        self.attributes = attributes
        self._count = count
        self._seen: dict[str, Drawable] = {}

    @classmethod
    def create(
        cls,
        path: str | Path,
        scene: Scene | None = None,
        *,
        fps: float = 60.0,
        camera: Camera | None = None,
        overwrite: bool = False,
        making: Making | None = None,
        **about: Any,
    ) -> Cache:
        """A new cache without frames.

        Parameters
        ----------
        path : of the folder; the one that holds it must exist.
        scene : that is run; it is stored as text, unless it holds laws written in Python.
        fps : frames per second of simulated time.
        camera : for pictures of these frames; the scene's by default.
        overwrite : whether a cache that is there already goes.
        making : what its frames follow from.
        about : what else is worth knowing, as it can stand in JSON: seed, dt, solver.

        Raises
        ------
        InvalidInput
            The place cannot be written, or something is there that must not go.
        """
        path = Path(path)
        check_target(path, overwrite)
        attributes = attributes_of(path, scene, fps, camera, making, about)
        if path.exists():
            with suppress(InvalidInput):  # it is damaged, or of another version
                cache = cls.open(path)
                cache.cut(0, attributes)
                return cache
        try:
            _make(path, attributes)
        except OSError as error:
            raise InvalidInput(f"cannot write the cache {str(path)!r}: {error.strerror}") from None
        return cls(path, attributes, 0)

    @classmethod
    def open(cls, path: str | Path) -> Cache:
        """The cache in a folder.

        Raises
        ------
        InvalidInput
            There is none, or frames are missing from it.
        """
        path = Path(path)
        if not path.is_dir():
            raise InvalidInput(f"cannot read the cache {str(path)!r}: there is no such folder")
        stated = stated_attributes(path)
        if stated.get("format") != FORMAT:
            raise InvalidInput(f"{str(path)!r} is not a pointmass cache: make one with pointmass run")
        if stated.get("version") != VERSION:
            raise InvalidInput(
                f"the cache {str(path)!r} has version {shown(stated.get('version'))}:"
                f" this pointmass reads version {VERSION}; run the scene again"
            )
        try:
            attributes = read_attributes(path)
            numbers = sorted(int(f.name) for f in (path / "frames").iterdir() if f.name.isdecimal())
            number("fps", attributes["fps"], above=0)
            camera_of(attributes)
        except (Damaged, OSError, KeyError, TypeError, ValueError, AttributeError, RecursionError):
            raise InvalidInput(f"the cache {str(path)!r} is damaged: run the scene again") from None
        for k, found in enumerate(numbers):
            if k != found:
                raise InvalidInput(f"the cache {str(path)!r} is damaged: frame {k} is missing; run the scene again")
        return cls(path, attributes, len(numbers))

    def append(self, frame: Frame) -> None:
        """Add a frame at the end.

        Raises
        ------
        InvalidInput
            It cannot be written, such as on a full disk. The frames before it stay.
        """
        attributes = {
            "place": self._count,
            "number": frame.number,
            "time": packed(frame.time),
            "quantities": {name: packed(value) for name, value in frame.quantities.items()},
            "made_by": self.attributes.get("made_by"),
            "drawables": [[d.name, d.version] for d in frame.drawables],
        }
        arrays = {
            "ids": np.asarray(frame.ids),
            "positions": np.asarray(frame.positions),
            "velocities": np.asarray(frame.velocities),
        }
        try:
            for drawable in frame.drawables:
                write_drawable(self.path, drawable)
            write_group(self._folder(self._count), attributes, arrays)
        except OSError as error:
            raise InvalidInput(
                f"cannot write frame {self._count} of the cache {str(self.path)!r}: {error.strerror}"
            ) from None
        self._count += 1

    def keep_state(self, state: Mapping[str, Array]) -> None:
        """Add a checkpoint: all that the rest of the run depends on, see `Simulation.state`.

        Raises
        ------
        InvalidInput
            It cannot be written.
        """
        checkpoints = self.path / CHECKPOINTS
        steps, frames = (int(k) for k in state["steps"][:2])
        folder = checkpoints / f"{steps:09d}"
        if folder.is_dir():
            return
        attributes = {"step": steps, "frames": frames, "time": steps * float(state["times"][1])}
        try:
            if not checkpoints.is_dir():
                write_group(checkpoints, {}, {})
            write_group(folder, attributes | {"made_by": self.attributes.get("made_by")}, state)
        except OSError as error:
            raise InvalidInput(f"cannot write a checkpoint of the cache {str(self.path)!r}: {error.strerror}") from None

    def state(self, before: float = math.inf) -> dict[str, Array] | None:
        """The latest checkpoint that no frame is missing for, at a time before another [s]; None if there is none."""
        for folder in self._checkpoints():
            try:
                attributes = read_attributes(folder)
                fits = attributes["frames"] <= len(self) and attributes["time"] < before
                if fits and attributes["step"] == int(folder.name):
                    return read_group(folder)[1]
            except (Damaged, KeyError, TypeError):
                continue  # an earlier one will do
        return None

    def cut(self, count: int, attributes: dict[str, Any]) -> None:
        """Keep so many frames from the start on, with other attributes, and what belongs to them; valid at any moment.

        Raises
        ------
        InvalidInput
            The folder cannot be written.
        """
        try:
            while self._count > count:
                self._count -= 1
                _removed(self._folder(self._count))
            for folder in self._checkpoints():
                if not _before(folder, count):
                    _removed(folder)
            seen = {folder_of(self.path, *pair) for k in range(count) for pair in self._drawn(k)}
            for folder in (self.path / "drawables").glob("*/*"):
                if folder.is_dir() and folder not in seen:
                    _removed(folder)
            self.describe(attributes)
        except (OSError, Damaged) as error:
            raise InvalidInput(f"cannot write the cache {str(self.path)!r}: {error}") from None

    def describe(self, attributes: dict[str, Any]) -> None:
        """Have other attributes."""
        write_attributes(self.path, attributes)
        self.attributes = attributes

    def __getstate__(self) -> dict[str, Any]:
        """What another process needs: not the drawables that were seen last."""
        return {**self.__dict__, "_seen": {}}

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(k) for k in range(len(self)))

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> list[Frame]: ...
    def __getitem__(self, k: int | slice) -> Frame | list[Frame]:
        if isinstance(k, slice):
            return [self.frame(j) for j in range(*k.indices(len(self)))]
        if not -len(self) <= k < len(self):
            raise IndexError(f"frame {k} of {len(self)}")
        return self.frame(k % len(self))

    def frame(self, k: int) -> Frame:
        """Frame k, counted from 0, with the bits that it had; a drawable that did not change is the same object.

        Raises
        ------
        InvalidInput
            There is no such frame, or it is damaged.
        """
        if not 0 <= k < len(self):
            raise InvalidInput(
                f"frame = {k} is not allowed: the cache {str(self.path)!r} has {len(self)} frames, counted from 0"
            )
        try:
            attributes, arrays = read_group(self._folder(k))
            if attributes["place"] != k:
                raise Damaged("it is another frame")
            drawables = tuple(self._drawable(name, version) for name, version in attributes["drawables"])
            self._seen = {d.name: d for d in drawables}
            frame = Frame(
                number=attributes["number"],
                time=unpacked(attributes["time"]),
                ids=arrays["ids"],
                positions=arrays["positions"],
                velocities=arrays["velocities"],
                drawables=drawables,
                quantities={name: unpacked(value) for name, value in attributes["quantities"].items()},
            )
            check_frame(frame)
            return frame
        except (Damaged, KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
            raise InvalidInput(
                f"frame {k} of the cache {str(self.path)!r} cannot be read: {error}; run the scene again"
            ) from None

    @property
    def scene(self) -> Scene | None:
        """The scene that was run, or None if it was not stored."""
        from pointmass.scene import Scene

        text = self.attributes.get("scene")
        return None if text is None else Scene.from_toml(text)

    @property
    def camera(self) -> Camera:
        """The camera for pictures; what it leaves open is found from the frames."""
        return camera_of(self.attributes)

    @property
    def fps(self) -> float:
        """Frames per second of simulated time."""
        return float(self.attributes["fps"])

    def _folder(self, k: int) -> Path:
        return self.path / "frames" / f"{k:06d}"

    def _checkpoints(self) -> list[Path]:
        """Folders of the checkpoints, the latest first."""
        folder = self.path / CHECKPOINTS
        return sorted((f for f in folder.iterdir() if f.name.isdecimal()), reverse=True) if folder.is_dir() else []

    def _drawn(self, k: int) -> list[tuple[str, int]]:
        """Names and versions of the drawables of a frame."""
        return [(name, version) for name, version in read_attributes(self._folder(k))["drawables"]]

    def _drawable(self, name: str, version: int) -> Drawable:
        seen = self._seen.get(name)
        return seen if seen is not None and seen.version == version else read_drawable(self.path, name, version)


def camera_of(attributes: dict[str, Any]) -> Camera:
    """The camera in a cache's attributes."""
    return Camera(**{name: unpacked(value) for name, value in attributes["camera"].items()})


def attributes_of(
    path: Path, scene: Scene | None, fps: float, camera: Camera | None, making: Making | None, about: Mapping[str, Any]
) -> dict[str, Any]:
    """The attributes of a cache: see `Cache.create`."""
    text = _text(scene)
    camera = camera or (scene.camera if scene is not None else Camera())
    return {
        "format": FORMAT,
        "version": VERSION,
        "scene": text,
        "scene_hash": None if text is None else hashlib.sha256(text.encode()).hexdigest(),
        "name": path.stem if scene is None else scene.name,
        "fps": number("fps", fps, above=0, unit="1/s"),
        **about,
        **({} if making is None else making.attributes()),
        "camera": {name: packed(value) for name, value in asdict(camera).items()},
        "versions": {"pointmass": _own_version(), **{library: version(library) for library in LIBRARIES}},
    }


def check_target(path: Path, overwrite: bool) -> None:
    """Refuse a place for a cache before anything is computed or written.

    Raises
    ------
    InvalidInput
        One sentence: no such folder, it cannot be written, or something is there that is no cache.
    """
    if not path.parent.is_dir():
        raise InvalidInput(f"cannot write the cache {str(path)!r}: there is no folder {str(path.parent)!r}")
    if path.exists() or path.is_symlink():
        if stated_attributes(path).get("format") != FORMAT:
            raise InvalidInput(f"cannot write the cache {str(path)!r}: something else is there; give another name")
        if not overwrite:
            raise InvalidInput(f"the cache {str(path)!r} is there already: give another name, or overwrite=True")
    try:
        Path(tempfile.mkdtemp(prefix=f".{path.name[:32]}-", dir=path.parent)).rmdir()
    except OSError as error:
        raise InvalidInput(f"cannot write into folder {str(path.parent)!r}: {error.strerror}") from None


def sweep(path: Path) -> None:
    """Take away what processes that were killed have left of a cache half written or half removed."""
    shutil.rmtree(hidden(path, ".new"), ignore_errors=True)
    for folder in (path / "frames", path / CHECKPOINTS, path / "drawables", *path.glob("drawables/*")):
        for left in folder.glob(".*"):
            shutil.rmtree(left, ignore_errors=True)


def _make(path: Path, attributes: dict[str, Any]) -> None:
    """An empty cache, in place of what was there."""
    beside = hidden(path, ".new")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        new = beside / "new"
        beside.mkdir()
        for folder, what in ((new, attributes), (new / "frames", {}), (new / "drawables", {})):
            write_group(folder, what, {})
        if path.exists():
            path.rename(beside / "old")
        new.rename(path)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _before(checkpoint: Path, count: int) -> bool:
    """Whether a checkpoint can be read and no more than `count` frames come before it."""
    try:
        return int(read_attributes(checkpoint)["frames"]) <= count
    except (Damaged, KeyError, TypeError, ValueError):
        return False


def _removed(folder: Path) -> None:
    """Take a group away: at once for all who look, then its files."""
    gone = folder.with_name(f".{folder.name}.gone")
    shutil.rmtree(gone, ignore_errors=True)  # of a process that was killed
    folder.rename(gone)
    (gone / METADATA).unlink(missing_ok=True)  # first: what a kill leaves behind is no group
    shutil.rmtree(gone)


def _text(scene: Scene | None) -> str | None:
    try:
        return None if scene is None else scene.to_toml()
    except InvalidInput:
        return None  # a law written in Python has no text; the frames do not need it


def _own_version() -> str:
    from pointmass import __version__

    return __version__
