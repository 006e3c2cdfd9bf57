"""Settings that are changed while a scene runs: solver, step, switches, and their text."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.viewer.inputs import Restore, Solve, Toggle, Turn
from pointmass.viewer.live import Live, replay
from pointmass.viewer.messages import Parameter
from pointmass.viewer.setup import Setup
from pointmass.viewer.subject import Subject

START, SPEED = (0.3, 1.0, -0.2), (1.0, 0.5, 0.0)


def thrown(**values):
    """A particle in the air, above a floor."""
    body = pm.body_of(pm.Particles([START], v=[SPEED], m=2.0))
    forces = [pm.Gravity(), pm.Drag(0.5)]
    scene = pm.Scene(bodies=[body], forces=forces, colliders=[pm.Plane()], **{"dt": 1 / 240, **values})
    live = Live(Subject.of_scene(scene))
    live.start()
    return live


def cloth():
    live = Live(Subject.of_shipped(SCENES["cloth"](particles=8)))
    live.start()
    return live


def state(live):
    return live.sim.system.get_state()


@pytest.mark.parametrize("solver", ["rk4", "leapfrog", "implicit_euler", "xpbd", "dopri5", "bdf2"])
def test_another_solver_and_step_go_on_from_the_state_as_it_is(solver):
    live = thrown()
    live.advance(1.0)
    time, before = live.sim.t, state(live)
    assert live.apply(Solve(solver, 0.002)) is None
    assert (live.solver, live.dt, live.sim.t) == (solver, 0.002, time)
    np.testing.assert_array_equal(state(live), before)
    other = pm.ParticleSystem(pm.Particles([before[:3]], v=[before[3:]], m=2.0), [pm.Gravity(), pm.Drag(0.5)])
    other.t = time
    sim = pm.Simulation(other, solver=solver, dt=0.002)
    sim.step(20)
    live.sim.step(20)
    assert live.sim.t == sim.t
    np.testing.assert_allclose(state(live), other.get_state(), rtol=1e-12, atol=1e-14)


def test_a_short_step_is_as_exact_as_its_solver():
    """x'' = -g: RK4 is exact, whatever the step, so a change of the step on the way changes nothing."""
    live = thrown(solver=pm.RK4())
    live.apply(Toggle("forces.1", False))  # the drag
    for dt in (0.01, 0.003, 0.0):
        live.apply(Solve("", dt))
        live.sim.step(7)
    t = live.sim.t
    assert t == pytest.approx(7 * (0.01 + 0.003 + 1 / 240))
    exact = np.array(START) + t * np.array(SPEED) - (0, 9.81 / 2 * t * t, 0)
    np.testing.assert_allclose(live.sim.system.particles.x[0], exact, atol=1e-12)


def test_a_force_is_switched_off_and_on():
    live = thrown()
    assert [(s.name, s.label, s.on) for s in live.switches] == [
        ("forces.0", "gravity", True),
        ("forces.1", "drag", True),
        ("colliders.0", "plane", True),
    ]
    live.apply(Toggle("forces.0", False))
    live.apply(Toggle("forces.1", False))
    live.sim.run(1.0)
    np.testing.assert_array_equal(live.sim.system.particles.v[0], SPEED)
    assert [s.on for s in live.switches] == [False, False, True]
    live.apply(Toggle("forces.0", True))
    live.sim.run(0.1)
    assert live.sim.system.particles.v[0, 1] < 0


def test_a_collider_is_switched_off_and_on():
    live = thrown()
    live.apply(Toggle("colliders.0", False))
    live.sim.run(2.0)
    below = live.sim.system.particles.x[0, 1]
    assert below < -1
    live = thrown()
    live.apply(Toggle("colliders.0", False))
    live.apply(Toggle("colliders.0", True))
    live.sim.run(2.0)
    assert live.sim.system.particles.x[0, 1] > -1e-3


def test_springs_of_a_body_are_switched_off():
    live = cloth()
    name = next(s.name for s in live.switches if "shear" in s.label)
    assert name.startswith("bodies.0.forces.")
    assert live.apply(Toggle(name, False)) is None
    off = [f.family for f in live.sim.system.forces if not f.enabled]
    assert off == ["shear"]
    with pytest.raises(InvalidInput, match="shear"):
        live.text()
    live.apply(Toggle(name, True))
    assert all(f.enabled for f in live.sim.system.forces)
    assert "shear" not in live.text()


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        (Solve("no such", 0.0), "no such"),
        (Solve("rk4", -1.0), "dt"),
        (Toggle("zones.0", True), "zones.0"),
    ],
)
def test_what_is_not_allowed_changes_nothing(what, sentence):
    live = thrown()
    with pytest.raises(InvalidInput, match=sentence):
        live.apply(what)
    assert live.setup == Setup()
    assert live.recording.inputs == []
    live.advance(1.0)


def test_a_flow_offers_the_solvers_that_it_can_have():
    live = Live(Subject.of_shipped(SCENES["flow"]()))
    assert "rk4" in live.solvers
    assert not {"leapfrog", "symplectic_euler", "yoshida4", "xpbd"} & set(live.solvers)
    for name in ("leapfrog", "xpbd"):
        with pytest.raises(InvalidInput, match="flow"):
            live.apply(Solve(name, 0.0))
    assert set(thrown().solvers) == set(pm.solvers.SOLVERS)


def test_the_recommended_step_is_that_of_the_stability():
    live = cloth()
    live.apply(Solve("symplectic_euler", 0.0))
    found = live.recommended()()
    assert found == live.sim.system.stability("symplectic_euler").largest_safe_dt
    assert 0 < found < 0.1


def changes():
    """Of a cloth."""
    yield Solve("rk4", 1 / 2000)
    yield Toggle("forces.0", False)
    yield Turn({"gravity": 3.0})
    yield Restore(Setup(parameters={"gravity": 5.0}, solver="leapfrog"))
    yield Solve("", 0.0)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_formula_is_changed_while_it_runs(compiled, monkeypatch):
    """x' = c x: a particle goes on from where it is, by the new formula."""
    monkeypatch.setenv("POINTMASS_ENGINE", "compiled" if compiled else "reference")

    def build(settings):
        flow = pm.Flow((f"{settings.get('c', 1.0)!r}*x", "0"))
        return pm.Scene(bodies=[pm.body_of(pm.Particles([[1.0, 0.0, 0.0]]))], forces=[flow], solver=pm.RK4(), dt=1e-2)

    rate = Parameter(name="c", summary="", unit="1/s", value=1.0, minimum=None, maximum=None, whole=False, choices=[])
    subject = Subject("growth", "", build, (rate,))
    live = Live(subject)
    live.start()
    live.sim.step(50)
    what = Turn({"c": -2.0})
    job = live.prepare(what)
    assert (job is not None) == compiled
    if job is not None:
        job()
    assert live.apply(what) is None
    live.sim.step(50)
    assert live.sim.t == pytest.approx(1.0)
    np.testing.assert_allclose(live.sim.system.particles.x[0, 0], np.exp(0.5 - 1.0), rtol=1e-8)
    assert "-2.0*x" in live.text()
    again = replay(subject, live.recording, live.steps)
    assert again.system.get_state().tobytes() == state(live).tobytes()


