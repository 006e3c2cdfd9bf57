"""Plays in a thread of its own, takes what pages send, and shows the newest frame."""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np

from pointmass.errors import InvalidInput, PointmassError
from pointmass.frame import Frame
from pointmass.viewer.background import Background
from pointmass.viewer.framing import Framing
from pointmass.viewer.history import History
from pointmass.viewer.inputs import NUMBERS, PASSING, Hold, Settings
from pointmass.viewer.instruments import Instruments, Readings
from pointmass.viewer.messages import (
    Advice,
    Arrange,
    Drag,
    Inbound,
    Inspect,
    Loop,
    Note,
    Outbound,
    Pick,
    Play,
    Redo,
    Reset,
    Resume,
    Seek,
    Speed,
    Status,
    Step,
    Timeline,
    Undo,
    Vector,
    Welcome,
)
from pointmass.viewer.player import Player
from pointmass.viewer.rows import Rows
from pointmass.viewer.wishes import wish

MOST_WAITING = 1000  # messages that have not been taken yet; more are dropped
AT_ONCE = 0.1  # how long the next frame waits for kernels that may be there already [s]
POLL = 0.25  # between two looks at what came meanwhile, such as further frames of a cache [s]
COMPILING = "compiling the laws, once on this machine"

Watcher = Callable[[Outbound | None], None]


@dataclass(frozen=True)
class Shown:
    """A frame as pages see it; see `FrameHead`.

    Attributes
    ----------
    run : another one when it was begun again: versions of drawables say nothing about those of other runs.
    """

    sequence: int
    run: int
    frame: Frame
    cost: float
    held: int
    target: Vector
    picked: list[int]
    pinned: bool
    readings: Readings


@dataclass(frozen=True)
class Prepared:
    """The kernels for what a page asks for are there."""

    message: Inbound


