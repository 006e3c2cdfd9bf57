"""Muscles: springs whose rest length is a wave in time, the same under every solver and in every layout."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput


def driven(amplitude, frequency, **arguments):
    particles = pm.Particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    particles.pin([0])
    muscle = pm.Muscles([(0, 1)], k_s=100.0, amplitude=amplitude, frequency=frequency, **arguments)
    return pm.ParticleSystem(particles, [muscle])


def test_a_mass_on_a_muscle_is_a_driven_oscillator():
    """x'' = -w^2 (x - 1 - A sin(W t)), from rest: x = 1 + A w^2 / (w^2 - W^2) (sin(W t) - (W / w) sin(w t))."""
    amplitude, frequency = 0.05, 0.7
    sim = pm.Simulation(driven(amplitude, frequency), pm.RK4(), 1e-3)
    sim.run(2.0)
    w, wave, t = 10.0, 2 * math.pi * frequency, sim.t
    gain = amplitude * w**2 / (w**2 - wave**2)
    exact = 1 + gain * (math.sin(wave * t) - wave / w * math.sin(w * t))
    # RK4 loses (w h)^5 / 120 a step, over 2000 steps
    assert sim.system.particles.x[1, 0] == pytest.approx(exact, abs=amplitude * 2000 * 0.01**5 / 120 * 10)


def test_the_wave_is_taken_at_the_time_of_the_stage():
    ends = []
    for h in (0.01, 0.005, 0.0025):
        sim = pm.Simulation(driven(0.2, 2.0), pm.RK4(), h)
        sim.step(round(0.4 / h))
        ends.append(sim.system.particles.x[1, 0])
    slope = math.log2(abs(ends[0] - ends[1]) / abs(ends[1] - ends[2]))
    assert slope > 3.7  # order 4; with the time of the step's start it would be 1


def test_stretch_is_measured_from_the_length_that_the_muscle_wants_now():
    system = driven(0.25, 1.0, phase=math.pi / 2)
    assert system.stretch() == pytest.approx(0.2)  # 1 m where 1.25 m are wanted


def test_the_bits_do_not_depend_on_the_path():
    ends = []
    for compiled in (True, False):
        sim = pm.Simulation(driven(0.2, 2.0), pm.SymplecticEuler(), 1e-3, compiled=compiled)
        sim.step(50)
        ends.append(sim.system.particles.x.copy())
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-13)


def test_numbers_are_put_between_steps_and_checked():
    system = driven(0.0, 1.0, rest=[1.0], offset=[0.0])
    (muscle,) = system.forces
    muscle.put(offset=0.1)
    assert muscle.rests(system.particles, 0.0) == pytest.approx([1.1])
    with pytest.raises(InvalidInput, match=r"offset = -2.*greater than -1"):
        muscle.put(offset=-2.0)
    with pytest.raises(InvalidInput, match="takes one number or"):
        muscle.put(offset=[0.1, 0.2])
    with pytest.raises(InvalidInput, match="offse"):
        muscle.put(offse=0.1)
    assert muscle.rests(system.particles, 0.0) == pytest.approx([1.1])
