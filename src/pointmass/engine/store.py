"""Kernels on disk: the printed source is a file of the user's cache folder, and its machine code lies beside it.

A file is named by the hash of all that its code depends on, so it never changes: what is there is right. Numba keeps
the machine code in `__pycache__` beside it, and every later process loads that. The file is plain Python that anybody
may read.
"""

from __future__ import annotations

import gc
import logging
import os
import sys
import tempfile
import threading
import warnings
from collections.abc import Iterator
from functools import cache
from hashlib import sha256
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from pointmass.engine.outlining import outlined
from pointmass.engine.sharing import share
from pointmass.engine.threads import heed_environment

HEADER = '''"""{title}

Printed by pointmass {version} for {dtype}. It runs without Numba too: delete the lines `@njit`.
"""

import numpy as np
from numba import njit, prange

from pointmass.engine.inner import Inner, Loop
from pointmass.engine.support import added, columns, more_columns, put_back, subtracted
from pointmass.engine.support import exponent, mixed, scaled, select, significand, streamed

R = np.{dtype}
TEXT = {{"pipeline_class": Inner, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}}  # of what only kernels call
OWNING = {{**TEXT, "_nrt": True, "error_model": "numpy"{fast}}}
FLAGS = {{**OWNING, "_nrt": False}}  # of what makes no arrays: nobody counts references
LOOP = {{**OWNING, "parallel": True, "pipeline_class": Loop}}  # of loops of all threads
APART = FLAGS | {{"forceinline": False}}  # Numba takes it over from the caller that is compiled first
ENTRY = {{"_nrt": False, "error_model": "numpy", "cache": True, "nogil": True{fast}}}  # of what Python calls
OWNING_ENTRY = {{**ENTRY, "_nrt": True}}

'''
FAST = ', "fastmath": {"contract", "arcp"}'  # never those that assume that there is no NaN, or reorder sums
LOGGER = logging.getLogger("pointmass")  # says at level INFO what is compiled
PREFIX = "pointmass_kernel_"  # of the names of their modules
LOADED: dict[str, ModuleType] = {}
LOCK = threading.RLock()


def folder() -> Path:
    """Where kernels are kept: $POINTMASS_CACHE, or `pointmass` in the user's cache folder."""
    from platformdirs import user_cache_path

    given = os.environ.get("POINTMASS_CACHE")
    return (Path(given) if given else user_cache_path("pointmass", appauthor=False)) / "kernels"


def complete(title: str, text: str, dtype: str) -> str:
    """The text of functions as a whole module."""
    return _head(title, dtype) + outlined(text)


def _head(title: str, dtype: str) -> str:
    from pointmass import __version__

    return HEADER.format(title=title, version=__version__, dtype=dtype, fast=FAST if dtype == "float32" else "")


def load(title: str, text: str, dtype: str) -> ModuleType:
    """The module of a kernel, compiled when it is first called, or loaded from the machine code of another process.

    Parameters
    ----------
    title : one line that says what it is.
    text : functions, with the names that the header provides: np, njit, prange, R, FLAGS, ENTRY,
        and OWNING, OWNING_ENTRY for those that make arrays. Loops of all threads become functions (`outlined`).
    dtype : "float64" or "float32".
    """
    heed_environment()
    _spare_the_collector()
    key = sha256((_head(title, dtype) + text + _surroundings()).encode()).hexdigest()[:20]
    with LOCK:
        if key not in LOADED:
            path = _written(key, title, text, dtype)
            LOADED[key] = _import(f"{PREFIX}{key}", path)
            if not any((path.parent / "__pycache__").glob(f"{key}.*.nbc")):
                LOGGER.info("compiling %s (once per machine)...", title)
                share(LOADED[key], path.read_text(encoding="utf-8"))
        return LOADED[key]


def plain(title: str, text: str, dtype: str) -> dict[str, Any]:
    """The functions of a kernel as plain Python, by name: what tests run to see every line."""
    source = complete(title, text, dtype).replace("from numba import njit, prange\n", "")
    scope: dict[str, Any] = {"njit": lambda **flags: lambda function: function, "prange": range}
    exec(compile(source, f"<{title}>", "exec"), scope)
    return scope


def kept() -> Iterator[Path]:
    """Every file of the store, kernels with their machine code."""
    if folder().is_dir():
        yield from (path for path in sorted(folder().rglob("*")) if path.is_file())


def clear() -> tuple[int, int]:
    """Delete all kernels; how many there were, and how many bytes."""
    kernels = size = 0
    for path in kept():
        size += path.stat().st_size
        kernels += path.suffix == ".py"
        path.unlink(missing_ok=True)
    return kernels, size


@cache
def _spare_the_collector() -> None:
    """Let no garbage be collected while Numba compiles: the search through its many objects takes 8% of the time."""
    from numba.core.event import Listener, register

    class Compiling(Listener):
        """Functions that are being compiled, one within the other, by any thread."""

        depth, lock, enabled = 0, threading.Lock(), True

        def on_start(self, event: Any) -> None:
            with self.lock:
                if self.depth == 0:
                    self.enabled = gc.isenabled()
                    gc.disable()
                self.depth += 1

        def on_end(self, event: Any) -> None:
            with self.lock:
                self.depth -= 1
                if self.depth == 0 and self.enabled:
                    gc.enable()

    register("numba:compile", Compiling())  # type: ignore[no-untyped-call]


@cache
def _surroundings() -> str:
    """What the machine code depends on besides its source; Numba itself looks at the CPU."""
    import llvmlite
    import numba
    import numpy as np

    from pointmass.engine import outlining, support
    from pointmass.tracing import noise

    files = (support.__file__, noise.__file__, outlining.__file__)
    helpers = [Path(file).read_text(encoding="utf-8") for file in files]
    return repr((numba.__version__, llvmlite.__version__, np.__version__, sys.version, sys.platform, helpers))


def _written(key: str, title: str, text: str, dtype: str) -> Path:
    """The file of a kernel, which is completed if it is not there.

    The first process that writes it wins: its time stamp is part of Numba's key.
    """
    path = folder() / f"{key}.py"
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            _publish(path, complete(title, text, dtype))
    except OSError as error:
        warnings.warn(
            f"kernels cannot be kept in {str(folder())!r} ({error.strerror}), so they are compiled in every process: "
            "set POINTMASS_CACHE to a folder that can be written",
            RuntimeWarning,
            stacklevel=2,
        )
        path = Path(tempfile.mkdtemp(prefix="pointmass-")) / f"{key}.py"
        path.write_text(complete(title, text, dtype), encoding="utf-8")
    return path


def _publish(path: Path, source: str) -> None:
    """Write beside, and rename unless somebody else was first."""
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".new")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        try:
            os.link(beside, path)
        except FileExistsError:
            return
        except OSError:  # a file system without links
            Path(beside).replace(path)
            return
    finally:
        Path(beside).unlink(missing_ok=True)


class _Absent(MetaPathFinder, Loader):
    """An empty module in place of a kernel that is not loaded.

    The machine code of a kernel that shares functions with another names the other's module, and needs nothing of it.
    """

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        return ModuleSpec(name, self) if name.startswith(PREFIX) else None

    def create_module(self, spec: ModuleSpec) -> None:
        pass

    def exec_module(self, module: ModuleType) -> None:
        pass


sys.meta_path.append(_Absent())


def _import(name: str, path: Path) -> ModuleType:
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # Numba looks functions up by the name of their module
    spec.loader.exec_module(module)
    return module
