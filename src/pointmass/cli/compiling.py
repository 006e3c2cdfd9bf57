"""Says why the first picture on a machine takes long."""

from __future__ import annotations

import sys
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
