"""Pictures of frames in parts of `PART`, each of which is done once: by whichever process, and whatever was killed."""

from __future__ import annotations

import multiprocessing
import os
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Frame
from pointmass.render.fingerprint import LETTERS, Fingerprints, together
from pointmass.render.image import image
from pointmass.render.kinds import Encoder, Kind, Picture
from pointmass.render.style import Style

PART = 64  # frames: what a kill costs; a film can be cut between them
KEY = "pointmass"  # of the text in a picture that says what it follows from

Tick = Callable[[], None]


@dataclass(frozen=True, kw_only=True)
class Shot:
    """How frames are taken.

    Attributes
    ----------
    camera : whose position and target are known.
    size : of the pictures [pixels].
    rate : pictures a second.
    """

    camera: Camera
    size: tuple[int, int]
    rate: Fraction
    style: Style

    def picture(self, frame: Frame) -> Picture:
        """The picture of a frame."""
        return image(frame, camera=self.camera, size=self.size, style=self.style)

    def fingerprints(self) -> Fingerprints:
        """Of its pictures."""
        from pointmass import __version__

        return Fingerprints(__version__, self)


class Parts(ABC):
    """Makes parts; processes get copies of it."""

    def __init__(self, shot: Shot, room: Path) -> None:
        self.shot, self._room = shot, room

    @abstractmethod
    def make(self, first: int, frames: Iterable[Frame], tick: Tick) -> list[Path]:
        """Draw a part; returns its files.

        Parameters
        ----------
        first : number of its first picture.
        frames : `PART` of them, or fewer for the last part; read once.
        tick : called after each.
        """

    def found(self, first: int, frames: Iterable[Frame]) -> list[Path]:
        """The files of a part that is there and follows from these frames; none if it must be made."""
        return []


class Stills(Parts):
    """Numbered PNG files. Each says what it follows from, and stays if that has not changed."""

    def __init__(self, shot: Shot, room: Path, path: Path) -> None:
        super().__init__(shot, room)
        self._path = path

    def make(self, first: int, frames: Iterable[Frame], tick: Tick) -> list[Path]:
        prints, files = self.shot.fingerprints(), list[Path]()
        with _Behind() as behind:
            for frame in frames:
                place = self._path.with_name(self._path.name % frame.number)
                key = prints.of(frame)
                if _key_of(place) != key:
                    behind.do(self._save, self.shot.picture(frame), place, key)
                files.append(place)
                tick()
        return files

    def _save(self, picture: Picture, place: Path, key: str) -> None:
        beside = self._room / f"{place.name}.{os.getpid()}"
        save_png(picture, beside, key)
        beside.replace(place)


class FilmParts(Parts):
    """Files of encoded pictures in a folder, named by their first number and what they follow from."""

    def __init__(self, shot: Shot, room: Path, kind: Kind) -> None:
        super().__init__(shot, room)
        self._kind = kind

    def make(self, first: int, frames: Iterable[Frame], tick: Tick) -> list[Path]:
        prints, keys = self.shot.fingerprints(), list[str]()
        beside = self._room / f"{_begin(first)}{os.getpid()}{self._kind.part}"
        encoder = Encoder(beside, self._kind, self.shot.size, self.shot.rate, self.shot.style.transparent)
        try:
            with _Behind() as behind:
                for frame in frames:
                    keys.append(prints.of(frame))
                    behind.do(encoder.add, self.shot.picture(frame))
                    tick()
        except BaseException:
            encoder.abort()
            raise
        encoder.close()
        for old in self._room.glob(f"{_begin(first)}*"):  # of other frames, of another shot, or half done
            if old != beside:
                old.unlink()
        part = self._place(first, keys)
        beside.replace(part)
        return [part]

    def found(self, first: int, frames: Iterable[Frame]) -> list[Path]:
        if not list(self._room.glob(f"{_begin(first)}*")):
            return []
        prints = self.shot.fingerprints()
        part = self._place(first, [prints.of(frame) for frame in frames])
        return [part] if part.is_file() else []

    def _place(self, first: int, keys: list[str]) -> Path:
        return self._room / f"{_begin(first)}{together(keys)}{self._kind.part}"


def _begin(first: int) -> str:
    return f"{first:09d}-"


def something_done(room: Path) -> bool:
    """Whether there is a complete part of a film in a folder."""
    return any(len(file.stem) == len(_begin(0)) + LETTERS for file in room.glob("*-*"))


