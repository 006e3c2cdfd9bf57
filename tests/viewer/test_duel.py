from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.frame import Points, Segments
from pointmass.scenes import SCENES
from pointmass.viewer.duel import Duel, distance, entries
from pointmass.viewer.inputs import Hold, LetGo, Turn
from pointmass.viewer.instruments import Instruments
from pointmass.viewer.messages import Inspect, Lens, Vectors
from pointmass.viewer.subject import Subject


def pendulum(**settings):
    return Subject.of_shipped(SCENES["pendulum"](links=2, **settings))


def oscillator(k_s=400.0, dt=1 / 120):
    """A mass on a spring: x'' = -k_s x with m = 1."""
    scene = pm.Scene(bodies=[pm.body_of(pm.Particles([(1.0, 0, 0)]))], forces=[pm.Harmonic(k_s)], dt=dt)
    return Subject.of_scene(scene)


def run(duel, frames):
    frame = duel.start()
    for _ in range(frames):
        frame = duel.advance(1.0)
    return frame


def test_a_text_names_solvers_and_steps():
    found = entries("euler, rk4@0.01,rk4@1/240")
    assert [(e.name, e.solver.name, e.dt) for e in found] == [
        ("euler", "euler", None),
        ("rk4@0.01", "rk4", 0.01),
        ("rk4@1/240", "rk4", 1 / 240),
    ]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "euler,",
        "euler,euler",
        "a,b",
        "rk4@0",
        "rk4@x",
        "rk4@1/0",
        "rk4@-1",
        "rk4@",
        "euler,rk4,heun,midpoint,leapfrog",
    ],
)
def test_what_names_none_is_refused(text):
    with pytest.raises(InvalidInput):
        entries(text)


def test_each_runs_as_it_would_alone():
    duel = Duel(pendulum(), entries("symplectic_euler,rk4@1/120"))
    frame = run(duel, 6)
    for (solver, dt), sim in zip([(pm.SymplecticEuler(), duel.dt), (pm.RK4(), 1 / 120)], duel.sims, strict=False):
        alone = SCENES["pendulum"](links=2).build().changed(solver=solver, dt=dt).simulation()
        *_, last = alone.frames(7, 60)
        assert sim.system.get_state().tobytes() == alone.system.get_state().tobytes()
        assert last.time == pytest.approx(frame.time)


def test_the_error_is_that_of_the_closed_form():
    duel = Duel(oscillator(), entries("euler,symplectic_euler,rk4"))
    run(duel, 10)
    t = duel.sims[0].t
    exact = math.cos(20.0 * t)
    assert duel.sims[-1].system.particles.x[0, 0] == pytest.approx(exact, abs=1e-9)  # the reference
    *others, reference = duel.contenders
    for side, sim in zip(others, duel.sims, strict=False):
        assert side.error == pytest.approx(abs(sim.system.particles.x[0, 0] - exact), abs=1e-2 * side.error + 1e-9)
        assert side.energy == sim.quantities()["energy"]
        assert side.cost > 0
    assert reference.error is None
    assert others[0].error > others[1].error > 10 * others[2].error


def test_the_distance_is_that_of_those_whom_both_have():
    sims = [pm.Simulation(pm.ParticleSystem(pm.Particles(np.eye(3) * k))) for k in (1.0, 3.0)]
    sims[0].system.remove([0])
    sims[1].system.remove([2])
    assert distance(*(sim.frame() for sim in sims)) == pytest.approx(2.0)
    sims[0].system.remove([0])
    assert math.isnan(distance(*(sim.frame() for sim in sims)))


def test_who_diverges_stays_and_the_others_go_on():
    duel = Duel(oscillator(k_s=1e6), entries("euler,implicit_euler"))
    frame = run(duel, 40)
    first, second, _ = duel.contenders
    assert first.ended
    assert np.abs(frame.positions).max() < 10  # what blew up is not where the camera looks
    assert not [d for d in frame.drawables if d.name.startswith("euler/")]
    assert second.ended == ""
    assert duel.sims[1].t == pytest.approx(40 / 60, abs=0.009)
    duel.start()
    assert duel.contenders[0].ended == ""


