"""`pointmass list`."""

from __future__ import annotations

import json
import sys
from typing import Any

import click


@click.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print the scenes and their parameters as JSON.")
def command(as_json: bool) -> None:
    """List scenes with their parameters, solvers and forces."""
    from pointmass.scenes import SCENES

    scenes = [{"name": n, "summary": s.summary(), "parameters": s.parameters()} for n, s in SCENES.items()]
    if as_json:
        click.echo(json.dumps({"scenes": scenes}))
    else:
        _print_tables(scenes)


def _print_tables(scenes: list[dict[str, Any]]) -> None:
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
    with console.capture() as capture:
        _print_all(console, scenes)
    click.echo(capture.get(), nl=False)


def _print_all(console: Any, scenes: list[dict[str, Any]]) -> None:
    from pointmass.forces import FORCES
    from pointmass.solvers import ALIASES, SOLVERS

    console.print("[bold]Scenes[/], with the parameters that --set changes")
    for scene in scenes:
        _print_scene(console, scene)
    aliases: dict[str, list[str]] = {}
    for alias, name in ALIASES.items():
        aliases.setdefault(name, []).append(alias)
    known = [f"{name} ({', '.join(aliases[name])})" if name in aliases else name for name in SOLVERS]
    console.print(f"\n[bold]Solvers[/]\n  {', '.join(known)}")
    console.print(f"\n[bold]Forces[/] of scene files\n  {', '.join(FORCES)}")


def _print_scene(console: Any, scene: dict[str, Any]) -> None:
    from rich.markup import escape
    from rich.table import Table

    console.print(f"\n[bold cyan]{scene['name']}[/]  {escape(scene['summary'])}")
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 2))
    for parameter in scene["parameters"]:
        default = f"{parameter['default']} {parameter['unit']}".strip()
        table.add_row(parameter["name"], escape(default), escape(parameter["summary"] + _range(parameter)))
    console.print(table)


def _range(parameter: dict[str, Any]) -> str:
    if parameter["choices"]:
        return f" ({', '.join(parameter['choices'])})"
    low, high = parameter["minimum"], parameter["maximum"]
    bounds = [f"{low:g}" if low is not None else "", f"{high:g}" if high is not None else ""]
    return f" [{bounds[0]} .. {bounds[1]}]" if any(bounds) else ""
