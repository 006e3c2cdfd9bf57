"""Races against peers, one for each workload: `python -m benchmarks.race free|cloth|...|all`, `--help` for their names.

Everybody does equal work in turns, in processes of their own (track.py), and only the right answer counts. Above the
tables of a workload stands what the machine can do (probe.py). `pip install pointmass[race]` brings the peers; who is
not there is left out.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path

import click

from benchmarks.page import Table, section, tables, write
from benchmarks.probe import Machine, probe
from benchmarks.track import run

WORKLOADS = ("free", "cloth", "hair", "fish", "pairs", "implicit", "xpbd", "emit", "start")


@click.command()
@click.argument("workloads", nargs=-1, type=click.Choice([*WORKLOADS, "all"]), required=True)
@click.option("--quick", is_flag=True, help="Small sizes: does everything work?")
@click.option("--turns", default=11, show_default=True, help="Of the fastest; slow contestants make fewer.")
@click.option("--threads", default=os.cpu_count() or 1, show_default=True, help="For everybody.")
@click.option("--only", default="", help="Only contestants whose names contain this.")
@click.option("--case", default="", help="Only races whose titles or cases contain this.")
@click.option("--write", "page", type=click.Path(path_type=Path), help="Put the tables into this page.")
def main(
    workloads: tuple[str, ...], quick: bool, turns: int, threads: int, only: str, case: str, page: Path | None
) -> None:
    """Race pointmass against its peers on one workload, or on several."""
    for name in WORKLOADS if "all" in workloads else workloads:
        machine = probe(threads)
        for line in machine.lines():
            click.echo(line)
        found = hold(name, machine, quick=quick, turns=turns, threads=threads, only=only, case=case)
        if page is not None:
            write(page, name, section(found, machine))


def hold(
    name: str, machine: Machine, *, quick: bool, turns: int, threads: int, only: str = "", case: str = ""
) -> list[Table]:
    """Hold the races of a workload, and show their tables."""
    workload = import_module(f"benchmarks.workloads.{name}")
    if hasattr(workload, "table"):
        found = [workload.table(quick, turns, click.echo)]
    else:
        results = []
        for race in workload.races(quick):
            if case.lower() in f"{race.title}, {race.case}".lower():
                click.echo(f"{race.title}, {race.case} ...")
                results += run(race, turns, threads, only, click.echo)
        found = tables(results, machine)
    for table in found:
        table.show()
    return found


if __name__ == "__main__":
    main()
