"""Names of files that hold one frame each, such as x_%04d.png."""

from __future__ import annotations

import re
from pathlib import Path

from pointmass.errors import InvalidInput

NUMBERED = re.compile(r"[^%]*%(0[1-9])?d[^%]*")


def is_sequence(path: Path) -> bool:
    """Whether the name holds a number for each frame.

    Raises
    ------
    InvalidInput
        It has a % that is no number, or two of them.
    """
    if "%" in path.name and not NUMBERED.fullmatch(path.name):
        raise InvalidInput(f"cannot write {path.name!r}: a sequence needs one number, such as x_%04d{path.suffix}")
    return "%" in path.name
