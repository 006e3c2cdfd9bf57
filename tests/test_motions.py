"""Pins that move."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pointmass as pm
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


@pytest.mark.parametrize("solver", [*FIRST, "leapfrog", "midpoint", "rk4", "implicit_midpoint", "yoshida4"])
def test_a_driven_oscillator_converges_as_promised(solver: str) -> None:
    """Of order 2 a method is off by the phase (W h)^2 / 6 a radian at most: 4e-5 m of a swing of 0.2 m."""
    order, errors = 1 if solver in FIRST else 2, []
    for steps in (200, 400):
        sim = driven(solver, 1.0 / steps)
        sim.step(steps)
        errors.append(abs(sim.system.particles.x[1, 0] - wanted(1.0)))
        assert sim.system.particles.x[0, 0] == pytest.approx(-1 + REACH * math.sin(DRIVE), abs=1e-15)
        assert sim.system.particles.v[0, 0] == pytest.approx(REACH * DRIVE * math.cos(DRIVE), rel=1e-12)
    assert errors[0] / errors[1] > 0.9 * 2.0**order
    assert errors[1] < (2e-3 if order == 1 else 4e-5)


def strands(**options: Any) -> pm.Simulation:
    body = pm.hair(10, 5, 0.2, style="wavy", curl_turns=2.0, jitter=0.0)
    forces = [pm.Gravity(), pm.Drag(1e-6), *body.forces]
    motion = pm.RigidMotion(angle="0.5*sin(9*t)", axis=(0, 1, 0.2), shift=(0, 0, "0.1*t"))
    system = pm.ParticleSystem(body.particles, forces)
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
