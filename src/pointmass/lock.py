"""One process at a time writes a cache or a file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pointmass.errors import InvalidInput

LONGEST = 48  # letters of a name that hidden ones keep
FAR = 2**30  # where Windows locks a byte: whoever asks may still read the number of the process


@contextmanager
def locked(path: Path, what: str = "", ending: str = ".lock") -> Iterator[None]:
    """Inside, no other process writes to a path.

    The system forgets the lock when the process ends, however it ends; the small file that a killed one leaves behind
    hinders nobody, and goes with the next lock.

    Parameters
    ----------
    path : of what is written.
    what : it is, for people, such as "the cache".
    ending : of the lock's name; those of other names are other locks.

    Raises
    ------
    InvalidInput
        Another process does, or nothing can be written there.
    """
    named = f"{what} {str(path)!r}".lstrip()
    place = hidden(path, ending)
    try:
        descriptor = _taken(place)
    except OSError as error:
        raise InvalidInput(f"cannot write {named}: {error.strerror}") from None
    if descriptor is None:
        who = ""
        with suppress(OSError):
            who = place.read_text(encoding="ascii").strip()
        raise InvalidInput(
            f"{named} is being written by process {who or 'unknown'}: wait for its end, or give another name"
        )
    try:
        os.truncate(descriptor, 0)
        os.write(descriptor, f"{os.getpid()}\n".encode("ascii"))
        yield
    finally:
        with suppress(OSError):
            place.unlink()
        os.close(descriptor)


def hidden(path: Path, ending: str) -> Path:
    """A hidden name beside a path, the same whenever it is asked for, so that what a killed process leaves is found.

    Parameters
    ----------
    ending : of the name, such as ".lock".
    """
    name = path.name
    if len(name) > LONGEST:
        name = f"{name[:LONGEST]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return path.with_name(f".{name.replace('%', '_')}{ending}")


def _taken(place: Path) -> int | None:
    """A descriptor of the locked file; None if somebody else has it."""
    while True:
        descriptor = os.open(place, os.O_RDWR | os.O_CREAT, 0o644)
        if not _lock(descriptor):
            os.close(descriptor)
            return None
        with suppress(OSError):
            if os.path.samestat(os.fstat(descriptor), place.stat()):
                return descriptor
        os.close(descriptor)  # whoever had it has taken it away in the meantime


def _lock(descriptor: int) -> bool:
    """Lock a file, unless it is locked."""
    module: Any
    try:
        try:
            import fcntl as module
        except ImportError:  # Windows
            import msvcrt as module

            os.lseek(descriptor, FAR, os.SEEK_SET)
            module.locking(descriptor, module.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            module.flock(descriptor, module.LOCK_EX | module.LOCK_NB)
    except OSError:
        return False
    return True
