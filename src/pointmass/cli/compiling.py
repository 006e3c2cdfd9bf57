"""Says why the first frame, or the first picture, on a machine takes long, and what the library warns of."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def compiling_said(quiet: bool) -> Iterator[None]:
    """Say one line on stderr if a kernel of the renderer is compiled meanwhile, because it is in no cache."""
    from numba.core.event import Listener, install_listener

    class Once(Listener):
        said = quiet

        def on_start(self, event: Any) -> None:
            if not self.said and event.data["dispatcher"].py_func.__module__.startswith("pointmass.render."):
                self.said = True
                # By print, not by click: so it comes above a bar.
                print("pointmass: compiling the renderer (once per machine, about 20 s)...", file=sys.stderr)

        def on_end(self, event: Any) -> None:
            """Nothing to say."""

    with install_listener("numba:compile", Once()):
        yield


class Said(logging.Handler):
    """Passes what the library says on to stderr, where a bar may be."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"pointmass: {record.getMessage()}", file=sys.stderr)


@contextmanager
def laws_said(quiet: bool) -> Iterator[None]:
    """Say on stderr what the engine compiles meanwhile, because it is in no cache."""
    logger, handler = logging.getLogger("pointmass"), Said()
    before = logger.level
    if not quiet:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


@contextmanager
def warnings_said(quiet: bool) -> Iterator[None]:
    """Pass what the library warns of on to stderr, each as one line."""

    def say(message: Warning | str, *_: Any, **__: Any) -> None:
        if not quiet:
            print(f"pointmass: {' '.join(str(message).split())}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = say
        yield
