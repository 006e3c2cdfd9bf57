"""The time that is left: not said before it can be known."""

from __future__ import annotations

import io
import re

import pytest

from pointmass.cli import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        monkeypatch.setattr(progress, "now", lambda: self.now)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_the_first_item_tells_nothing(clock: Clock) -> None:
    pace = progress.Pace(100)
    assert pace.left is None
    for seconds, done, left in ((30.0, 1, None), (31.0, 2, None), (32.0, 3, None), (33.0, 4, 96.0), (45.0, 16, 84.0)):
        clock.now = seconds
        pace.tick(done)
        assert pace.left == left
    clock.now = 50.0  # no item since: what is left has become less
    assert pace.left == 79.0
    clock.now = 1000.0
    assert pace.left == 0.0


def test_many_items_in_a_moment_tell_nothing(clock: Clock) -> None:
    pace = progress.Pace(1000)
    for done in range(1, 500):
        clock.now += 0.001
        pace.tick(done)
        assert pace.left is None


def test_lines(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with progress.progress("exporting", 100, quiet=False) as tick:
        for done in (1, 2, 3):
            clock.now += 11.0
            tick(done)
    assert capsys.readouterr().err.splitlines() == [
        "pointmass: exporting: 1 of 100 frames",
        "pointmass: exporting: 2 of 100 frames",
        "pointmass: exporting: 3 of 100 frames",
    ]
    with progress.progress("exporting", 100, quiet=False) as tick:
        for done in (1, 2, 5, 41):
            clock.now += 11.0
            tick(done)
    assert capsys.readouterr().err.splitlines()[-1] == "pointmass: exporting: 41 of 100 frames, 49 s left"


def test_bar(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    stderr = Terminal()
    monkeypatch.setattr("sys.stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    with progress.progress("exporting", 100, quiet=False) as tick:
        for seconds, done in ((30.0, 1), (31.0, 2), (40.0, 11)):
            clock.now = seconds
            tick(done)
    assert "11/100 0:01:29" in re.sub(r"\x1b\[[0-9;?]*\w", "", stderr.getvalue())
    assert " 0:00:00" not in stderr.getvalue()
