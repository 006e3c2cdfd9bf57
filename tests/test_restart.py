"""A run that is stopped and goes on has the bits of one that was never stopped."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import pytest

import pointmass as pm
from pointmass.engine.island import CHECKPOINT
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.simulation import Simulation
from tests.same import assert_same_bits, assert_same_frame
from tests.small import SMALL

Make = Callable[[], Simulation]


def shipped(name: str, **settings: Any) -> Make:
    return lambda: SCENES[name].with_settings(SMALL.get(name, {}) | settings).build().simulation()


def solved(solver: str) -> Make:
    """Springs that hang, and a fountain of particles that die, beside them."""

    def make() -> Simulation:
        return pm.Scene(
            bodies=[pm.chain(4, pinned="start")],
            emitters=[pm.Nozzle(position=(2, 0, 0), rate=100.0, lifetime=pm.Spread(0.2, 0.1))],
            forces=[pm.Gravity(), pm.Drag(k=0.1)],
            colliders=[pm.Plane((0, -0.5, 0))],
            solver=pm.SOLVERS[solver](),
            dt=1 / 240,
            look=pm.Look(trails=0.3),
        ).simulation()

    return make


def goes_on(make: Make, frames: int, fps: float = 60.0) -> None:
    """Compare a whole run with one that goes on from its first state after the start."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        whole, states = make(), []
        whole.on_grid = lambda: states.append(whole.state())
        seen = list(whole.frames(frames, fps))
        again = make()
        again.put_state(states[1])
        first = again.frames_seen
        assert 1 < first < frames
        for frame, other in zip(seen[first:], again.frames(frames - first, fps), strict=True):
            assert_same_frame(frame, other)


# Brains, births with followers, steering.
@pytest.mark.parametrize(("name", "frames"), [("fish", 7), ("snake", 4), ("fireworks", 68), ("flock", 35)])
def test_shipped_scenes_go_on_from_their_states(name: str, frames: int) -> None:
    goes_on(shipped(name), frames)


@pytest.mark.parametrize("solver", ["bdf2", "xpbd", "dopri5"])
def test_solvers_remember_their_history(solver: str) -> None:
    goes_on(solved(solver), 20)


def test_frames_between_steps_are_the_same() -> None:
    goes_on(solved("leapfrog"), 12, fps=33.0)


def test_looking_at_the_state_changes_nothing() -> None:
    looked, alone = solved("leapfrog")(), solved("leapfrog")()
    looked.on_grid = lambda: looked.state() and None
    for a, b in zip(looked.frames(20, 33.0), alone.frames(20, 33.0), strict=True):
        assert_same_frame(a, b)


def test_self_contact_starts_anew_on_the_grid() -> None:
    def make() -> Simulation:
        return pm.Scene(
            bodies=[pm.cloth(4, 4, (0.3, 0.3), center=(0, 0.2, 0), material="silk")],
            forces=[pm.Gravity()],
            colliders=[pm.Plane(friction=0.5)],
            constraints=[pm.SelfContact()],
            solver=pm.ImplicitEuler(),
            dt=1 / 120,
        ).simulation()

    goes_on(make, 36)


def test_a_state_of_something_else_is_refused() -> None:
    sim = solved("leapfrog")()
    sim.step(CHECKPOINT)
    state = sim.state()
    with pytest.raises(InvalidInput, match="the state is that of another run, with"):
        pm.Scene(bodies=[pm.chain(4), pm.cloth(2, 2)], dt=1 / 240).simulation().put_state(state)
    assert sim.fits(state)
    with pytest.raises(InvalidInput, match=r"the state is that of another run, with .* dt = 0.00416667 s"):
        pm.Scene(bodies=[pm.chain(4)], dt=1 / 100).simulation().put_state(state)


@pytest.mark.parametrize("solver", ["symplectic_euler", "xpbd", "implicit_euler"])
def test_a_cloth_and_a_net_that_tear_go_on(solver: str) -> None:
    def make() -> Simulation:
        return pm.Scene(
            bodies=[
                pm.cloth(7, 7, (0.5, 0.5), pinned="top edge", stretch=60.0, shear=20.0),
                pm.net(3, 3, 0.5, links=2, pinned="top edge"),
                pm.points([[0.6, 0, 0]], lifetime=0.1),
            ],
            forces=[pm.Field(("0", "-500*m*t*(1 + x)", "20*m")), pm.Drag("0.001 + 0.01*m")],
            constraints=[pm.Tear(0.1, spread=0.5, most=1), pm.StrainLimit(0.3)],
            solver=pm.SOLVERS[solver](),
            dt=1 / 1200,
            look=pm.Look(trails=0.05),
        ).simulation()

    sim = make()
    sim.step(2 * CHECKPOINT)
    torn = sim.constraints[0].breaks
    sim.step(2 * CHECKPOINT)
    assert 0 < torn < sim.constraints[0].breaks
    goes_on(make, 16, fps=60.0)


def test_a_run_that_is_all_in_its_state_has_nothing_to_say() -> None:
    assert shipped("tear")().restless == shipped("fish")().restless == ""


def test_a_brain_that_remembers_words_says_so() -> None:
    class Talker(pm.Controller):
        def bind(self, system: pm.ParticleSystem, seed: int) -> None:
            self.memory = {"said": "hello"}

        def control(self, system: pm.ParticleSystem, t: float) -> None:
            """Nothing more to say."""

    sim = pm.Simulation(pm.ParticleSystem(pm.chain(2).particles), controllers=[Talker()])
    assert sim.restless == "what Talker remembers as 'said' is no array of numbers"


def test_a_brain_goes_on_with_its_memory() -> None:
    whole, again = (shipped("fish")() for _ in range(2))
    whole.step(2 * CHECKPOINT)
    again.put_state(whole.state())
    for name, values in whole.controllers[0].memory.items():
        assert_same_bits(values, again.controllers[0].memory[name])