def test_changes_of_settings_replay_to_the_same_bits():
    live = cloth()
    for what in changes():
        live.advance(0.7)
        assert live.apply(what) is None
    live.advance(1.0)
    again = replay(Subject.of_shipped(SCENES["cloth"](particles=8)), live.recording, live.steps)
    assert again.t == live.sim.t > 0
    assert again.system.get_state().tobytes() == state(live).tobytes()


def test_the_text_is_the_scene_as_it_is_set():
    live = thrown()
    live.apply(Solve("rk4", 0.002))
    live.apply(Toggle("forces.1", False))
    live.apply(Toggle("colliders.0", False))
    scene = Scene.from_toml(live.text())
    assert (scene.solver.name, scene.dt) == ("rk4", 0.002)
    assert [f.enabled for f in scene.forces] == [True, False]
    assert list(scene.colliders) == []
    sim = scene.simulation()
    sim.step(100)
    live = Live(Subject.of_scene(scene))
    live.sim.step(100)
    np.testing.assert_array_equal(sim.system.get_state(), state(live))


def test_the_text_has_the_parameters_of_now():
    live = cloth()
    live.apply(Turn({"gravity": 3.0, "particles": 9}))
    scene = Scene.from_toml(live.text())
    assert len(scene.bodies[0].particles) == 81
    assert scene == SCENES["cloth"](particles=9, gravity=3.0).build()


@pytest.mark.parametrize("name", ["pendulum", "flow", "orbit", "smoke"])
def test_shipped_scenes_have_a_text(name):
    live = Live(Subject.of_shipped(SCENES[name]()))
    assert Scene.from_toml(live.text()) == SCENES[name]().build()
