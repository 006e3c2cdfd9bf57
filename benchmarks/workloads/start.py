"""How long a user waits: from the return key to the first frames of every scene that comes with pointmass.

`pointmass run SCENE --frames 2` as a process of its own: the start of Python, imports, the scene, the frame of the
start and the first computed one, written to disk, and the end of the process. Without kernels means an empty folder for
them: what the first run of a scene on a machine takes.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from benchmarks.page import Table

TITLE = "Start of `pointmass run`"
FRAMES = 2
MOST_TURNS = 5


def table(quick: bool, turns: int, say: Callable[[str], None] = print) -> Table:
    """Seconds for each scene, and for the least that a Python program with NumPy takes."""
    import pointmass as pm

    names = list(pm.SCENES)[: 1 if quick else None]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        kept = {name: Path(folder, name) for name in names}
        cold = {name: _run(name, kept[name], say) for name in names}
        warm: dict[str, list[float]] = {name: [] for name in names}
        least: list[float] = []
        for _ in range(min(turns, MOST_TURNS)):
            least.append(_timed([sys.executable, "-c", "import numpy"], {}))
            for name in names:
                warm[name].append(_run(name, kept[name], say))
        for name in names:
            rows.append([name, _seconds(min(warm[name])), _seconds(median(warm[name])), _seconds(cold[name])])
    rows.append(["Python and NumPy alone", _seconds(min(least)), _seconds(median(least)), ""])
    return Table(TITLE, "", ["scene", "kernels kept, min", "kernels kept, median", "without kernels"], rows)


def _run(scene: str, kernels: Path, say: Callable[[str], None]) -> float:
    """Time for two frames of a scene [s]; nan if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pointmass.cli", "run", scene, "--quiet", "--frames", str(FRAMES)]
        try:
            return _timed([*command, "-o", str(Path(folder, "out.zarr"))], {"POINTMASS_CACHE": str(kernels)})
        except subprocess.CalledProcessError as error:
            say(f"pointmass run {scene}: {error.stderr.strip().splitlines()[-1] if error.stderr else error}")
            return float("nan")


def _timed(command: list[str], environment: dict[str, str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    return time.perf_counter() - start


def _seconds(value: float) -> str:
    return "failed" if math.isnan(value) else f"{value:.2f} s"
