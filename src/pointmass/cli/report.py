"""What a command says at its end."""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from pointmass.errors import Diverged


@dataclass(kw_only=True)
class Report:
    """The result of `run` and `render`.

    Attributes
    ----------
    command : its name.
    path : of what was written.
    frames : how many are in it.
    diverged : why the simulation ended early, if it did.
    interrupted : whether Ctrl-C or SIGTERM ended it.
    """

    command: str
    path: Path
    frames: int = 0
    diverged: Diverged | None = None
    interrupted: bool = False
    start: float = field(default_factory=time.monotonic)

    def show(self, as_json: bool, quiet: bool) -> None:
        """One JSON object on stdout, or a line on stderr."""
        seconds = time.monotonic() - self.start
        if as_json:
            click.echo(json.dumps(self._plain(seconds), allow_nan=False))
        elif not quiet and not self.interrupted and self.diverged is None:
            click.echo(f"pointmass: {counted(self.frames)} in {seconds:.1f} s: {self.path}", err=True)

    def _plain(self, seconds: float) -> dict[str, Any]:
        error = self.diverged
        reason: dict[str, Any] | None = None
        if error is not None:
            reason = {"message": str(error), "particle": error.particle, "force": error.force, "step": error.step}
            reason |= {"time": error.time, "largest_safe_dt": finite(error.largest_safe_dt)}
        return {
            "command": self.command,
            "path": str(self.path),
            "frames": self.frames,
            "seconds": round(seconds, 3),
            "diverged": reason,
            "interrupted": self.interrupted,
        }


def counted(frames: int) -> str:
    """A number of frames in words."""
    return f"{frames} frame{'' if frames == 1 else 's'}"


def finite(value: float | None) -> float | None:
    """A number for JSON: None where there is none (infinity, NaN)."""
    return value if value is not None and math.isfinite(value) else None
