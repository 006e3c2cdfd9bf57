"""Files are written beside their place and moved there when they are complete, so that a killed run loses nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pointmass.errors import InvalidInput
from pointmass.lock import hidden, locked


def check_place(path: Path) -> None:
    """Refuse a place where no file can be.

    Raises
    ------
    InvalidInput
        There is no folder for it, or a folder has its name.
    """
    if not path.parent.is_dir():
        raise InvalidInput(f"cannot write {str(path)!r}: there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise InvalidInput(f"cannot write {str(path)!r}: it is a folder")


@contextmanager
def beside(path: Path, what: str = "") -> Iterator[Path]:
    """A file of the same name in a folder of its own; what is in that in the end moves to the place of `path`.

    The file itself moves last, after those that it may refer to. What a killed process left is cleared away.

    Parameters
    ----------
    what : such as "the recording", for people.

    Raises
    ------
    InvalidInput
        It cannot be written, or another process is writing it.
    """
    folder = hidden(path, ".part")
    with locked(path, what):
        try:
            try:
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                yield folder / path.name
                for written in sorted(folder.iterdir(), key=lambda p: (p.name == path.name, p.name)):
                    written.replace(path.with_name(written.name))
            finally:
                shutil.rmtree(folder, ignore_errors=True)
        except OSError as error:
            raise InvalidInput(f"cannot write {what}{' ' * bool(what)}{str(path)!r}: {error.strerror}") from None


def take_away(folder: Path, gone: Path) -> None:
    """Remove a folder: at once for all who look, then its files.

    Parameters
    ----------
    gone : the name that it has meanwhile; what a killed process left there goes, too.
    """
    shutil.rmtree(gone, ignore_errors=True)
    if folder.exists():
        folder.rename(gone)
        shutil.rmtree(gone, ignore_errors=True)
