"""A cache, played frame by frame, and left for a simulation that goes on from one of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pointmass.cache import Cache
from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Frame
from pointmass.simulation import Simulation
from pointmass.viewer.inputs import Input
from pointmass.viewer.live import Live
from pointmass.viewer.messages import Contender, Loop, Parameter, Resume, Seek, Switch, Timeline, Vector
from pointmass.viewer.resumption import Resumption
from pointmass.viewer.setup import Setup


class Playback:
    """Plays a cache forwards, shows any frame of it, and follows it while another process still writes it.

    Attributes
    ----------
    live : the simulation that goes on from a frame, or None while frames of the cache are seen.
    """

    contenders: Sequence[Contender] = ()
    beside = False

    def __init__(self, cache: Cache) -> None:
        if not len(cache):
            raise InvalidInput(f"the cache {str(cache.path)!r} has no frames: run the scene again")
        self._cache, self._mark = cache, _mark(cache.path)
        self._next, self._at = 0.0, 0
        self._over = False  # whether it was said that the last frame was shown
        self._loop: tuple[int, int] | None = None
        self._resumption: Resumption | None = None
        self.live: Live | None = None
        self.name = str(cache.attributes.get("name", cache.path.stem))
        self.summary = f"the cache {cache.path.name}"
        self.fps = cache.fps

    @property
    def timeline(self) -> Playback:
        return self

    @property
    def solver(self) -> str:
        return self.live.solver if self.live else str(self._cache.attributes.get("solver", ""))

    @property
    def dt(self) -> float:
        return self.live.dt if self.live else float(self._cache.attributes.get("dt", 0.0))

    @property
    def frames(self) -> int | None:
        return None if self.live else len(self._cache)

    @property
    def camera(self) -> Camera:
        return self._cache.camera

    @property
    def grabs(self) -> bool:
        return self.live is not None and self.live.grabs

    @property
    def held(self) -> int:
        return self.live.held if self.live else -1

    @property
    def target(self) -> Vector:
        return self.live.target if self.live else (0.0, 0.0, 0.0)

    @property
    def picked(self) -> list[int]:
        return self.live.picked if self.live else []

    @picked.setter
    def picked(self, particles: list[int]) -> None:
        if self.live is None:
            raise InvalidInput("nothing can be picked in a cache: let the simulation go on from a frame first")
        self.live.picked = particles

    @property
    def pinned(self) -> bool:
        return self.live is not None and self.live.pinned

    @property
    def sims(self) -> Sequence[Simulation]:
        return [self.live.sim] if self.live else []

    @property
    def parameters(self) -> list[Parameter]:
        return self.live.parameters if self.live else []

    @property
    def presets(self) -> list[str]:
        return self.live.presets if self.live else []

    @property
    def solvers(self) -> list[str]:
        return self.live.solvers if self.live else []

    @property
    def switches(self) -> list[Switch]:
        return self.live.switches if self.live else []

    @property
    def wind(self) -> Vector | None:
        return self.live.wind if self.live else None

    @property
    def setup(self) -> Setup:
        return self.live.setup if self.live else Setup()

    def start(self) -> Frame:
        return self._seek(0)

    def advance(self, speed: float) -> Frame | None:
        if self.live:
            return self.live.advance(speed)
        first, last = self._loop or (0, len(self._cache) - 1)
        if int(self._next) > last:
            if not self._loop and not self._over:
                self._over = True
                return None
            self._next = float(first)
        self._over = False
        self._at = int(self._next)
        self._next += speed
        return self._frame(self._at)

    def look(self) -> Frame | None:
        return self.live.look() if self.live else None

    def arrange(self, beside: bool) -> Frame | None:
        return None

    def preset(self, name: str) -> Input | None:
        return self._running().preset(name)

    def prepare(self, what: Input) -> Callable[[], None] | None:
        return self._running().prepare(what)

    def undoing(self, what: Input) -> Input | None:
        return self._running().undoing(what)

    def recommended(self) -> Callable[[], float]:
        return self.live.recommended() if self.live else lambda: 0.0

    def text(self) -> str:
        return self._running().text()

    def apply(self, what: Input) -> Frame | None:
        return self._running().apply(what)

    def _running(self) -> Live:
        if self.live is None:
            raise InvalidInput("a cache cannot be changed or copied: let the simulation go on from a frame first")
        return self.live

    # ------------------------------------------------------------------------------------------------ its timeline

    def state(self) -> Timeline:
        first, last = self._loop or (0, len(self._cache) - 1)
        busy = self._resumption
        return Timeline(
            frames=len(self._cache),
            loop=self._loop is not None,
            first=first,
            last=last,
            resumable=self._cache.attributes.get("scene") is not None,
            live=self.live is not None,
            computing=busy.frame if busy else -1,
            computed=busy.computed if busy else 0,
        )

    def take(self, message: Seek | Loop | Resume) -> Frame | None:
        match message:
            case Seek(frame=k):
                self._check("seek.frame", k)
                return self._seek(k)
            case Loop(on=on, first=first, last=last):
                if on:
                    self._check("loop.last", last)
                    if not first <= last:
                        raise InvalidInput(f"loop.first = {first} is not allowed: it must be at most last, {last}")
                self._loop = (first, last) if on else None
            case Resume(frame=k):
                self._check("resume.frame", k)
                self.leave()
                self._resumption = Resumption(self._cache, k)
        return None

    def poll(self) -> Frame | None:
        follows = self.live is None and self._at == len(self._cache) - 1
        if self._grown() and follows:
            return self._seek(len(self._cache) - 1)
        done = self._resumption
        if done is None or (done.live is None and done.error is None):
            return None
        self._resumption = None
        if done.error is not None:
            raise done.error
        self.live = done.live
        return done.shown

    def leave(self) -> None:
        """Back to the cache, from a simulation or from what computes it."""
        if self._resumption is not None:
            self._resumption.cancel()
        self.live = self._resumption = None

    def _seek(self, k: int) -> Frame:
        self.leave()
        self._at, self._next, self._over = k, k + 1.0, False
        return self._frame(k)

    def _frame(self, k: int) -> Frame:
        return replace(self._cache.frame(k), number=k)

    def _check(self, name: str, k: int) -> None:
        if k >= len(self._cache):
            raise InvalidInput(f"{name} = {k} is not allowed: there are the frames 0 to {len(self._cache) - 1}")

    def _grown(self) -> bool:
        """Take further frames into account, or another cache in this one's place; whether there are any."""
        mark = _mark(self._cache.path)
        if mark == self._mark:
            return False
        try:
            cache = Cache.open(self._cache.path)
        except InvalidInput:  # it is being replaced: soon there is another one
            return False
        self._mark = mark
        if not len(cache) or len(cache) == len(self._cache):
            return False
        self._cache = cache
        if len(cache) <= self._at or (self._loop and len(cache) <= self._loop[1]):
            self._at, self._next, self._loop = len(cache) - 1, float(len(cache)), None
        return True


def _mark(path: Path) -> tuple[int, int]:
    """Changes when a frame is added, and when another cache takes this one's place."""
    try:
        stat = (path / "frames").stat()
    except OSError:
        return 0, 0
    return stat.st_ino, stat.st_mtime_ns
