"""Hair of each style stays whole while the head turns."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.scenes import SCENES


def test_wavy_hair_that_straightens_and_folds_stays_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """The jerk at the start bends some strands so much that torsion is held several times as hard as at rest."""
    monkeypatch.setenv("POINTMASS_ENGINE", "compiled")
    scene = SCENES["hair"].with_settings({"strands": 300}, "wavy").build()
    simulation = scene.simulation()
    simulation.step(round(1.5 / simulation.dt))
    assert np.abs(simulation.system.particles.v).max() < 5.0
