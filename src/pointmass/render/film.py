"""Frames into films: MP4, WebM, MOV, GIF, PNG. A film is made in parts, so that a killed one is gone on with."""

from __future__ import annotations

import errno
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import chain
from pathlib import Path

from pointmass.errors import InvalidInput, unknown, whole_number
from pointmass.frame import Camera, Frame, last_of
from pointmass.lock import hidden, locked
from pointmass.render.camera import fit_camera
from pointmass.render.image import checked_size
from pointmass.render.kinds import KINDS
from pointmass.render.parts import FilmParts, Shot, Stills, make_all, save_png, something_done
from pointmass.render.style import Style
from pointmass.sequences import is_sequence

SLOWEST, FASTEST = 0.001, 1000  # frames per second
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # no room for a film
STILL = ".png"
SUFFIXES = (*KINDS, STILL)


def is_single(path: Path) -> bool:
    """Whether a file of this name is one picture, not a film nor a sequence."""
    return path.suffix.lower() == STILL and "%" not in path.name


def kept_at(path: str | Path) -> Path:
    """The folder where the parts of a film are until it is complete."""
    return hidden(Path(path), ".part")


def check_write(
    path: str | Path,
    *,
    fps: float | Fraction = 60,
    size: tuple[int, int] = (1280, 720),
    style: Style | None = None,
    processes: int = 1,
) -> tuple[Fraction, tuple[int, int]]:
    """The checked rate and size: all that `write` refuses, before any work.

    Raises
    ------
    InvalidInput : as for `write`.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise unknown("kind of picture or film", target.suffix, SUFFIXES)
    if suffix == STILL:
        is_sequence(target)
    whole_number("processes", processes, at_least=1)
    if style is not None and style.transparent and suffix in KINDS and not KINDS[suffix].alpha:
        able = ", ".join([STILL, *(name for name, kind in KINDS.items() if kind.alpha)])
        raise InvalidInput(f"transparent = True is not allowed for {suffix}, which has no alpha: write one of {able}")
    width, height = size = checked_size(size)
    if suffix in KINDS and KINDS[suffix].even and (width % 2 or height % 2):
        near = f"{width + width % 2}x{height + height % 2}"
        raise InvalidInput(f"size = {width}x{height} is not allowed: {suffix} needs even numbers, such as {near}")
    rate = _rate(fps)
    _check_place(target)
    return rate, size


def _check_place(target: Path) -> None:
    """Refuse a place where no file of this name can appear, by making one in a folder that goes at once."""
    if not target.parent.is_dir():
        raise InvalidInput(f"cannot write {str(target)!r}: there is no folder {str(target.parent)!r}")
    try:
        folder = tempfile.TemporaryDirectory(prefix=f"{kept_at(target).name}-", dir=target.parent)
    except OSError as error:
        raise InvalidInput(f"cannot write into folder {str(target.parent)!r}: {error.strerror}") from None
    with folder:
        try:
            (Path(folder.name) / target.name).touch()
        except OSError as error:
            raise InvalidInput(f"cannot write a file of the name {target.name!r}: {error.strerror}") from None
    if target.is_dir():
        raise InvalidInput(f"cannot write {str(target)!r}: it is a folder")


def write(
    frames: Iterable[Frame],
    path: str | Path,
    *,
    fps: float | Fraction = 60,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
    style: Style | None = None,
    progress: Callable[[int], None] | None = None,
    processes: int = 1,
) -> None:
    """Draw frames and write them to a file; its suffix says which kind.

    Films are made in parts of 64 pictures, which are joined in the end, so that memory holds a few pictures, and
    several processes can draw. A film of a sequence of frames, such as a cache, that is stopped or killed is gone on
    with by the same call, and has the same bytes: its parts stay in a hidden folder beside it until it is complete. Of
    numbered pictures each is there when it is complete; those that are there already and follow from the same frames,
    camera, size and style are left as they are.

    Parameters
    ----------
    frames : read once, one at a time; a sequence only as far as it is needed.
    path : `.mp4`, `.webm`, `.mov` (ProRes 4444), `.gif`, or `.png`: the last frame, or a numbered sequence for a name
        such as `x_%04d.png`.
    fps : pictures per second, from 0.001 to 1000.
    camera : what it leaves open is chosen to show all frames when they are a sequence, else the first one.
    size : width and height [pixels], even for `.mp4` and `.webm`.
    style : the look; a transparent one needs `.png`, `.webm` or `.mov`.
    progress : called with the number of frames drawn so far, after each, or after each part of several processes.
    processes : how many draw, each with its share of the threads; of a sequence that `pickle` can hand to them.

    Raises
    ------
    InvalidInput : the suffix is not known, the folder cannot be written, there are no frames, the size or the rate is
        out of range, or another process is writing this file. Of a film nothing is under its name until it is complete.
    """
    style = style or Style()
    rate, size = check_write(path, fps=fps, size=size, style=style, processes=processes)
    target = Path(path)
    whole = isinstance(frames, Sequence)
    first: Frame | None
    if isinstance(frames, Sequence):
        first = frames[0] if len(frames) else None
        camera = fit_camera(frames, camera, size) if first is not None else camera
    else:
        first = next(frames := iter(frames), None)
        camera = fit_camera([] if first is None else [first], camera, size)
        frames = chain([] if first is None else [first], frames)
    if first is None:
        raise InvalidInput("there are no frames to write")
    del first
    shot = Shot(camera=camera or Camera(), size=size, rate=rate, style=style)
    tick = progress or (lambda count: None)
    try:
        with _room(target, keep=whole) as room:
            if is_single(target):
                last = last_of(frames)
                assert last is not None
                save_png(shot.picture(last), room / target.name, shot.fingerprints().of(last))
                tick(1)
            elif target.suffix.lower() == STILL:
                make_all(Stills(shot, room, target), frames, processes, tick)
                return
            else:
                kind = KINDS[target.suffix.lower()]
                parts = make_all(FilmParts(shot, room, kind), frames, processes, tick)
                kind.join(parts, room / target.name, kind, rate, style.transparent)
            (room / target.name).replace(target)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise InvalidInput(f"cannot write {str(target)!r}: {error.strerror}") from None


@contextmanager
def _room(target: Path, keep: bool) -> Iterator[Path]:
    """A folder for what is not complete. An error leaves it if there is something in it to keep."""
    room = kept_at(target)
    with locked(target):
        if not keep:
            shutil.rmtree(room, ignore_errors=True)
        room.mkdir(exist_ok=True)
        try:
            yield room
        except BaseException:
            if not (keep and something_done(room)):
                shutil.rmtree(room, ignore_errors=True)
            raise
        shutil.rmtree(room, ignore_errors=True)


def _rate(fps: float | Fraction) -> Fraction:
    """Frames per second as a fraction with a small denominator: 29.97 becomes 30000/1001 or near it."""
    try:
        valid = SLOWEST <= fps <= FASTEST
    except TypeError:
        valid = False
    if not valid:
        raise InvalidInput(f"fps = {fps} is not allowed: it must be from {SLOWEST} to {FASTEST}")
    return Fraction(fps).limit_denominator(1001)
