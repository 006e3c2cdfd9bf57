"""`pointmass check`."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pointmass.cli.options import RunOptions, as_json, load_scene, run_options
from pointmass.cli.report import finite
from pointmass.errors import InvalidInput
from pointmass.forces.gravity import Gravity
from pointmass.laws.elements import ElementForce
from pointmass.stability import stability

if TYPE_CHECKING:
    from pointmass.element_motion import ElementMotions
    from pointmass.laws.force import Force
    from pointmass.scene import Scene
    from pointmass.simulation import Simulation
    from pointmass.stability import Stability

FAMILIES = 4  # of elements that are printed
SENSIBLE = 200  # substeps in a frame, beyond which an implicit solver is cheaper


@click.command("check")
@click.argument("scene")
@click.option("--picture", help="Draw it too: eigenvalues in the solver's plane, springs coloured (a .png).")
@run_options
@as_json
def command(scene: str, picture: str | None, as_json: bool, **values: Any) -> None:
    """Say whether the step of SCENE is small enough, from its stiffest motion and the solver's limits.

    For springs, joints and other elements it says how near each family is to the limit, alone and with what its
    neighbours add, and which of them carry the motion that limits the step.
    """
    loaded = load_scene(scene, RunOptions(**values))
    if picture is not None:
        _check_picture(Path(picture))
    simulation, found, counts = at_start(loaded)
    if picture is not None:
        _draw(Path(picture), simulation, found, loaded)
    result = report(loaded, simulation, found, counts)
    click.echo(json.dumps(result, allow_nan=False) if as_json else _text(result, found))


def at_start(scene: Scene) -> tuple[Simulation, Stability, dict[str, int]]:
    """A scene at its start, with the first particle of each emitter; its stability, and what there is without them."""
    simulation = scene.simulation()
    system = simulation.system
    springs = sum(len(f.ids) for f in system.forces if isinstance(f, ElementForce) and f.nodes == 2)
    counts = {"particles": len(system.particles), "springs": springs}
    counts |= {"forces": len(system.forces), "emitters": len(simulation.emitters)}
    _add_first_births(simulation, math.ceil((scene.frames - 1) / scene.fps / simulation.dt))
    return simulation, stability(system, simulation.solver), counts


def _check_picture(path: Path) -> None:
    """Refuse what cannot be written before anything is computed."""
    from pointmass.render import check_write
    from pointmass.render.film import is_single

    if not is_single(path):
        raise InvalidInput(f"--picture {str(path)!r} is not allowed: it is one picture, such as stability.png")
    check_write(path)


def _draw(path: Path, simulation: Simulation, found: Stability, scene: Scene) -> None:
    from PIL import Image

    from pointmass.cli.compiling import compiling_said
    from pointmass.stability_picture import stability_picture

    with compiling_said(quiet=False):
        Image.fromarray(stability_picture(simulation, found, scene.camera)).save(path, format="PNG")


def report(scene: Scene, simulation: Simulation, found: Stability, counts: dict[str, int]) -> dict[str, Any]:
    """The stability of a scene as numbers for JSON; None where a number is unlimited."""
    dt, largest = simulation.dt, found.largest_safe_dt
    recommended = float(f"{0.95 * largest:.2g}") if 0.0 < largest < math.inf else None
    substeps = math.ceil(1 / (scene.fps * recommended)) if recommended else None
    return {
        "scene": scene.name,
        "solver": found.solver,
        "solver_reason": simulation.solver_reason or None,
        "dt": dt,
        "largest_safe_dt": finite(largest),
        "recommended_dt": recommended,
        "recommended_substeps": substeps,
        "frequency": finite(found.frequency),
        "damping_ratio": finite(found.damping_ratio),
        "period": finite(found.period),
        "safe": bool(dt <= largest),
        **counts,
        "families": _families(found, dt),
        "carriers": [{"name": str(e), **asdict(e)} for e in found.carriers()],
        "warning": _unheld(simulation),
    }


def _families(found: Stability, dt: float) -> list[dict[str, Any]]:
    """What elements of one name have in common, those nearest to the limit first."""
    tables: dict[tuple[str, str], list[ElementMotions]] = {}
    for table in found.elements:
        tables.setdefault((table.force, table.family), []).append(table)
    rows = []
    for (force, family), group in tables.items():
        speed, ratio, alone, together = (
            np.concatenate(columns)
            for columns in zip(
                *((t.frequency, t.damping_ratio, t.share(dt), t.share_together(dt)) for t in group), strict=True
            )
        )
        worst = int(np.lexsort((speed, together))[-1])
        row = {"force": force, "family": family, "count": len(speed), "omega_dt": float(speed.max() * dt)}
        row |= {"damping_ratio": finite(float(ratio[worst]))}
        row |= {"share": finite(float(alone.max())), "part": float(sum(t.part.sum() for t in group))}
        rows.append((float(together.max()), row))
    rows.sort(key=lambda row: -row[0])
    return [row | {"share_together": finite(together)} for together, row in rows]


def _unheld(simulation: Simulation) -> str | None:
    """What there is to say if nothing ever stops a fall."""
    system = simulation.system
    falls = any(isinstance(f, Gravity) and f.enabled for f in system.forces)
    held = system.particles.pinned.any() or system.colliders or any(map(_holds, system.forces))
    if not falls or held or simulation.zones or not len(system.particles):
        return None
    return "gravity acts, but nothing is pinned and there is no floor: everything falls for ever"


def _holds(force: Force) -> bool:
    """Whether a force may hold particles at a place: it depends on where they are, not only on where others are."""
    return force.enabled and not force.internal and any("x" in law.depends_on for law in force.laws)


def _add_first_births(simulation: Simulation, steps: int) -> None:
    """Add to the start the first particle that each emitter makes within so many steps."""
    waiting = {k for k, emitter in enumerate(simulation.emitters) if not emitter.of}
    for step in range(steps):
        for k, birth in enumerate(simulation.births(step)):
            if k in waiting and len(birth.number):
                columns = {name: np.ravel(column)[0] for name, column in birth.columns.items()}
                simulation.system.add(birth.x[:1], birth.v[:1], id=birth.ids(k)[:1], **columns)
                waiting.remove(k)
        if not waiting:
            return


def _text(result: dict[str, Any], found: Stability) -> str:
    counts = {name: result[name] for name in ("particles", "springs", "forces", "emitters")}
    lines = [
        ("scene", result["scene"]),
        ("at the start", ", ".join(f"{n} {name if n != 1 else name[:-1]}" for name, n in counts.items())),
        ("fastest motion", found.motion),
        *(("" if k else "carried by", line) for k, line in enumerate(_carriers(result))),
        *(("" if k else "elements", line) for k, line in enumerate(_table(result["families"]))),
        ("solver", result["solver_reason"] or result["solver"]),
        ("dt", f"{result['dt']:.4g} s"),
        ("largest safe dt", _largest(result)),
        ("verdict", _verdict(result)),
    ]
    if result["warning"]:
        lines.append(("warning", result["warning"]))
    return "\n".join(f"{name:<16} {value}" for name, value in lines)


def _carriers(result: dict[str, Any]) -> list[str]:
    return [f"{each['name']}: {100 * each['part']:.3g} % of its energy" for each in result["carriers"]]


def _table(families: list[dict[str, Any]]) -> list[str]:
    """The families nearest to the limit as rows under a head."""
    if not families:
        return []
    wide = max(8, *(len(row["family"]) for row in families[:FAMILIES]))
    rows = [
        f"{'family':<{wide}} {'count':>8} {'omega dt':>9} {'damping':>8} {'alone':>7} {'together':>9} {'carries':>8}"
    ]
    for row in families[:FAMILIES]:
        ratio = "inf" if row["damping_ratio"] is None else f"{row['damping_ratio']:.3g}"
        alone, together = ("any" if row[k] is None else f"{100 * row[k]:.0f} %" for k in ("share", "share_together"))
        number = f"{row['family']:<{wide}} {row['count']:>8} {row['omega_dt']:>9.3g} {ratio:>8}"
        rows.append(f"{number} {alone:>7} {together:>9} {100 * row['part']:>6.3g} %")
    if len(families) > FAMILIES:
        rows.append(f"and {len(families) - FAMILIES} more")
    return [*rows, "(alone, together with neighbours: of the largest safe dt; carries: of the fastest motion's energy)"]


def _largest(result: dict[str, Any]) -> str:
    if result["largest_safe_dt"] is None:
        return "any"
    text = f"{result['largest_safe_dt']:.4g} s"
    if result["recommended_dt"] is not None:
        substeps = result["recommended_substeps"]
        text += f"; recommended {result['recommended_dt']:g} s, {substeps} substep{'s' if substeps > 1 else ''} a frame"
    return text


def _verdict(result: dict[str, Any]) -> str:
    solver, substeps = result["solver"], result["recommended_substeps"]
    if result["safe"]:
        return "safe"
    if substeps is None:
        return f"not safe: {solver} amplifies this motion at any dt; use --solver rk4 or --solver implicit_euler"
    if substeps > SENSIBLE:
        return (
            f"not safe: {solver} would need {substeps} substeps in each frame; "
            "use --solver implicit_euler, which takes steps of any length"
        )
    return f"not safe: use --dt {result['recommended_dt']:g} or --substeps {substeps}, or --solver implicit_euler"
