"""Hair in a frame: strands and the children between them."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.colors import linear
from pointmass.frame import Curves, Frame


def frame_of(body: pm.Body, **look: object) -> Frame:
    system = pm.ParticleSystem(body.particles, body.forces)
    return pm.Simulation(system, look=pm.Look(particles="none", **look), compiled=False).frame()  # type: ignore[arg-type]


def hair_of(frame: Frame) -> Curves:
    (hair,) = frame.drawables
    assert isinstance(hair, Curves)
    return hair


def test_strands_from_root_to_tip() -> None:
    body = pm.hair(7, 5, 0.2)
    hair = hair_of(frame_of(body, spring_width=0.01, strand_color="red", tip_color="blue"))
    np.testing.assert_array_equal(hair.vertices, body.particles.x.astype(np.float32))
    np.testing.assert_array_equal(hair.offsets, 5 * np.arange(8))
    width, color = hair.width.reshape(7, 5), hair.color.reshape(7, 5, 4)  # type: ignore[union-attr]
    np.testing.assert_allclose(width[:, 0], 0.01)
    assert (np.diff(width) < 0).all()
    for end, wanted in ((0, "red"), (4, "blue")):
        shades = color[:, end, :3].max(axis=1)
        np.testing.assert_allclose(color[:, end, :3], shades[:, None] * linear(wanted)[:3] / linear(wanted)[:3].max())
    assert np.ptp(color[:, 0, 0]) > 0


def test_children_are_means_of_three_neighbours() -> None:
    strands, children = 30, 4
    body = pm.hair(strands, 6, 0.2, cap=40.0)
    x = hair_of(frame_of(body, children=children)).vertices.reshape(-1, 6, 3)  # type: ignore[union-attr]
    assert len(x) == strands * (1 + children)
    for k, child in enumerate(x[strands:]):
        mother = k // children
        near = np.argsort(np.linalg.norm(x[:strands, 0] - x[mother, 0], axis=1))[:6]
        basis = np.concatenate([x[near, j].T for j in range(6)] + [np.ones((1, 6))])
        found, *_ = np.linalg.lstsq(basis, np.append(child.ravel(), 1.0), rcond=None)
        np.testing.assert_allclose(basis @ found, np.append(child.ravel(), 1.0), atol=1e-5)
        assert (np.abs(found) > 1e-3).sum() <= 3
        assert found.min() > -1e-3


def test_children_follow_from_their_seed_and_not_from_the_frame() -> None:
    first, again, other = (hair_of(frame_of(pm.hair(20, 4), children=3, children_seed=s)).vertices for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("strands", [1, 2, 3, 4])
def test_few_strands_have_children_if_they_are_three(strands: int) -> None:
    hair = hair_of(frame_of(pm.hair(strands, 4), children=2))
    assert len(hair.offsets) - 1 == strands * (3 if strands >= 3 else 1)


def test_a_cut_strand_is_two_and_has_no_children() -> None:
    body = pm.hair(4, 8, 0.1)
    system = pm.ParticleSystem(body.particles, body.forces)
    sim = pm.Simulation(system, look=pm.Look(children=5), compiled=False)
    system.remove([11])
    hair = next(d for d in sim.frame().drawables if isinstance(d, Curves))
    np.testing.assert_array_equal(np.diff(hair.offsets), [8, 3, 4, 8, 8])
    np.testing.assert_array_equal(hair.vertices[8:15], body.particles.x[8:15].astype(np.float32))  # type: ignore[index]


def test_a_scene_keeps_its_hair() -> None:
    scene = pm.Scene(bodies=[pm.hair(5, 4)], look=pm.Look(children=3, children_seed=4, tip_color="red"))
    assert pm.Scene.from_toml(scene.to_toml()) == scene
