"""The scene curtain: its rings, hooks and motions."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm


def test_rings_are_drawn_aside_and_back_and_stand_still_in_between() -> None:
    curtain = pm.SCENES["curtain"](particles=9, rings=5, width=2.0, gathered=0.25, time=1.5)
    sim = curtain.build().simulation()
    p = sim.system.particles
    np.testing.assert_array_equal(np.concatenate([motion.ids for motion in sim.motions]), p.id[p.select("rings")])

    def places(t: float, which: int = 0) -> np.ndarray:
        """Of the rings, or their velocities (which = 1)."""
        maps = [(motion.maps(np.array([t]))[0, which], motion.arms[0]) for motion in sim.motions]
        return np.array([m[:, :3] @ arm + m[:, 3] for m, arm in maps])

    start = places(0.0)
    np.testing.assert_allclose(start[:, 0], np.linspace(-1, 1, 5))
    for t in (2.0, 2.4):  # 0.5 s of rest, 1.5 s of drawing, 0.5 s of rest
        np.testing.assert_allclose(places(t)[:, 0], np.linspace(-1, -0.5, 5), atol=1e-5)
        assert np.abs(places(t, 1)).max() < 1e-9
    np.testing.assert_allclose(places(4.0), start, atol=1e-9)
    np.testing.assert_array_equal(places(1.3)[:, 1:], start[:, 1:])
    assert places(1.25, 1)[-1, 0] == pytest.approx(-1.5 * 1.5 / 1.5, rel=1e-6)  # 3/2 of the mean speed


@pytest.mark.parametrize(("particles", "rings"), [(9, 3), (50, 7), (9, 20)])
def test_each_ring_holds_the_cloth_below_it_without_tension(particles: int, rings: int) -> None:
    curtain = pm.SCENES["curtain"](particles=particles, rings=rings)
    scene = curtain.build()
    system = scene.simulation().system
    hooks = next(force for force in system.forces if getattr(force, "family", "") == "hooks")
    ends = system.particles.x[hooks.rows(system.particles)]
    np.testing.assert_allclose(ends[:, 0, 0], ends[:, 1, 0], atol=1e-12)
    assert system.stretch() < 1e-9
    assert pm.Scene.from_toml(scene.to_toml()) == scene
