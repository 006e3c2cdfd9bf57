"""A school keeps its spacing, and a chase leaves somebody to be chased."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.bodies.fish import NODES
from pointmass.scenes.school import LENGTH, School


def middles(frame, count):
    return frame.positions[: NODES * count].reshape(count, NODES, 3).mean(axis=1)


@pytest.mark.parametrize("count", [30, 200])
def test_a_school_keeps_together_and_apart(count, monkeypatch):
    monkeypatch.setenv("POINTMASS_ENGINE", "compiled")
    shipped = School(fish=count)
    scene = shipped.build()
    frames = list(scene.simulation().frames(26, 2.5))
    shipped.check(frames)
    apart = np.linalg.norm(middles(frames[-1], count)[:, None] - middles(frames[-1], count), axis=2)
    apart[np.arange(count), np.arange(count)] = np.inf
    near = np.median(apart.min(axis=1)) / LENGTH
    assert 0.7 < near < 1.4
    went = np.linalg.norm(middles(frames[-1], count) - middles(frames[-2], count), axis=1)
    assert np.median(went) > 0.1 * LENGTH  # in 0.4 s
