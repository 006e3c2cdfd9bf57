"""Pins that move."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.body import join
from pointmass.engine import engine, store
from pointmass.errors import InvalidInput

W, DRIVE, REACH = 6.0, 4.0, 0.1  # of the oscillator, of the motion [rad/s]; amplitude [m]


def driven(solver: str, dt: float, *, compiled: bool = False) -> pm.Simulation:
    """A mass on a spring along x, whose other end is moved by REACH sin(DRIVE t)."""
    p = pm.Particles([[-1.0, 0, 0], [0, 0, 0]], m=2.0)
    p.pin([0])
    motion = pm.RigidMotion(shift=(f"{REACH}*sin({DRIVE}*t)", 0, 0))
    system = pm.ParticleSystem(p, [pm.Springs([(0, 1)], 2 * W**2, rest=1.0)])
    return pm.Simulation(system, solver, dt, motions=[motion], compiled=compiled)


def wanted(t: float) -> float:
    """x'' = -W^2 (x - REACH sin(DRIVE t)) from rest."""
    swing = REACH * W**2 / (W**2 - DRIVE**2)
    return swing * (math.sin(DRIVE * t) - DRIVE / W * math.sin(W * t))


FIRST = ("euler", "symplectic_euler", "implicit_euler")
SECOND = ("leapfrog", "midpoint", "rk4", "implicit_midpoint", "yoshida4", "bdf2")


@pytest.mark.parametrize("solver", [*FIRST, *SECOND])
def test_a_driven_oscillator_converges_as_promised(solver: str) -> None:
    """Of order 2 a method is off by the phase (W h)^2 / 6 a radian at most, 4e-5 m of a swing of 0.2 m; bdf2 by twice
    that."""
    order, errors = 1 if solver in FIRST else 2, []
    for steps in (200, 400):
        sim = driven(solver, 1.0 / steps)
        sim.step(steps)
        errors.append(abs(sim.system.particles.x[1, 0] - wanted(1.0)))
        assert sim.system.particles.x[0, 0] == pytest.approx(-1 + REACH * math.sin(DRIVE), abs=1e-15)
        assert sim.system.particles.v[0, 0] == pytest.approx(REACH * DRIVE * math.cos(DRIVE), rel=1e-12)
    assert errors[0] / errors[1] > 0.9 * 2.0**order
    assert errors[1] < {"bdf2": 8e-5}.get(solver, 2e-3 if order == 1 else 4e-5)


def strands(dtype: str = "float64", **options: Any) -> pm.Simulation:
    body = pm.hair(10, 5, 0.2, style="wavy", curl_turns=2.0, jitter=0.0)
    particles, own = join([body], ["hair"], np.dtype(dtype))
    forces = [pm.Gravity(), pm.Drag(1e-6), *own]
    motion = pm.RigidMotion(angle="0.5*sin(9*t)", axis=(0, 1, 0.2), shift=(0, 0, "0.1*t"))
    system = pm.ParticleSystem(particles, forces)
    return pm.Simulation(system, motions=[motion], **options)


@pytest.mark.parametrize("solver", ["symplectic_euler", "leapfrog", "implicit_euler"])
def test_kernels_do_the_same(solver: str) -> None:
    one, two = (strands(solver=solver, dt=1e-3, compiled=c) for c in (False, True))
    one.step(20)
    two.step(20)
    rtol = 1e-12 if solver != "implicit_euler" else 1e-7
    np.testing.assert_allclose(one.system.particles.x, two.system.particles.x, rtol=rtol, atol=rtol)
    np.testing.assert_allclose(one.system.particles.v, two.system.particles.v, rtol=rtol, atol=10 * rtol)


def test_roots_turn_exactly_whatever_is_looked_at() -> None:
    seldom, often = (strands(dt=1 / 700, compiled=False) for _ in range(2))
    start = seldom.system.particles.x[seldom.system.particles.pinned].copy()
    for frame in often.frames(12, fps=130):  # between two steps
        t = frame.time
        axis = np.array([0, 1, 0.2]) / math.hypot(1, 0.2)
        angle = 0.5 * math.sin(9 * t)
        along = (start @ axis)[:, None] * axis
        flat = start - along
        turned = along + math.cos(angle) * flat + math.sin(angle) * np.cross(axis, flat) + (0, 0, 0.1 * t)
        np.testing.assert_allclose(frame.positions[often.system.particles.pinned], turned, atol=1e-14)
    seldom.step(often.steps)
    np.testing.assert_array_equal(seldom.system.particles.x, often.system.particles.x)


def test_the_last_step_can_be_looked_into() -> None:
    sim = strands(dt=1 / 700, compiled=True)
    sim.step(5)
    now = sim.system.get_state()
    t = 4.25 / 700
    (frame, again) = (sim.frame(t=t) for _ in range(2))
    slow = strands(dt=1 / 700, compiled=False)
    slow.step(5)
    for got in (frame, again):
        np.testing.assert_allclose(got.positions, slow.frame(t=t).positions, rtol=0, atol=1e-12)
        np.testing.assert_allclose(got.velocities, slow.frame(t=t).velocities, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(sim.system.get_state(), now)


def moved(kind: str, compiled: bool, solver: str) -> pm.Simulation:
    """Pins of two motions, and some that stay: strands, a grid, and a cloth too small for one."""
    motions = [
        pm.RigidMotion("one", angle="0.5*sin(9*t)", axis=(0, 1, 0.2), center=(0.1, 0, 0)),
        pm.RigidMotion("two", shift=("0.1*sin(20*t)", "t*t", 0)),
    ]
    made = {"strands": (pm.hair, 8, 4, 0.2), "grid": (pm.cloth, 16, 16, 0.3), "one island": (pm.cloth, 3, 6, 0.3)}
    build, *sizes = made[kind]
    body = build(*sizes) if kind == "strands" else build(*sizes, pinned="top edge")
    p = body.particles
    pinned = np.flatnonzero(p.pinned)
    p.tag("one", pinned[:2])
    p.tag("two", pinned[3:])
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Drag(1e-5), *body.forces])
    return pm.Simulation(system, solver, dt=1e-4, motions=motions, compiled=compiled)


@pytest.mark.parametrize(
    ("kind", "solver", "layout"),
    [
        ("strands", "symplectic_euler", "LanesMembers"),
        ("strands", "midpoint", "LanesMembers"),
        ("grid", "leapfrog", "LatticeMembers"),
        ("grid", "midpoint", "LatticeMembers"),
        ("one island", "leapfrog", "IslandMembers"),
        ("one island", "bdf2", "IslandMembers"),
        ("one island", "xpbd", "IslandMembers"),
        ("grid", "xpbd", "IslandMembers"),
    ],
)
def test_every_layout_does_the_same_in_any_number_of_steps(
    kind: str, solver: str, layout: str, monkeypatch: Any
) -> None:
    monkeypatch.setattr(
        store, "load", lambda *a: SimpleNamespace(**store.plain(*a))
    )  # the text of the kernels, run by Python
    monkeypatch.setattr(engine, "DEALT", 100)
    one, two, three = (moved(kind, compiled, solver) for compiled in (False, True, True))
    for sim, spans in ((one, [5]), (two, [5]), (three, [1, 4])):
        for span in spans:
            sim.step(span)
    a, b, c = (sim.system.get_state() for sim in (one, two, three))
    rtol = 1e-12 if solver != "bdf2" else 1e-7
    np.testing.assert_allclose(b, a, rtol=rtol, atol=rtol)
    np.testing.assert_array_equal(b, c)
    assert {type(group.members).__name__ for group in two.engine._grouped(None)} == {layout}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_bits_depend_on_no_thread_and_no_span(dtype: str) -> None:
    most = numba.get_num_threads()
    ends = []
    for threads, spans in ((most, [30]), (1, [30]), (most, [1, 20, 9])):
        sim = strands(dt=1e-3, compiled=True, dtype=dtype)
        numba.set_num_threads(threads)
        try:
            for span in spans:
                sim.step(span)
        finally:
            numba.set_num_threads(most)
        ends.append(sim.system.get_state())
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])
    if dtype == "float32":
        fine = strands(dt=1e-3, compiled=False)
        fine.step(30)
        np.testing.assert_allclose(ends[0], fine.system.get_state(), rtol=0, atol=1e-3)


def test_pins_move_over_a_floor_under_an_implicit_solver_on_both_paths() -> None:
    """A rope whose upper end is led lies on a floor: contacts and moving pins are in one kernel."""
    places = []
    for compiled in (False, True):
        rope = pm.chain(6, 0.5, start=(0, 0.2, 0), direction=(0.3, -1, 0), k_s=500.0)
        system = pm.ParticleSystem(rope.particles, [pm.Gravity(), *rope.forces], colliders=[pm.Plane(friction=0.2)])
        motion = pm.RigidMotion(shift=("0.5*t", 0, 0))
        sim = pm.Simulation(system, "implicit_euler", 1 / 1000, motions=[motion], compiled=compiled)
        sim.step(400)
        assert sim.engine.compiled == compiled
        places.append(system.particles.x.copy())
    assert places[0][0, 0] == pytest.approx(0.2, abs=1e-12)
    assert (places[0][:, 1] < 1e-6).any()
    np.testing.assert_allclose(places[0], places[1], atol=1e-6)


def test_a_motion_that_is_not_finite_later_on_is_named() -> None:
    p = pm.Particles([[0.0, 0, 0], [1, 0, 0]])
    p.pin([0])
    system = pm.ParticleSystem(p, [pm.Springs([(0, 1)], 1.0)])
    sim = pm.Simulation(system, motions=[pm.RigidMotion(shift=("log(0.35 - t)", 0, 0))], dt=0.1, compiled=True)
    with pytest.raises(InvalidInput, match=r"at t = 0.4 s, shift.x"):
        sim.step(10)
    assert sim.steps == 3


def test_only_changes_since_the_start_count() -> None:
    p = pm.Particles([[1.0, 0, 0]])
    p.pin([0])
    motion = pm.RigidMotion(angle=lambda t: 2.0 + t, shift=("5 + t", 1, 0))
    sim = pm.Simulation(pm.ParticleSystem(p), motions=[motion], dt=0.5, compiled=False)
    np.testing.assert_array_equal(sim.frame().positions, [[1, 0, 0]])
    sim.step(2)
    np.testing.assert_allclose(p.x, [[math.cos(1) + 1, 0, -math.sin(1)]], atol=1e-15)


def test_who_is_taken_away_is_led_no_more_and_who_is_not_pinned_never() -> None:
    p = pm.Particles(np.eye(3), m=1.0)
    p.pin([0, 2])
    sim = pm.Simulation(pm.ParticleSystem(p), motions=[pm.RigidMotion(shift=("t", 0, 0))], dt=0.5, compiled=False)
    sim.step()
    sim.system.remove([0])
    sim.step()
    np.testing.assert_allclose(p.x, [[0, 1, 0], [1, 0, 1]])


def test_a_scene_has_motions_as_text() -> None:
    scene = pm.Scene(bodies=[pm.hair(3, 4)], motions=[pm.RigidMotion("hair", angle="0.3*t", center=(0, 1, 0))])
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    assert "[[motions]]" in scene.to_toml()
    assert len(again.simulation().motions[0].ids) == 6


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: pm.RigidMotion(angle="x"), "angle may depend on t and nothing else"),
        (lambda: pm.RigidMotion(axis=(0, 0, 0)), "axis"),
        (lambda: pm.RigidMotion(shift=("m", 0, 0)), "shift may depend on t"),
        (lambda: strands_with([pm.Gravity()]), "motions must be motions"),
        (lambda: strands_with([pm.RigidMotion([2])]), r"none of \[2\] is pinned"),
        (lambda: strands_with([pm.RigidMotion(), pm.RigidMotion([0])]), "two motions lead particle 0"),
        (lambda: pm.Simulation(flowing(), motions=[pm.RigidMotion()]), "a flow has none"),
    ],
)
def test_bad_motions_are_refused_in_one_sentence(make: Any, sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        make()


def strands_with(motions: Any) -> pm.Simulation:
    body = pm.hair(1, 4)
    return pm.Simulation(pm.ParticleSystem(body.particles, body.forces), motions=motions)


def flowing() -> pm.ParticleSystem:
    p = pm.Particles([[0, 0, 0]])
    p.pin([0])
    return pm.ParticleSystem(p, [pm.Vortex()])
