"""`pointmass check`."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pointmass.cli.options import RunOptions, as_json, load_scene, run_options
from pointmass.cli.report import finite

if TYPE_CHECKING:
    from pointmass.scene import Scene
    from pointmass.simulation import Simulation


@click.command("check")
@click.argument("scene")
@run_options
@as_json
def command(scene: str, as_json: bool, **values: Any) -> None:
    """Say whether the step of SCENE is small enough, from its stiffest motion and the solver's limits."""
    loaded = load_scene(scene, RunOptions(**values))
    result = stability_report(loaded)
    if as_json:
        click.echo(json.dumps(result, allow_nan=False))
    else:
        click.echo(_text(result, loaded.fps))


def stability_report(scene: Scene) -> dict[str, Any]:
    """The stability of a scene at its start, as numbers for JSON; None where a number is unlimited.

    Besides the particles that are there, it looks at the first one of each emitter.
    """
    from pointmass.laws.elements import ElementForce
    from pointmass.stability import stability

    simulation = scene.simulation()
    system, solver = simulation.system, simulation.solver
    particles = len(system.particles)
    _add_first_births(simulation, math.ceil((scene.frames - 1) / scene.fps / simulation.dt))
    found = stability(system, solver)
    springs = sum(len(f.ids) for f in system.forces if isinstance(f, ElementForce) and f.nodes == 2)
    return {
        "scene": scene.name,
        "solver": solver.name,
        "dt": simulation.dt,
        "largest_safe_dt": finite(found.largest_safe_dt),
        "frequency": finite(found.frequency),
        "damping_ratio": finite(found.damping_ratio),
        "period": finite(found.period),
        "safe": bool(simulation.dt <= found.largest_safe_dt),
        "particles": particles,
        "springs": springs,
        "forces": len(system.forces),
        "emitters": len(simulation.emitters),
    }


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


def _text(result: dict[str, Any], fps: float) -> str:
    largest, motion = result["largest_safe_dt"], "nothing swings or decays"
    if result["frequency"]:
        motion = f"{result['frequency']:.4g} rad/s, period {result['period']:.4g} s"
        motion += f", damping ratio {result['damping_ratio']:.3g}"
    counts = {name: result[name] for name in ("particles", "springs", "forces", "emitters")}
    parts = (f"{n} {name if n != 1 else name[:-1]}" for name, n in counts.items())
    lines = {
        "scene": result["scene"],
        "at the start": ", ".join(parts),
        "fastest motion": motion,
        "solver": result["solver"],
        "dt": f"{result['dt']:.4g} s",
        "largest safe dt": "any" if largest is None else f"{largest:.4g} s",
        "verdict": _verdict(result, fps),
    }
    return "\n".join(f"{name:<16} {value}" for name, value in lines.items())


def _verdict(result: dict[str, Any], fps: float) -> str:
    largest, solver = result["largest_safe_dt"], result["solver"]
    if result["safe"]:
        return "safe"
    if largest == 0:
        return f"not safe: {solver} amplifies this motion at any dt; use --solver rk4 or --solver implicit_euler"
    rounded = float(f"{0.95 * largest:.2g}")
    substeps = math.ceil(1 / (fps * rounded))
    return f"not safe: use --dt {rounded:g} or --substeps {substeps}, or --solver implicit_euler"
