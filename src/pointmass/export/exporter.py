"""What an exporter is, and what it is told about a run beside the frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from pointmass.frame import Camera, Frame


@dataclass(frozen=True, kw_only=True)
class About:
    """What frames do not say.

    Attributes
    ----------
    fps : frames per second of simulated time.
    name : of the run.
    camera : that looks at it; one without a position or a target is left out.
    moved : the camera at the time of a frame, if it moves.
    times : of all frames [s], where a file begins with them (`Exporter.ahead`).
    """

    fps: float = 60.0
    name: str = "run"
    camera: Camera | None = None
    moved: Callable[[Frame], Camera] | None = None
    times: tuple[float, ...] = ()


Write = Callable[[Iterable[Frame], Path, About], None]


@dataclass(frozen=True, kw_only=True)
class Exporter:
    """Writes one kind of file.

    Attributes
    ----------
    write : takes frames, each once and one at a time, so that a run of any length fits into memory; the path of a
        file, in a folder of its own that may hold others beside it in the end; and what there is to know of the run.
    still : whether a file holds one frame.
    ahead : whether it must know the times of all frames before it takes the first.
    """

    write: Write
    still: bool = False
    ahead: bool = False
