"""C programs of the contestants, compiled on the spot."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from benchmarks.track import Missing

FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp", "-fPIC", "-c")
LINKED = ("-shared", "-fopenmp")  # with -ffast-math, GCC links code that makes denormal numbers 0 in the whole process


def compiled(source: Path) -> ctypes.CDLL:
    """The functions of a C file.

    Raises
    ------
    Missing
        There is no compiler, or it cannot do this.
    """
    compiler = next(filter(None, map(shutil.which, (os.environ.get("CC", ""), "gcc", "clang", "cc"))), None)
    if compiler is None:
        raise Missing("no C compiler was found")
    with tempfile.TemporaryDirectory() as folder:
        part, library = Path(folder, f"{source.stem}.o"), Path(folder, f"{source.stem}.so")
        for command in ([*FLAGS, str(source), "-o", str(part)], [*LINKED, str(part), "-o", str(library), "-lm"]):
            done = subprocess.run([compiler, *command], capture_output=True, text=True, check=False)
            if done.returncode:
                raise Missing(f"{Path(compiler).name} refuses {source.name}: {done.stderr.strip().splitlines()[0]}")
        return ctypes.CDLL(str(library))
