"""Jacobians of elements, and what is left of them where a matrix must be positive definite."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pointmass as pm

RNG = np.random.default_rng(1)
X, V = RNG.normal(size=(2, 6, 3))
FORCES = {
    "springs": lambda: pm.Springs([(0, 1), (2, 3), (4, 5)], 50.0, 0.3, 1.5),
    "angles": lambda: pm.Angles([(0, 1, 2), (3, 4, 5)], 2.0, 0.1),
    "hinges": lambda: pm.Hinges([(0, 1, 2, 3)], 2.0, 0.1, 0.3),
    "volumes": lambda: pm.Volumes([(0, 1, 2, 3)], 2.0, 0.1, 0.3),
    "bulk": lambda: pm.Bulk([(0, 1, 2, 3)], 2.0, 0.1, 0.3),
}


def matrices(force: Any, share: float | None) -> list[np.ndarray]:
    """-df/dx and -df/dv of each element, shape (e, 3k, 3k)."""
    pm.ParticleSystem(pm.Particles(X, V), [force])
    given = None if share is None else np.full(6, share)
    both = force.element_jacobians(force._bound, 0.0, X, V, given)
    return [-slopes.reshape(len(slopes), 3 * force.nodes, 3 * force.nodes) for slopes in both]


@pytest.mark.parametrize("name", FORCES)
def test_a_share_of_one_is_the_exact_jacobian(name: str) -> None:
    for exact, whole in zip(*(matrices(FORCES[name](), share) for share in (None, 1.0)), strict=True):
        np.testing.assert_allclose(whole, exact, rtol=0, atol=1e-14 * np.abs(exact).max())


@pytest.mark.parametrize("name", FORCES)
def test_a_share_of_none_is_positive_semi_definite(name: str) -> None:
    """Here the exact one is not: springs are compressed, angles and volumes push one way or the other."""
    assert np.linalg.eigvalsh(_symmetric(matrices(FORCES[name](), 1.0)[0])).min() < -1e-3
    for part in matrices(FORCES[name](), 0.0):
        np.testing.assert_allclose(part, np.swapaxes(part, 1, 2), atol=1e-14 * np.abs(part).max())
        assert np.linalg.eigvalsh(part).min() > -1e-13 * np.abs(part).max()


def test_springs_that_pull_keep_their_jacobian() -> None:
    """k u u' + T (1 - u u') / L for a tension T, and the same without T where it pushes (Choi and Ko 2002)."""
    d = X[0] - X[1]
    length = float(np.linalg.norm(d))
    along = np.outer(d, d) / length**2
    for rest, kept in ((0.5 * length, 1.0), (2.0 * length, 0.0)):
        pull, _ = matrices(pm.Springs([(0, 1)], 50.0, 0.0, rest), 0.0)
        across = kept * 50.0 * (length - rest) / length * (np.eye(3) - along)
        np.testing.assert_allclose(pull[0, :3, :3], 50.0 * along + across, rtol=1e-13)
        np.testing.assert_allclose(pull[0, :3, 3:], -(50.0 * along + across), rtol=1e-13)


def test_a_law_of_which_no_more_is_known_is_kept_as_it_is() -> None:
    @pm.spring_force
    def push(x1: Any, v1: Any, x2: Any, v2: Any, t: Any, k: Any = 3.0) -> Any:
        return k * (x1 - x2)

    exact, none = (matrices(push(pairs=[(0, 1)]), share) for share in (None, 0.0))
    np.testing.assert_array_equal(exact, none)


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + np.swapaxes(matrix, 1, 2))