def test_parameters_and_grabs_act_on_all():
    duel = Duel(pendulum(), entries("leapfrog,rk4"))
    run(duel, 2)
    assert duel.apply(Turn({"gravity": 3.0})) is None
    for sim in duel.sims:
        gravity = next(f for f in sim.system.forces if f.name == "gravity")
        assert gravity.parameters["g"].components[1].value == -3.0
    frame = duel.advance(1.0)
    n = len(duel.sims[0].system.particles)
    row = n + 2  # of the second, at its own place
    target = tuple(frame.positions[row] + (0.1, 0, 0))
    duel.apply(Hold(int(frame.ids[row]), target))
    assert duel.held == row
    np.testing.assert_allclose(duel.target, target)
    centers = [[c.value for c in sim.system.forces[-1].parameters["center"].components] for sim in duel.sims]
    np.testing.assert_allclose(centers, [np.subtract(target, duel._sides[1].offset)] * 3)
    duel.apply(LetGo())
    assert duel.held == -1
    frame = duel.apply(Turn({"links": 3}))
    assert frame.time == 0
    assert len(frame.positions) == 3 * 4


def test_all_are_in_one_frame():
    duel = Duel(pendulum(), entries("leapfrog,rk4"))
    frame = run(duel, 3)
    n = len(duel.sims[0].system.particles)
    parts = [side.frame for side in duel._sides]
    for k, part in enumerate(parts):
        rows = slice(k * n, (k + 1) * n)
        shift = frame.positions[rows] - part.positions
        np.testing.assert_allclose(shift, np.tile(shift[0], (n, 1)), atol=1e-12)
        points = next(
            d for d in frame.drawables if isinstance(d, Points) and d.name.startswith(f"{duel._sides[k].name}/")
        )
        np.testing.assert_array_equal(points.index, np.arange(k * n, (k + 1) * n))
        lines = next(
            d for d in frame.drawables if isinstance(d, Segments) and d.name.startswith(f"{duel._sides[k].name}/")
        )
        own = next(d for d in part.drawables if isinstance(d, Segments))
        np.testing.assert_array_equal(lines.pairs, own.pairs + k * n)
    apart = frame.positions[n : n + 1] - frame.positions[:1]
    assert np.linalg.norm(apart) > 1
    over = duel.arrange(False)
    np.testing.assert_array_equal(over.positions, np.concatenate([p.positions for p in parts]))
    assert {d.name for d in over.drawables} == {d.name for d in frame.drawables}


def test_instruments_look_at_all_of_them():
    duel = Duel(pendulum(), entries("leapfrog,rk4"))
    instruments = Instruments(duel)
    frame = run(duel, 3)
    n = len(duel.sims[0].system.particles)
    assert instruments.take(Inspect(sequence=1, row=n + 2), frame, n + 2)
    assert instruments.take(Lens(name="stretch"), frame, -1)
    shown, readings = instruments.look(frame, fresh=True)
    assert readings.inspected.row == n + 2
    assert readings.inspected.springs == 1
    lines = next(d for d in shown.drawables if d.name == "springs of the picked particle")
    np.testing.assert_array_equal(lines.pairs, [[n + 1, n + 2]])
    assert len(next(d for d in shown.drawables if d.name == "springs under the lens").pairs) == 3 * 2
    rows = readings.tracks[0].since(None)
    columns = [(c.plot, c.name) for c in rows.columns]
    errors = {c.name: c.error for c in duel.contenders if c.error is not None}
    for name, error in errors.items():
        assert rows.data[-1, 1 + columns.index(("error", name))] == pytest.approx(error)
    assert ("energy", "reference") in columns


def test_forces_are_those_at_a_particles_own_place_wherever_it_is_shown():
    duel = Duel(oscillator(k_s=9.0), entries("leapfrog,rk4"))
    instruments, frame = Instruments(duel), run(duel, 3)
    assert len({x for x, _, _ in frame.positions.tolist()}) == 3  # beside each other
    assert instruments.take(Vectors(name="force", on=True), frame, -1)
    shown, _ = instruments.look(frame, fresh=True)
    vectors = next(d for d in shown.drawables if d.name == "force arrows").vectors
    own = np.concatenate([sim.system.particles.x for sim in duel.sims])
    np.testing.assert_allclose(vectors / vectors[0, 0], own / own[0, 0], atol=1e-6)
