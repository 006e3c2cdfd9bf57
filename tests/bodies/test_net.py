"""Nets: knots, ropes and their masses."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm


@pytest.mark.parametrize(("rows", "cols", "links"), [(3, 4, 1), (2, 2, 5), (5, 3, 3)])
def test_ropes_and_knots(rows: int, cols: int, links: int) -> None:
    built = pm.net(rows, cols, (1.2, 2.0), links=links, mass=0.03, stiffness=50.0)
    p, (springs,) = built.particles, built.forces
    sides = rows * (cols - 1) + cols * (rows - 1)
    assert len(p) == rows * cols + sides * (links - 1)
    assert len(springs.ids) == sides * links
    assert p.m.sum() == pytest.approx(0.03 * (rows * 1.2 + cols * 2.0))
    ends = p.x[springs.ids]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), springs.arguments["rest"], rtol=1e-12)
    np.testing.assert_allclose(springs.arguments["k_s"] * springs.arguments["rest"], 50.0)
    met = np.bincount(springs.ids.ravel(), minlength=len(p))
    knots = met[: rows * cols].reshape(rows, cols)
    assert (knots[[0, 0, -1, -1], [0, -1, 0, -1]] == 2).all()
    assert (knots[1:-1, 1:-1] == 4).all()
    assert (met[rows * cols :] == 2).all()


def test_knots_are_held_by_name() -> None:
    p = pm.net(3, 4, links=2, pinned=["top corners", "bottom edge"]).particles
    assert np.flatnonzero(p.pinned).tolist() == [0, 3, 8, 9, 10, 11]


def test_a_rope_hangs_by_its_weight() -> None:
    """A net of two ropes: each link is stretched by what hangs below it, the crossing ropes too."""
    built = pm.net(2, 2, (0.5, 1.0), links=4, mass=0.1, stiffness=20.0, damping_ratio=0.5, pinned="top edge")
    sim = pm.Simulation(
        pm.ParticleSystem(built.particles, [pm.Gravity(), *built.forces]), pm.ImplicitEuler(), 0.1, compiled=False
    )
    sim.step(200)
    lower = built.particles.x[2:4]
    below = 9.81 * 0.1 * (0.25 + np.array([0.125, 0.375, 0.625, 0.875]))  # half of the cross rope, and of a link
    down = 0.25 * (1 + below / 20).sum()
    assert built.particles.x[0, 1] - lower[:, 1] == pytest.approx([down, down], rel=0.02)  # they are pulled inwards


def test_slack_makes_ropes_longer_and_as_much_heavier() -> None:
    taut, slack = (pm.net(3, 3, links=2, mass=0.1, stiffness=20.0, slack=s) for s in (0.0, 0.25))
    np.testing.assert_array_equal(taut.particles.x, slack.particles.x)
    np.testing.assert_allclose(slack.forces[0].arguments["rest"], 1.25 * taut.forces[0].arguments["rest"])
    np.testing.assert_allclose(slack.particles.m, 1.25 * taut.particles.m)
    np.testing.assert_allclose(slack.forces[0].arguments["k_s"] * slack.forces[0].arguments["rest"], 20.0)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: pm.net(1, 3), "rows = 1"),
        (lambda: pm.net(links=0), "links = 0"),
        (lambda: pm.net(mass=0), "mass = 0"),
        (lambda: pm.net(slack=-0.1), "slack = -0.1"),
        (lambda: pm.net(stiffness=-1), "stiffness = -1"),
        (lambda: pm.net(pinned="knots"), "unknown value of pinned 'knots'"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(build, sentence: str) -> None:
    with pytest.raises(pm.InvalidInput, match=sentence):
        build()
