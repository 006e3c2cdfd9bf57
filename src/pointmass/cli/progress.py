"""How far a long command has come, on stderr: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from time import monotonic as now

import click

EVERY = 10.0  # [s] between two lines where there is no terminal
ENOUGH_TIME, ENOUGH_ITEMS = 3.0, 3  # [s] and items after the first one, before the time left is known


@contextmanager
def progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """A function that takes the number of frames done so far.

    Parameters
    ----------
    what : is done, such as "simulating".
    total : number of frames.
    quiet : show nothing.
    """
    if quiet:
        yield lambda done: None
    elif sys.stderr.isatty():
        with _bar(what, total) as tick:
            yield tick
    else:
        yield _lines(what, total)


class Pace:
    """How long the rest takes, at the pace since the first item: that one pays for all that is done once."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._first: tuple[float, int] | None = None
        self._last = (0.0, 0)

    def tick(self, done: int) -> None:
        """So many are done now."""
        self._last = now(), done
        self._first = self._first or self._last

    @property
    def left(self) -> float | None:
        """[s]; None while nobody can know."""
        if self._first is None:
            return None
        seconds, items = self._last[0] - self._first[0], self._last[1] - self._first[1]
        if seconds < ENOUGH_TIME or items < ENOUGH_ITEMS:
            return None
        return max(0.0, seconds / items * (self._total - self._last[1]) - (now() - self._last[0]))


@contextmanager
def _bar(what: str, total: int) -> Iterator[Callable[[int], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    pace = Pace(total)

    class TimeLeft(ProgressColumn):
        """The time left, and at the end the time that it took."""

        def render(self, task: Task) -> Text:
            seconds = task.finished_time if task.finished else pace.left
            return Text("-:--:--" if seconds is None else str(timedelta(seconds=round(seconds))), "cyan")

    columns = (TextColumn(f"{what:<10}"), BarColumn(), MofNCompleteColumn(), TimeLeft())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=total)

        def tick(done: int) -> None:
            pace.tick(done)
            bar.update(task, completed=done)

        yield tick


def _lines(what: str, total: int) -> Callable[[int], None]:
    pace = Pace(total)
    last = now()

    def tick(done: int) -> None:
        nonlocal last
        pace.tick(done)
        if now() - last >= EVERY and done < total:
            last = now()
            left = "" if pace.left is None else f", {pace.left:.0f} s left"
            click.echo(f"pointmass: {what}: {done} of {total} frames{left}", err=True)

    return tick
