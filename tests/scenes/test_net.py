"""The scene net: balls that cannot slip through its meshes, and start apart."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm


@pytest.mark.parametrize(("mesh", "radius", "balls"), [(0.4, 0.1, 9), (0.8, 0.06, 40), (0.3, 0.3, 5)])
def test_a_mesh_is_finer_than_a_ball_and_balls_begin_apart(mesh: float, radius: float, balls: int) -> None:
    net = pm.SCENES["net"](mesh=mesh, radius=radius, balls=balls)
    body, caught = net.body(), net.caught().particles
    knots = body.forces[0].ids
    sides = np.linalg.norm(np.diff(body.particles.x[knots], axis=1)[:, 0], axis=1)
    assert sides.max() <= 2 * mesh * radius + 1e-12
    apart = np.linalg.norm(caught.x[:, None] - caught.x[None], axis=2) + 2 * radius * np.eye(balls)
    assert apart.min() >= 2 * radius - 1e-9
    assert caught.x[:, 1].min() - body.particles.x[:, 1].max() == pytest.approx(net.height, abs=radius)
