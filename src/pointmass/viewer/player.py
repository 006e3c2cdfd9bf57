"""What a session plays: something that makes frames, one after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from pointmass.frame import Camera, Frame
from pointmass.simulation import Simulation
from pointmass.viewer.inputs import Input
from pointmass.viewer.messages import Contender, Loop, Parameter, Resume, Seek, Switch, Timeline, Vector
from pointmass.viewer.setup import Setup


class Scrubbed(Protocol):
    """The timeline of a player whose frames are there already; used by the same thread."""

    def state(self) -> Timeline:
        """For the page."""

    def take(self, message: Seek | Loop | Resume) -> Frame | None:
        """Do it; a frame if another one is to be seen.

        Raises
        ------
        InvalidInput
            It is not allowed, and nothing has changed.
        """

    def poll(self) -> Frame | None:
        """Whether something has come meanwhile, such as further frames; asked some times a second.

        Returns
        -------
        Frame or None
            One that is to be seen now.

        Raises
        ------
        InvalidInput
            What was being done cannot be done.
        """

    def leave(self) -> None:
        """End what is being computed."""


class Player(Protocol):
    """Makes frames, takes inputs; used by one thread at a time.

    Attributes
    ----------
    name, summary, solver : for people.
    dt : the solver's step [s], 0 if not known.
    fps : frames per simulated second.
    frames : how many there are; None = no end.
    camera : what it leaves open is found from the first frame.
    grabs : whether it takes `Hold`.
    held, target : row of who is held, or -1, and where it is drawn to [m].
    timeline : of frames that are there already, or None.
    picked, pinned : ids of the particles that were picked last, the newest first, and whether that one is pinned.
    solvers, switches : what can be chosen, and switched.
    wind : its mean [m/s], if there is one.
    setup : the settings now.
    sims : whose particles the rows of its frames are, one simulation after another; none for a cache.
    contenders : those of a duel; none if it is no duel.
    beside : whether they are drawn beside each other.
    """

    name: str
    summary: str
    fps: float
    picked: list[int]

    @property
    def setup(self) -> Setup: ...
    @property
    def timeline(self) -> Scrubbed | None: ...
    @property
    def solver(self) -> str: ...
    @property
    def dt(self) -> float: ...
    @property
    def frames(self) -> int | None: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def grabs(self) -> bool: ...
    @property
    def held(self) -> int: ...
    @property
    def target(self) -> Vector: ...
    @property
    def pinned(self) -> bool: ...
    @property
    def sims(self) -> Sequence[Simulation]: ...
    @property
    def contenders(self) -> Sequence[Contender]: ...
    @property
    def beside(self) -> bool: ...
    @property
    def parameters(self) -> list[Parameter]: ...
    @property
    def presets(self) -> list[str]: ...
    @property
    def solvers(self) -> list[str]: ...
    @property
    def switches(self) -> list[Switch]: ...
    @property
    def wind(self) -> Vector | None: ...

    def start(self) -> Frame:
        """Begin again; the first frame."""

    def advance(self, speed: float) -> Frame | None:
        """The next frame, 1/fps s on the clock later at a speed; None after the last one."""

    def look(self) -> Frame | None:
        """A frame of now, for what has changed at rest; None if nothing can."""

    def arrange(self, beside: bool) -> Frame | None:
        """Draw those of a duel beside each other or in one place; a frame if that is another one."""

    def preset(self, name: str) -> Input | None:
        """The input that chooses a preset."""

    def prepare(self, what: Input) -> Callable[[], None] | None:
        """What compiles the kernels for an input, for another thread, while frames are made; None if there are none.

        Raises
        ------
        InvalidInput
            The input is not allowed.
        """

    def undoing(self, what: Input) -> Input | None:
        """The input that takes back another one, which was not applied yet; None if there is nothing to take back.

        Raises
        ------
        InvalidInput
            The input is not allowed.
        """

    def recommended(self) -> Callable[[], float]:
        """What finds the largest step that is stable now [s], for another thread; it gives 0 if it cannot be known."""

    def text(self) -> str:
        """The scene as it is set now, as TOML.

        Raises
        ------
        InvalidInput
            It has no text.
        """

    def apply(self, what: Input) -> Frame | None:
        """Take an input; a frame if it began again.

        Raises
        ------
        InvalidInput
            It is not allowed, and nothing has changed.
        """
