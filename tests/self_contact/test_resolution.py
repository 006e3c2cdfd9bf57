"""What keeps surfaces apart in one step: nothing passes through, momentum stays, pins stay, and work is saved."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import pointmass as pm
from pointmass.self_contact import resolution
from pointmass.self_contact.pairs import Mesh
from pointmass.self_contact.resolution import Resolution
from tests import crossing

DT = 1 / 60
THICKNESS = 0.03
NO_STRANDS = np.zeros((0, 2), np.intp)


def two_sheets(rows: int = 7, seed: int = 0, speed: float = 6.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, Mesh]:
    """Two sheets that face each other, and ways that lead them right through each other, each corner as it likes."""
    rng = np.random.default_rng(seed)
    one = pm.cloth(rows, rows, 1.0, down=(0, 0, 1))
    two = pm.cloth(rows, rows, 1.0, down=(0.6, 0, 0.8), center=(0.1, 0.06, 0.05))
    x0 = np.concatenate([one.particles.x, two.particles.x]) + 0.004 * rng.normal(size=(2 * rows * rows, 3))
    v = 0.5 * rng.normal(size=x0.shape)
    v[rows * rows :, 1] -= speed
    corners = one.particles.corners("cloth")
    mesh = Mesh.of(np.concatenate([corners, corners + rows * rows]), NO_STRANDS)
    m = rng.uniform(0.5, 2.0, len(x0))
    return x0, x0 + DT * v, 1 / m, mesh


def passes_through(x0: np.ndarray, x1: np.ndarray, mesh: Mesh) -> int:
    """How often an edge is found in a triangle at some times of a step."""
    ways = (x0 + t * (x1 - x0) for t in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0))
    return sum(len(crossing.crossings(x, mesh.triangles, mesh.edges)) for x in ways)


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_sheets_that_fly_at_each_other_do_not_pass(seed: int, friction: float) -> None:
    x0, given, w, mesh = two_sheets(seed=seed)
    assert passes_through(x0, given, mesh) > 50
    x1 = given.copy()
    solver = Resolution(mesh, THICKNESS, friction)
    assert solver.resolve(x0, x1, w, DT)
    assert passes_through(x0, x1, mesh) == 0
    assert not solver.lost
    assert solver.zones == 0
    # Impulses are equal and opposite: the centre of mass goes where it went; round-off of some thousand of them.
    assert (x1 - given).T @ (1 / w) == pytest.approx(np.zeros(3), abs=1e-11)


@pytest.mark.parametrize("rounds", [(0, resolution.LATE_ROUNDS), (0, 0)], ids=["planes", "zones"])
def test_each_last_resort_does_alone(rounds: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resolution, "ROUNDS", rounds[0])
    monkeypatch.setattr(resolution, "LATE_ROUNDS", rounds[1])
    x0, given, w, mesh = two_sheets()
    x1, solver = given.copy(), Resolution(mesh, THICKNESS, 0.3)
    assert solver.resolve(x0, x1, w, DT)
    assert passes_through(x0, x1, mesh) == 0
    assert not solver.lost
    assert (solver.zones > 0) == (rounds[1] == 0)
    assert (x1 - given).T @ (1 / w) == pytest.approx(np.zeros(3), abs=1e-11)


def test_pins_stay_and_hold_what_falls_on_them() -> None:
    x0, given, w, mesh = two_sheets()
    w[:49] = 0
    given[:49] = x0[:49]
    x1, solver = given.copy(), Resolution(mesh, THICKNESS, 0.3)
    assert solver.resolve(x0, x1, w, DT)
    assert passes_through(x0, x1, mesh) == 0
    assert x1[:49].tobytes() == given[:49].tobytes()


def test_pins_that_are_led_through_a_surface_are_reported() -> None:
    x0, given, w, mesh = two_sheets()
    w[:] = 0
    x1, solver = given.copy(), Resolution(mesh, THICKNESS, 0.3)
    assert not solver.resolve(x0, x1, w, DT)
    assert solver.lost
    assert x1.tobytes() == given.tobytes()


def test_nothing_is_done_where_nothing_is_near() -> None:
    x0, _, w, mesh = two_sheets()
    x0[49:, 1] += 0.5
    solver = Resolution(mesh, THICKNESS, 0.3)
    for k in range(10):
        x1 = x0 + np.array((0.3, -0.004, 0.0))  # all of them together: they are as near as before
        x1[49:, 1] -= 0.004
        before = x1.copy()
        assert not solver.resolve(x0, x1, w, DT)
        assert x1.tobytes() == before.tobytes()
        x0 = x1
        assert solver.searches == 1 + (k >= 7)  # the margin of 3 cm is used up, by 4 mm each time, in the eighth


def test_a_step_does_not_depend_on_those_before_it() -> None:
    """Pairs that were found earlier serve as well as new ones: a run that is taken up again has the same bits."""
    x, given, w, mesh = two_sheets(speed=0.3)
    kept = Resolution(mesh, THICKNESS, 0.3)
    v = (given - x) / DT
    for _ in range(25):
        x1 = x + 0.1 * DT * v
        again = x1.copy()
        kept.resolve(x, x1, w, 0.1 * DT)
        Resolution(mesh, THICKNESS, 0.3).resolve(x, again, w, 0.1 * DT)
        assert x1.tobytes() == again.tobytes()
        v = (x1 - x) / (0.1 * DT)
        x = x1
    assert kept.searches < 20


def test_bits_do_not_depend_on_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resolution, "GRAIN", 16)
    most, results = numba.get_num_threads(), set()
    for threads in {1, most}:
        numba.set_num_threads(threads)
        x0, x1, w, mesh = two_sheets()
        Resolution(mesh, THICKNESS, 0.3).resolve(x0, x1, w, DT)
        results.add(x1.tobytes())
    numba.set_num_threads(most)
    assert len(results) == 1


def above(gap: float, fall: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, Mesh]:
    """A small triangle over the middle of a large pinned one, and how far it falls in a step."""
    large = np.array([(-3.0, 0, -2), (3, 0, -2), (0, 0, 4)])
    x0 = np.concatenate([large, 0.1 * large + (0, gap, 0)])
    x1 = x0 - (0, fall, 0)
    x1[:3] = x0[:3]
    return x0, x1, np.array([0.0, 0, 0, 1, 1, 1]), Mesh.of(np.arange(6).reshape(2, 3), NO_STRANDS)


def test_who_falls_onto_a_surface_stops_at_its_thickness() -> None:
    for gap, fall in ((0.04, 0.02), (0.5, 0.6), (0.5, 3.0)):  # foreseen; found as a collision; and far beyond it
        x0, x1, w, mesh = above(gap, fall)
        assert Resolution(mesh, THICKNESS, 0.3).resolve(x0, x1, w, DT)
        assert x1[3:, 1] == pytest.approx(np.full(3, THICKNESS), abs=1e-5 * THICKNESS)


def test_who_is_too_near_parts_slowly() -> None:
    """By a tenth of what is lacking; in short steps not faster than all of it in 1/24 s."""
    for dt, share in ((1 / 60, 0.1), (1 / 2400, 0.01)):
        x0, x1, w, mesh = above(0.01, 0.0)
        assert Resolution(mesh, THICKNESS, 0.3).resolve(x0, x1, w, dt)
        assert x1[3:, 1] == pytest.approx(np.full(3, 0.01 + share * 0.02), abs=1e-5 * THICKNESS)


def test_who_touches_at_the_start_is_not_judged() -> None:
    """As the two sides of a fresh tear."""
    x0, x1, w, mesh = above(0.0, 0.01)
    before = x1.copy()
    solver = Resolution(mesh, THICKNESS, 0.3)
    assert not solver.resolve(x0, x1, w, DT)
    assert x1.tobytes() == before.tobytes()


def test_strands_do_not_pass_through_each_other_or_a_surface() -> None:
    x0 = np.array([(-1.0, 1, 0), (1, 1, 0), (0, 1.2, -1), (0, 1.2, 1), (-2, 0, -2), (2, 0, -2), (0, 0, 3)])
    x1 = x0.copy()
    x1[2:4, 1] = -1  # one strand right through the other and the triangle
    mesh = Mesh.of(np.array([[4, 5, 6]]), np.array([[0, 1], [2, 3]]))
    w = np.array([1.0, 1, 1, 1, 0, 0, 0])
    assert Resolution(mesh, THICKNESS, 0.0).resolve(x0, x1, w, DT)
    assert (x1[2:4, 1] > x1[:2, 1]).all()
    assert (x1[:4, 1] > 0).all()
