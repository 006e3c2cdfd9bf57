"""`pointmass list`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import click

from pointmass.errors import unknown

KINDS = {
    "bodies": "body",
    "forces": "force",
    "colliders": "collider",
    "emitters": "emitter",
    "zones": "zone",
    "motions": "motion",
    "constraints": "constraint",
    "controllers": "controller",
    "solver": "solver",
}
COMMON = {  # parameters that most types have and few explain
    "on": "the group that it acts on; all particles by default",
    "enabled": "false switches it off",
}
Entry = dict[str, Any]


@click.command("list")
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")
def command(name: str | None, as_json: bool) -> None:
    """List what there is: scenes with their parameters, and the types that a scene file may hold.

    With a NAME, such as nozzle, drag, leapfrog, camera or look: explain it, with its parameters.
    """
    if name is not None:
        entries = _named(name)
        if as_json:
            click.echo(json.dumps({"entries": entries}))
        else:
            _print(_explain, entries)
        return
    scenes = _scenes()
    if as_json:
        click.echo(json.dumps({"scenes": scenes}))
    else:
        _print(_print_all, scenes)


def _scenes() -> list[Entry]:
    from pointmass.scenes import SCENES

    return [
        {"name": n, "summary": s.summary(), "parameters": s.parameters(), "presets": s.presets}
        for n, s in SCENES.items()
    ]


def _named(name: str) -> list[Entry]:
    """Everything of this name: a scene and a type may share it."""
    from pointmass.registries import LISTS
    from pointmass.schema import entry_model, settings_model
    from pointmass.solvers import ALIASES, SOLVERS

    found = [{"kind": "scene", **scene} for scene in _scenes() if scene["name"] == name]
    for what, registry in {**LISTS, "solver": SOLVERS}.items():
        wanted = ALIASES.get(name, name) if what == "solver" else name
        if wanted in registry:
            found.append({"kind": KINDS[what], "name": wanted, **_described(entry_model(what, wanted))})
    if name in ("camera", "look"):
        found.append({"kind": "table", "name": name, **_described(settings_model(name))})
    if not found:
        types = [n for registry in (*LISTS.values(), SOLVERS, ALIASES) for n in registry]
        raise unknown("name", name, {*types, *(s["name"] for s in _scenes()), "camera", "look"})
    return found


def _described(model: Any) -> Entry:
    """Summary and parameters of a type, from the form of scene files."""
    schema = model.model_json_schema()
    parameters = [
        {
            "name": name,
            "default": form.get("default"),
            "required": name in schema.get("required", ()),
            "summary": form.get("description", COMMON.get(name, "")).rstrip("."),
        }
        for name, form in schema["properties"].items()
        if name != "type"
    ]
    return {"summary": schema.get("description", "").rstrip("."), "parameters": parameters}


# ------------------------------------------------------------------------------------------------------- for people


def _print(show: Any, what: Any) -> None:
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
    with console.capture() as capture:
        show(console, what)
    click.echo(capture.get(), nl=False)


def _print_all(console: Any, scenes: list[Entry]) -> None:
    from pointmass.registries import LISTS
    from pointmass.solvers import ALIASES, SOLVERS

    console.print("[bold]Scenes[/], with the parameters that --set changes, and presets for --preset")
    for scene in scenes:
        console.print(f"\n[bold cyan]{scene['name']}[/]  {_plain(scene['summary'])}")
        _print_rows(console, _scene_rows(scene))
    aliases: dict[str, list[str]] = {}
    for alias, name in ALIASES.items():
        aliases.setdefault(name, []).append(alias)
    known = [f"{name} ({', '.join(aliases[name])})" if name in aliases else name for name in SOLVERS]
    console.print("\n[bold]Types[/] of scene files; pointmass list NAME explains one, with its parameters")
    for what, names in {**LISTS, "solvers": known, "tables": ("camera", "look")}.items():
        console.print(f"\n[bold]{what.capitalize()}[/]\n  {', '.join(names)}")


def _explain(console: Any, entries: list[Entry]) -> None:
    for entry in entries:
        article = "an" if entry["kind"][0] in "aeiou" else "a"
        console.print(f"[bold cyan]{entry['name']}[/], {article} {entry['kind']}")
        if entry["summary"]:
            console.print(f"  {_plain(entry['summary'])}")
        _print_rows(console, _scene_rows(entry) if entry["kind"] == "scene" else _type_rows(entry))


def _scene_rows(scene: Entry) -> Iterator[tuple[str, str, str]]:
    for parameter in scene["parameters"]:
        default = f"{parameter['default']} {parameter['unit']}".strip()
        yield parameter["name"], default, parameter["summary"] + _range(parameter)
    for name, settings in scene["presets"].items():
        yield f"--preset {name}", "", ", ".join(f"{key}={value}" for key, value in settings.items())


def _type_rows(entry: Entry) -> Iterator[tuple[str, str, str]]:
    for parameter in entry["parameters"]:
        default = parameter["default"]
        shown = "" if default is None else json.dumps(default)
        yield parameter["name"], "required" if parameter["required"] else shown, parameter["summary"]


def _print_rows(console: Any, rows: Iterator[tuple[str, str, str]]) -> None:
    from rich.table import Table

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 2))
    for name, default, summary in rows:
        table.add_row(name, _plain(default), _plain(summary))
    console.print(table)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


def _range(parameter: Entry) -> str:
    if parameter["choices"]:
        return f" ({', '.join(parameter['choices'])})"
    low, high = parameter["minimum"], parameter["maximum"]
    bounds = [f"{low:g}" if low is not None else "", f"{high:g}" if high is not None else ""]
    return f" [{bounds[0]} .. {bounds[1]}]" if any(bounds) else ""
