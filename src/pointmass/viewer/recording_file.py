"""Recordings as JSON: what was done to a run at which step, and what came out."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args

from pointmass import __version__
from pointmass.beside import beside
from pointmass.errors import InvalidInput
from pointmass.viewer.inputs import Input, Recording
from pointmass.viewer.setup import Setup

FORMAT = 1
INPUTS: dict[str, type] = {kind.__name__: kind for kind in get_args(Input)}


@dataclass(frozen=True, kw_only=True)
class Saved:
    """A recording with what it takes to replay it.

    Attributes
    ----------
    scene : name of a scene that is shipped, or a scene file's text, which begins with "version".
    options : of the command line, that it was opened with.
    steps : how many the run had.
    digest : of its state then; see `Live.digest`.
    version : of pointmass, that recorded it.
    """

    scene: str
    options: dict[str, Any]
    recording: Recording
    steps: int
    digest: str
    version: str = __version__


def save(saved: Saved, path: Path) -> None:
    """Write a recording, beside and renamed.

    Raises
    ------
    InvalidInput
        The place cannot be written.
    """
    inputs = [[step, type(what).__name__, asdict(what)] for step, what in saved.recording.inputs]
    document = {"pointmass recording": FORMAT, **{f.name: getattr(saved, f.name) for f in fields(saved)}}
    document["recording"] = {"setup": asdict(saved.recording.setup), "inputs": inputs}
    with beside(path, "the recording") as part:
        part.write_text(json.dumps(document, indent=1), encoding="utf-8")


def load(path: Path) -> Saved:
    """Read a recording.

    Raises
    ------
    InvalidInput
        It cannot be read, or is no recording of this format.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidInput(f"cannot read the recording {str(path)!r}: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise InvalidInput(f"{str(path)!r} is not a recording: it is not JSON") from None
    if not isinstance(document, dict) or document.pop("pointmass recording", None) != FORMAT:
        raise InvalidInput(f"{str(path)!r} is not a recording of format {FORMAT}: pointmass view --record makes them")
    try:
        recording = document.pop("recording")
        inputs = [(_checked(int, step), _input(kind, values)) for step, kind, values in recording["inputs"]]
        made = Recording(_checked(Setup, recording["setup"]), inputs)
        saved: Saved = _checked(Saved, {**document, "recording": Recording()}, recording=made)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInput(f"{str(path)!r} is not a recording: {_first_line(error)}") from None
    return saved


def _input(kind: Any, values: Any) -> Input:
    if not isinstance(kind, str) or kind not in INPUTS:
        raise ValueError(f"there is no input {kind!r}")
    result: Input = _checked(INPUTS[kind], values)
    return result


def _checked(kind: Any, value: Any, **more: Any) -> Any:
    """A value as a type demands."""
    from pydantic import TypeAdapter  # on first use: it takes its time

    checked = TypeAdapter(kind).validate_python(value)
    return replace(checked, **more) if more else checked


def _first_line(error: Exception) -> str:
    return " ".join(str(error).split("\n")[:3])
