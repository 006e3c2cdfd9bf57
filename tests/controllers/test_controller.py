"""Controllers look on the grid of steps, whatever looks at the run."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput


class Thermostat(pm.Controller):
    """Counts its looks, and has the muscle long while the mass is near."""

    def bind(self, system, seed):
        (self.muscle,) = system.forces
        self.memory = {"looks": np.zeros(0)}

    def control(self, system, t):
        self.memory["looks"] = np.append(self.memory["looks"], t)
        self.muscle.put(offset=0.3 if system.particles.x[1, 0] < 1.1 else -0.3)


def simulation(compiled=True, period=0.05, dt=0.01):
    particles = pm.Particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    particles.pin([0])
    system = pm.ParticleSystem(particles, [pm.Muscles([(0, 1)], k_s=100.0, k_d=1.0)])
    return pm.Simulation(system, dt=dt, controllers=[Thermostat(period)], compiled=compiled)


def test_looks_are_on_the_grid_of_steps():
    sim = simulation()
    sim.step(23)
    np.testing.assert_allclose(sim.controllers[0].memory["looks"], [0.0, 0.05, 0.1, 0.15, 0.2])


@pytest.mark.parametrize("compiled", [True, False])
def test_frames_and_pieces_change_no_bit(compiled):
    whole, pieces, filmed = (simulation(compiled) for _ in range(3))
    whole.step(60)
    for count in (1, 2, 30, 4, 23):
        pieces.step(count)
    list(filmed.frames(1 + 57, fps=95.0))
    assert np.array_equal(whole.system.particles.x, pieces.system.particles.x)
    assert np.array_equal(whole.system.particles.x, filmed.system.particles.x)
    assert np.ptp(whole.system.particles.x[1]) > 0


def test_a_period_shorter_than_a_step_is_every_step():
    sim = simulation(period=0.0)
    sim.step(3)
    assert len(sim.controllers[0].memory["looks"]) == 3


def test_only_controllers_control():
    with pytest.raises(InvalidInput, match="controllers must be controllers"):
        pm.Simulation(simulation().system, controllers=["brain"])
