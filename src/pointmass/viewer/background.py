"""Work beside the session, in threads of its own: of what waits, the newest job alone is done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Background:
    """Does one job at a time, and tells somebody what came out."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._next: Callable[[], None] | None = None
        self._busy = False

    def do(self, job: Callable[[], T], then: Callable[[T], None]) -> None:
        """Do a job, after the one that is being done and in place of any that waits."""
        with self._lock:
            self._next = lambda: then(job())
            if self._busy:
                return
            self._busy = True
        threading.Thread(target=self._run, name="pointmass background", daemon=True).start()

    def _run(self) -> None:
        while True:
            with self._lock:
                job, self._next = self._next, None
                if job is None:
                    self._busy = False
                    return
            job()
