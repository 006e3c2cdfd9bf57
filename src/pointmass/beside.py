"""Files are written beside their place and moved there when they are complete, so that a killed run loses nothing."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pointmass.errors import InvalidInput


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

    Parameters
    ----------
    what : such as "the recording", for people.

    Raises
    ------
    InvalidInput
        It cannot be written.
    """
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.stem[:32].replace('%', '_')}-", dir=path.parent) as folder:
            yield Path(folder) / path.name
            for written in sorted(Path(folder).iterdir()):
                written.replace(path.with_name(written.name))
    except OSError as error:
        raise InvalidInput(f"cannot write {what}{' ' * bool(what)}{str(path)!r}: {error.strerror}") from None