class Session:
    """Plays a player for any number of watchers, and rests while there are none.

    Parameters
    ----------
    playing : whether it runs from the start.

    Attributes
    ----------
    latest : the newest frame, or None before the first.
    """

    def __init__(self, player: Player, *, playing: bool = True) -> None:
        self._player = player
        self._playing, self._speed = playing, 1.0
        self._single = False
        self._fresh = True  # no step was made since it began
        self.latest: Shown | None = None
        self._sequence = self._run_number = 0
        self._rows = Rows()
        self._waiting: deque[Inbound | Prepared] = deque()
        self._preparing: Inbound | None = None  # what kernels are being compiled for
        self._postponed: deque[Inbound] = deque()  # what waits until they are
        self._history = History()
        self._background = Background()
        self._advice = Advice(solver="", largest=0.0)
        self._watchers: set[Watcher] = set()
        self._framing = Framing(player.camera)
        self._instruments = Instruments(player)
        self._frame: Frame | None = None  # the newest, as the player made it
        self._note = Note(level="info", text="")
        self._changed = threading.Condition()
        self._ended = False
        self._due = self._poll_due = 0.0
        self._told: Timeline | None = None
        self._thread = threading.Thread(target=self._run, name="pointmass session", daemon=True)

    def start(self) -> None:
        """Make the first frame, and begin."""
        self._show(self._player.start(), 0.0)
        self._advise()
        self._thread.start()

    def stop(self) -> None:
        """End after the frame that is being made."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(timeout=5.0)
        if self._player.timeline is not None:
            self._player.timeline.leave()

    def watch(self, watcher: Watcher) -> Callable[[], None]:
        """Call somebody, from the session's thread, for each message to all pages, and with None for each frame.

        Returns
        -------
        Callable
            Ends it.
        """
        with self._changed:
            self._watchers.add(watcher)
            self._changed.notify()

        def leave() -> None:
            with self._changed:
                self._watchers.discard(watcher)

        return leave

    def send(self, message: Inbound) -> None:
        """Take a message of a page, before the next frame is made."""
        with self._changed:
            newest = isinstance(message, (Drag, Seek)) and self._waiting and type(self._waiting[-1]) is type(message)
            if newest:
                self._waiting.pop()  # only where it is now counts
            if len(self._waiting) < MOST_WAITING:
                self._waiting.append(message)
            self._changed.notify()

    def greeting(self) -> list[Outbound]:
        """What a page has to know first."""
        timeline = self._player.timeline
        told: list[Outbound] = [self._welcome, self._framing.view, self._status, self._note, self._advice]
        told.append(self._instruments.message)
        return told if timeline is None else [*told, timeline.state()]

    def text(self) -> str:
        """The scene as it is set now, as TOML: see `Player.text`."""
        return self._player.text()

    # ------------------------------------------------------------------------------------------------ its thread

    def _run(self) -> None:
        while True:
            with self._changed:
                while not (self._ended or self._waiting or self._may_advance() or self._may_poll()):
                    self._changed.wait(self._pause())
                if self._ended:
                    return
                messages = list(self._waiting)
                self._waiting.clear()
            for message in messages:
                self._guarded(partial(self._take, message))
            if self._may_poll():
                self._guarded(self._poll)
            if self._may_advance():
                self._guarded(self._advance)

    def _wants_frame(self) -> bool:
        return bool(self._watchers) and (self._playing or self._single)

    def _may_advance(self) -> bool:
        return self._wants_frame() and (self._single or perf_counter() >= self._due)

    def _may_poll(self) -> bool:
        return bool(self._watchers) and self._player.timeline is not None and perf_counter() >= self._poll_due

    def _pause(self) -> float | None:
        """How long to wait for the next frame's time, or the next look [s]; None = until something happens."""
        due = [self._due] if self._wants_frame() else []
        if self._watchers and self._player.timeline is not None:
            due.append(self._poll_due)
        return max(0.0, min(due) - perf_counter()) if due else None

    def _poll(self) -> None:
        """Show what has come meanwhile on the timeline."""
        self._poll_due = perf_counter() + POLL
        timeline = self._player.timeline
        if timeline is None:
            return
        try:
            frame = timeline.poll()
        finally:
            self._tell_timeline()
        if frame is not None:
            self._scrubbed_to(frame)

    def _scrub(self, message: Seek | Loop | Resume) -> None:
        timeline = self._player.timeline
        if timeline is None:
            raise InvalidInput(f"{message.kind} is not allowed: only a cache has a timeline")
        frame = timeline.take(message)
        if isinstance(message, Resume):
            self._playing = False
            self._tell_status()
        self._tell_timeline()
        if frame is not None:
            self._scrubbed_to(frame)

    def _scrubbed_to(self, frame: Frame) -> None:
        self._due = perf_counter()
        if self._note.text:
            self._say("info", "")
        self._show(frame, 0.0)

    def _tell_timeline(self) -> None:
        """If it has changed; a simulation that goes on from a frame begins to run."""
        timeline = self._player.timeline
        now = None if timeline is None else timeline.state()
        if now is None or now == self._told:
            return
        before, self._told = self._told, now
        self._tell(now)
        if before is not None and now.live != before.live:
            self._run_number += 1
            self._playing, self._due = self._playing or now.live, perf_counter()
            self._history = History()
            self._instruments.forget()
            self._tell(self._instruments.message)
            self._tell_status()
            self._tell(self._welcome)
            self._advise()

    def _advance(self) -> None:
        if self._fresh and not self._note.text and self._player.timeline is None:
            self._say("info", COMPILING)
        begun = perf_counter()
        frame = self._player.advance(self._speed)
        self._fresh = False
        if self._note.text == COMPILING:
            self._say("info", "")
        now = perf_counter()
        self._due = max(self._due + 1.0 / self._player.fps, now - 1.0 / self._player.fps)
        single, self._single = self._single, False
        if frame is None:
            self._playing = False
        else:
            self._show(frame, now - begun)
        if frame is None or single:
            self._tell_status()

    def _show(self, frame: Frame, cost: float) -> None:
        seen, readings = self._instruments.look(frame, fresh=frame is not self._frame)
        self._frame = frame
        self._sequence += 1
        player = self._player
        rows = [np.flatnonzero(frame.ids == particle) for particle in player.picked]
        picked = [int(row[0]) for row in rows if len(row)]
        self.latest = Shown(
            self._sequence, self._run_number, seen, cost, player.held, player.target, picked, player.pinned, readings
        )
        self._rows.add(self._sequence, frame.ids)
        self._tell(None)
        if self._framing.sees(frame):
            self._tell(self._framing.view)

    def _tell(self, message: Outbound | None) -> None:
        with self._changed:
            watchers = list(self._watchers)
        for watcher in watchers:
            watcher(message)

    @property
    def _welcome(self) -> Welcome:
        player = self._player
        return Welcome(
            name=player.name,
            summary=player.summary,
            parameters=player.parameters,
            presets=player.presets,
            fps=player.fps,
            grabs=player.grabs,
            frames=player.frames,
            solver=player.solver,
            dt=player.dt,
            solvers=player.solvers,
            switches=player.switches,
            wind=player.wind,
        )

    @property
    def _status(self) -> Status:
        undo, redo = bool(self._history.past), bool(self._history.future)
        return Status(playing=self._playing, speed=self._speed, undo=undo, redo=redo)

    def _tell_status(self) -> None:
        self._tell(self._status)

    def _say(self, level: str, text: str) -> None:
        self._note = Note(level="error" if level == "error" else "info", text=text)
        self._tell(self._note)

    def _guarded(self, work: Callable[[], None]) -> None:
        """Whatever goes wrong is said on the page, and it goes on."""
        try:
            work()
        except PointmassError as error:
            self._stopped_by(error, str(error))
        except Exception as error:  # the page must not go silent because of a bug
            logging.getLogger("pointmass").exception("the live page")
            self._stopped_by(error, f"this should not happen ({type(error).__name__}): {error}")

    def _stopped_by(self, error: Exception, sentence: str) -> None:
        if not isinstance(error, InvalidInput):
            self._playing = self._single = False
            self._tell_status()
        self._say("error", sentence)

    def _take(self, message: Inbound | Prepared) -> None:
        match message:
            case Play(on=on):
                self._playing, self._due = on, perf_counter()
                self._tell_status()
            case Step():
                self._playing, self._single = False, True
            case Speed(factor=factor):
                self._speed = factor
                self._tell_status()
            case Reset():
                frame = self._player.start()
                self._tell_timeline()
                self._begun(frame)
            case Seek() | Loop() | Resume():
                self._scrub(message)
            case Prepared(message=wished):
                self._preparing = None
                self._say("info", "")
                self._guarded(partial(self._fulfil, wished))
                while self._postponed and self._preparing is None:
                    self._guarded(partial(self._wished, self._postponed.popleft()))
            case Pick(sequence=sequence, row=row):
                self._pick(self._rows.id(sequence, row))
                self._show_again()
            case Arrange(beside=beside):
                self._rearranged(self._player.arrange(beside))
            case _ if self._frame is not None and self._instruments.take(message, self._frame, self._row(message)):
                self._show(self._frame, 0.0)
                self._say("info", "")
                self._tell(self._instruments.message)
            case _:
                self._wished(message)

    def _wished(self, message: Inbound) -> None:
        """Do what a page asks for, now or when its kernels are compiled: settings one after the other."""
        what = wish(message, self._player, self._history, self._rows.id)
        if what is None:
            return
        if isinstance(what, Hold):
            self._pick(what.particle)
        if self._preparing is not None and not isinstance(what, PASSING):
            self._postponed.append(message)
            return
        with self._left_out(message):
            job = self._player.prepare(what)
        if job is None or not self._prepares(message, job):
            self._fulfil(message)

    def _prepares(self, message: Inbound, job: Callable[[], None]) -> bool:
        """Compile in a thread; False if that is done at once."""

        done = threading.Event()
        late = False

        def work() -> None:
            with suppress(Exception):  # what goes wrong does so again when the message is fulfilled, and is said then
                job()
            with self._changed:
                done.set()
                if late:
                    self._waiting.append(Prepared(message))
                    self._changed.notify()

        threading.Thread(target=work, name="pointmass compiler", daemon=True).start()
        if done.wait(AT_ONCE):
            return False
        with self._changed:
            late = not done.is_set()
        if late:
            self._preparing = message
            self._say("info", "kernels are being compiled for this; until then, it runs on as it was")
        return late

    def _fulfil(self, message: Inbound) -> None:
        what = wish(message, self._player, self._history, self._rows.id)
        if what is None:
            return
        with self._left_out(message):
            undoing = self._player.undoing(what)
            frame = self._player.apply(what)
        if isinstance(message, (Undo, Redo)):
            self._history.step(undoing, isinstance(message, Undo))
        elif undoing is not None:
            self._history.add(undoing, f"{message.kind} {getattr(message, 'name', '')}")
        if isinstance(what, Settings):
            self._instruments.heed()
        if frame is not None:
            self._begun(frame)
        else:
            if not isinstance(what, NUMBERS):
                self._say("info", "")
            self._show_again()
        if undoing is not None or isinstance(message, (Undo, Redo)):
            self._tell_status()
        if isinstance(what, Settings):
            self._tell(self._welcome)
            self._tell(self._instruments.message)
            self._advise()

    @contextmanager
    def _left_out(self, message: Inbound) -> Iterator[None]:
        """A step back or forth that can no longer be made, such as with a particle that has died, is left out."""
        try:
            yield
        except InvalidInput:
            if isinstance(message, (Undo, Redo)):
                self._history.step(None, isinstance(message, Undo))
                self._tell_status()
            raise

    def _pick(self, particle: int) -> None:
        others = [other for other in self._player.picked if other != particle]
        self._player.picked = [particle, *others][:2]

    def _show_again(self) -> None:
        """At rest, too, it can be seen what has changed."""
        if self._playing or self._frame is None:
            return
        self._show(self._player.look() or self._frame, 0.0)

    def _advise(self) -> None:
        """Find out how long steps may be, and tell."""
        solver = self._player.solver

        def tell(largest: float) -> None:
            self._advice = Advice(solver=solver, largest=None if math.isinf(largest) else largest)
            self._tell(self._advice)

        self._background.do(self._player.recommended(), tell)

    def _begun(self, frame: Frame) -> None:
        self._due, self._fresh = perf_counter(), True
        self._run_number += 1
        self._history.begun()
        self._tell_status()
        self._say("info", "")
        self._show(frame, 0.0)

    def _rearranged(self, frame: Frame | None) -> None:
        if frame is not None:
            self._framing = Framing(self._player.camera)
            self._show(frame, 0.0)
            self._tell(self._instruments.message)

    def _row(self, message: Inbound) -> int:
        """In the newest frame, of the particle that is picked; -1 if none is, or if it is no longer there."""
        if not isinstance(message, Inspect) or self._frame is None:
            return -1
        rows = np.flatnonzero(self._frame.ids == self._rows.id(message.sequence, message.row))
        return int(rows[np.abs(rows - message.row).argmin()]) if len(rows) else -1