def make_all(parts: Parts, frames: Iterable[Frame], processes: int, progress: Callable[[int], None]) -> list[Path]:
    """Make the parts of a film: all of a stream, those that are not there of a sequence; returns their files in order.

    Parameters
    ----------
    processes : by how many, of a sequence that each of them can have.
    progress : called with the number of pictures so far.
    """
    counted = _Count(progress)
    if isinstance(frames, Sequence):
        starts = range(0, len(frames), PART)
        if processes > 1 and len(starts) > 1:
            return _make_by_many(parts, frames, starts, min(processes, len(starts)), counted)
        return [file for first in starts for file in _make(parts, frames, first, counted)]
    files, stream = list[Path](), iter(frames)
    while (begun := next(stream, None)) is not None:
        files += parts.make(counted.count, chain([begun], islice(stream, PART - 1)), counted.tick)
    return files


def _make(parts: Parts, frames: Sequence[Frame], first: int, counted: _Count) -> list[Path]:
    """The files of a part, which is made if it is not there."""
    numbers = range(first, min(first + PART, len(frames)))
    if files := parts.found(first, (frames[k] for k in numbers)):
        counted.more(len(numbers))
        return files
    return parts.make(first, (frames[k] for k in numbers), counted.tick)


class _Count:
    """How many pictures are done."""

    def __init__(self, progress: Callable[[int], None]) -> None:
        self._progress = progress
        self.count = 0

    def tick(self) -> None:
        self.more(1)

    def more(self, pictures: int) -> None:
        self.count += pictures
        self._progress(self.count)


class _Behind:
    """A thread that encodes one picture while the next is drawn."""

    def __enter__(self) -> _Behind:
        self._pool = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None
        return self

    def do(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do it once the last one is done."""
        if self._last is not None:
            self._last.result()
        self._last = self._pool.submit(work, *arguments)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._pool.shutdown()
        if kind is None and self._last is not None:
            self._last.result()


# ------------------------------------------------------------------------------------------------------------ processes


def _make_by_many(parts: Parts, frames: Sequence[Frame], starts: range, processes: int, counted: _Count) -> list[Path]:
    import numba

    parts.shot.picture(frames[0])  # compiles for all of them
    with _workers(processes, (parts, frames, max(1, numba.get_num_threads() // processes))) as pool:
        jobs = {pool.submit(_work, first): min(PART, len(frames) - first) for first in starts}
        for job in as_completed(jobs):
            job.result()
            counted.more(jobs[job])
        return [file for job in jobs for file in job.result()]


_work_of: Any = None  # what a process has to do, and whether it is over
_GONE = "a process that drew pictures has ended, perhaps for want of memory: take fewer with --processes"


@contextmanager
def _workers(processes: int, work: tuple[Parts, Sequence[Frame], int]) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with this one, however it ends."""
    from concurrent.futures.process import BrokenProcessPool

    spawn = multiprocessing.get_context("spawn")
    over = spawn.Event()
    pool = ProcessPoolExecutor(processes, spawn, _begin_work, (over, *work))
    try:
        yield pool
    except BrokenProcessPool:
        raise InvalidInput(_GONE) from None
    finally:
        over.set()
        pool.shutdown(cancel_futures=True)


def _begin_work(over: Any, parts: Parts, frames: Sequence[Frame], threads: int) -> None:
    import signal

    import numba

    global _work_of  # noqa: PLW0603  (a process has one)
    _work_of = over, parts, frames
    numba.set_num_threads(threads)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all: the first process says what to do
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _work(first: int) -> list[Path]:
    over, parts, frames = _work_of

    def stop_if_over(_: int) -> None:
        if over.is_set():
            raise KeyboardInterrupt

    return _make(parts, frames, first, _Count(stop_if_over))


# --------------------------------------------------------------------------------------------------------------- stills


def save_png(picture: Picture, path: Path, key: str) -> None:
    """Write a PNG file that says what it follows from."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_text(KEY, key)
    Image.fromarray(picture).save(path, format="PNG", compress_level=6, pnginfo=info)


def _key_of(path: Path) -> str | None:
    """What a picture follows from; None if there is none, or it is damaged."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            found = picture.info.get(KEY)
            picture.verify()
    except Exception:  # Pillow raises whatever its parsing of damaged bytes runs into
        return None
    return found if isinstance(found, str) else None
