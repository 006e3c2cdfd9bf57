"""Brings a simulation to a frame of a cache, from where it goes on to the same bits."""

from __future__ import annotations

import threading

import numpy as np

from pointmass.cache import Cache
from pointmass.errors import InvalidInput, PointmassError
from pointmass.frame import Frame
from pointmass.viewer.live import Live
from pointmass.viewer.subject import Subject


class Resumption:
    """Runs a cache's scene again up to a frame, in a thread of its own, and holds each frame against the cache's.

    A run is the same whenever it is made, so at that frame it is in the state in which the first one was.

    Parameters
    ----------
    cache : its scene is run.
    frame : the last one to be computed, counted from 0.

    Attributes
    ----------
    frame : that one.
    computed : frames made so far.
    live : the simulation, as soon as it is there.
    shown : the frame that it stands at, likewise.
    error : what stopped it.

    Raises
    ------
    InvalidInput
        The cache has no scene.
    """

    def __init__(self, cache: Cache, frame: int) -> None:
        scene = cache.scene
        if scene is None:
            raise InvalidInput("this cache has no scene from which it could go on: record it with scene=..., as text")
        self.frame, self.computed = frame, 0
        self.live: Live | None = None
        self.shown: Frame | None = None
        self.error: PointmassError | None = None
        self._cancelled = False
        self._cache, self._subject = Cache.open(cache.path), Subject.of_scene(scene)
        self._thread = threading.Thread(target=self._run, name="pointmass resumption", daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """End after the frame that is being made; nobody waits for it."""
        self._cancelled = True

    def _run(self) -> None:
        try:
            self._compute()
        except PointmassError as error:
            self.error = error
        except Exception as error:  # said on the page by the session
            self.error = PointmassError(f"it cannot go on from here ({type(error).__name__}): {error}")

    def _compute(self) -> None:
        live = Live(self._subject)
        live.fps = self._cache.fps
        made: Frame | None = live.start()
        for k in range(self.frame + 1):
            if k:
                made = live.advance(1.0)
            if self._cancelled or made is None:
                return
            if not _same(made, self._cache.frame(k)):
                raise InvalidInput(
                    f"frame {k} comes out otherwise than the cache has it, so nothing can go on from there: it was made"
                    " on another machine, by another version of pointmass, or by a simulation that was changed"
                )
            self.computed = k + 1
        self.shown, self.live = made, live


def _same(made: Frame, stored: Frame) -> bool:
    return all(
        np.array_equal(getattr(made, name), getattr(stored, name), equal_nan=name != "ids")
        for name in ("ids", "positions", "velocities")
    )
