"""`solver="auto"`: which solver is chosen, and that it says why."""

import logging

import pytest
from click.testing import CliRunner

import pointmass as pm
from pointmass.cli import main

K, M = 400.0, 0.01  # a mass on a spring swings with omega = 200 /s: steps of symplectic_euler up to 0.01 s


def spring(*forces: pm.Force, gap: float = 1.0) -> pm.ParticleSystem:
    particles = pm.Particles([[0, 0, 0], [1, 0, 0], [1 + gap, 0, 0]], m=M, radius=0.25)
    particles.pin(0)
    return pm.ParticleSystem(particles, [pm.Gravity(), pm.Springs([(0, 1)], k_s=K), *forces])


@pytest.mark.parametrize(("dt", "solver"), [(0.0099, "symplectic_euler"), (0.0101, "implicit_euler")])
def test_the_limit_decides(dt: float, solver: str) -> None:
    sim = pm.Simulation(spring(), "auto", dt)
    assert sim.solver.name == solver
    assert sim.solver_reason.startswith(f"{solver}, because")
    assert "0.01 s" in sim.solver_reason
    assert f"dt is {dt:.3g} s" in sim.solver_reason


def test_pairs_suit_no_implicit_solver() -> None:
    soft = pm.SoftSphere(0.1)
    assert pm.Simulation(spring(soft), "auto", 0.02).solver.name == "xpbd"
    stiff = pm.SoftSphere(1e4)
    assert pm.Simulation(spring(stiff, gap=0.4), "auto", 0.02, compiled=False).solver.name == "implicit_euler"


def test_a_flow_gets_rk4_and_nobody_else_a_reason() -> None:
    flow = pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Vortex()])
    assert pm.Simulation(flow, "auto").solver.name == "rk4"
    assert pm.Simulation(spring()).solver_reason == ""


def test_it_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "pointmass"):
        sim = pm.Simulation(spring(), "auto", 0.02)
    assert f"solver {sim.solver_reason}" in caplog.messages


def test_a_scene_keeps_the_wish_as_text() -> None:
    scene = pm.Scene(bodies=[pm.cloth(5, 5, pinned="corners")], solver="auto", dt=1 / 60)
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.solver == "auto"
    assert again.simulation().solver.name == "implicit_euler"


def test_the_command_line_says_what_it_chose(tmp_path) -> None:
    run = ["run", "pendulum", "--solver", "auto", "--frames", "2", "-o", str(tmp_path / "p.zarr")]
    result = CliRunner().invoke(main, run)
    assert result.exit_code == 0
    assert "pointmass: solver symplectic_euler, because it costs least" in result.output
    checked = CliRunner().invoke(main, ["check", "pendulum", "--solver", "auto"])
    assert "symplectic_euler, because it costs least" in checked.output
