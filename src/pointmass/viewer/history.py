"""The inputs that take back what was changed, to go back, and forth again."""

from __future__ import annotations

from time import monotonic

from pointmass.errors import InvalidInput
from pointmass.viewer.inputs import Input, Restore

TOGETHER = 1.0  # between two changes of the same setting that are undone as one: a slider on its way [s]
MOST = 1000


class History:
    """Remembers how changes are taken back.

    Attributes
    ----------
    past, future : inputs that take back the changes that were made, the newest last, and those that were undone.
    """

    def __init__(self) -> None:
        self.past: list[Input] = []
        self.future: list[Input] = []
        self._last: tuple[str, float] = "", 0.0  # what was changed, and when

    def add(self, undoing: Input, what: str) -> None:
        """Note that something was changed, and what takes it back."""
        now = monotonic()
        goes_on = self._last[0] == what and now < self._last[1] + TOGETHER and bool(self.past)
        if not (goes_on and isinstance(undoing, Restore)):
            self.past = [*self.past[-MOST:], undoing]
        self.future.clear()
        self._last = what, now

    def undone(self) -> Input:
        """What takes back the last change."""
        if not self.past:
            raise InvalidInput("there is nothing to undo")
        return self.past[-1]

    def redone(self) -> Input:
        """What makes again the one that was undone last."""
        if not self.future:
            raise InvalidInput("there is nothing to redo")
        return self.future[-1]

    def step(self, undoing: Input | None, back: bool) -> None:
        """Note that one step was made back or forth, and what takes that back; None = nothing can."""
        source, target = (self.past, self.future) if back else (self.future, self.past)
        source.pop()
        if undoing is not None:
            target.append(undoing)
        self._last = "", 0.0

    def begun(self) -> None:
        """A run has begun: what was done by hand to the one before is gone, and settings are left."""
        self.past[:] = [each for each in self.past if isinstance(each, Restore)]
        self.future[:] = [each for each in self.future if isinstance(each, Restore)]
