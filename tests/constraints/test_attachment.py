"""Attachments: to surfaces, to particles, to colliders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pointmass as pm

DT = 1e-3


def scene(*constraints: pm.Constraint, **more: Any) -> pm.Scene:
    """A triangle of cloth, and two points over it."""
    sheet = pm.cloth(2, 2, 1.0, down=(0, 0, 1), stretch=1e3, shear=300.0)
    lone = pm.points([[0.1, 0.2, 0.2], [-0.2, 0.1, -0.3]], m=0.05)
    values = {"dt": DT, "solver": pm.SymplecticEuler(), **more}
    return pm.Scene(bodies=[sheet, lone], names=["sheet", "lone"], constraints=constraints, **values)


def run(scene: pm.Scene, seconds: float, compiled: bool = False) -> pm.Simulation:
    made = scene.simulation()
    sim = pm.Simulation(
        made.system,
        made.solver,
        scene.dt,
        constraints=made.constraints,
        motions=made.motions,
        compiled=compiled,
    )
    sim.run(seconds)
    return sim


def test_a_particle_keeps_its_place_over_a_triangle_that_moves_and_turns() -> None:
    """In the frame of its triangle, while the whole spins and flies; momenta are those of the start."""
    built = scene(pm.Attachment("lone", "sheet"))
    sim = built.simulation()
    p = sim.system.particles
    p.v[:] = np.cross((0.5, 3.0, 1.0), p.x) + np.array([0.2, 0, 0])
    corners = p.corners("sheet")
    momentum, turn = sim.system.momentum(), sim.system.angular_momentum()

    def local() -> np.ndarray:
        found = []
        for row in (4, 5):
            face = corners[sim.constraints[0]._ties.numbers[row - 4]]
            a, b, c = p.x[face]
            u = (b - a) / np.linalg.norm(b - a)
            n = np.cross(b - a, c - a)
            n /= np.linalg.norm(n)
            found.append([(p.x[row] - a) @ axis for axis in (u, np.cross(n, u), n)])
        return np.array(found)

    before = local()
    np.testing.assert_allclose(abs(before[:, 2]), [0.2, 0.1], atol=1e-12)
    sim.run(0.5)
    assert np.abs(p.x[4] - (0.1, 0.2, 0.2)).max() > 0.1
    np.testing.assert_allclose(local(), before, atol=0.02)  # the sheet is stretched a little
    np.testing.assert_allclose(local()[:, 2], before[:, 2], atol=1e-6)
    np.testing.assert_allclose(sim.system.momentum(), momentum, atol=1e-12)
    np.testing.assert_allclose(sim.system.angular_momentum(), turn, atol=1e-3 * np.linalg.norm(turn))


def test_a_tie_is_put_right_in_one_step_and_turns_nothing() -> None:
    """From some way off, pushed in any direction: what both sides get is neither momentum nor angular momentum."""
    rng = np.random.default_rng(5)
    p = pm.Particles([[0, 0, 0], [1, 0, 0.1], [0.2, 0.1, 1], [0.4, 0.7, 0.3]], m=[1, 2, 3, 4])
    p.cover("plate", [(0, 2, 1)])
    system = pm.ParticleSystem(p)
    tie = pm.Attachment([3], "plate")
    sim = pm.Simulation(system, "symplectic_euler", 1e-3, constraints=[tie], compiled=False)
    p.v[:] = rng.normal(0, 1, (4, 3))
    momentum, turn = system.momentum(), system.angular_momentum()
    sim.step()
    np.testing.assert_allclose(system.momentum(), momentum, atol=1e-12)
    np.testing.assert_allclose(system.angular_momentum(), turn, atol=1e-2)  # ways of 1 mm turn their arms a little
    a, b, c = p.x[[0, 2, 1]]
    n = np.cross(b - a, c - a)
    ties = tie._ties
    foot = ties.weights[0] @ p.x[[0, 2, 1]] + ties.height[0] * n / np.linalg.norm(n)
    np.testing.assert_allclose(p.x[3], foot, atol=1e-12)


def test_both_sides_move_by_their_weights() -> None:
    """One push, one tie: the foot and the particle go on together, as one mass."""
    sheet = pm.Particles([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0.25, 0, 0.25]], m=[1, 2, 3, 4])
    sheet.cover("plate", [(0, 2, 1)])
    sheet.v[3] = (0, 1, 0)
    system = pm.ParticleSystem(sheet)
    sim = pm.Simulation(system, "symplectic_euler", 0.1, constraints=[pm.Attachment([3], "plate")], compiled=False)
    sim.step()
    weights = np.array([0.5, 0.25, 0.25])
    w = np.append(weights**2 / sheet.m[:3], 1 / 4)
    pull = 0.1 / w.sum()  # kg m
    np.testing.assert_allclose(sheet.x[:3, 1], weights / sheet.m[:3] * pull, rtol=1e-12)
    np.testing.assert_allclose(sheet.x[3, 1], 0.1 - pull / 4, rtol=1e-12)
    np.testing.assert_allclose(sheet.x[3, 1], weights @ sheet.x[:3, 1], rtol=1e-12)
    np.testing.assert_allclose(system.momentum(), (0, 4, 0), atol=1e-12)
    np.testing.assert_allclose(sheet.v[:, 1], sheet.x[:, 1] / 0.1, rtol=1e-12)


def test_a_weight_hangs_on_a_pinned_cloth_and_pulls_it_down() -> None:
    """The load of what is attached is borne by the cloth's springs."""
    cloth = pm.cloth(5, 5, 1.0, down=(0, 0, 1), damping_ratio=0.5, pinned="edges")
    ends = []
    for mass in (0.001, 0.5):
        weight = pm.points([[0, -0.1, 0]], m=mass)
        built = pm.Scene(
            bodies=[cloth, weight],
            names=["cloth", "weight"],
            forces=[pm.Gravity()],
            solver=pm.SymplecticEuler(),
            dt=DT,
            constraints=[pm.Attachment("weight", "cloth")],
        )
        p = run(built, 1.0).system.particles
        assert p.x[-1, 1] == pytest.approx(p.x[12, 1] - 0.1, abs=0.01)  # the triangle is a little oblique
        ends.append(p.x[12, 1])
    assert ends[1] < ends[0] - 0.02


def test_particles_are_tied_at_their_distance() -> None:
    """Two chains, the end of one to the end of the other: a pendulum of both."""
    upper = pm.chain(2, 0.4, direction=(0, -1, 0), mass=0.2, k_s=5e3, damping_ratio=0.3)
    lower = pm.chain(2, 0.4, start=(0.03, -0.44, 0), direction=(0, -1, 0), mass=0.2, k_s=5e3, pinned="none")
    built = pm.Scene(
        bodies=[upper, lower],
        names=["upper", "lower"],
        forces=[pm.Gravity()],
        dt=1e-3,
        constraints=[pm.Attachment([3], "upper")],
    )
    sim = run(built, 1.0)
    x = sim.system.particles.x
    assert np.linalg.norm(x[3] - x[2]) == pytest.approx(0.05, rel=1e-6)
    assert x[-1, 1] < -0.7
    assert np.abs(x).max() < 1


@pytest.mark.parametrize("compiled", [False, True])
def test_a_curtain_goes_where_its_rail_goes(compiled: bool) -> None:
    cloth = pm.cloth(3, 3, 1.0, damping_ratio=0.3)
    rail = pm.Sphere(("0.3*sin(2*t)", 0.7, 0), 0.1)
    built = pm.Scene(
        bodies=[cloth],
        forces=[pm.Gravity()],
        colliders=[rail],
        solver=pm.SymplecticEuler(),
        dt=DT,
        constraints=[pm.Attachment("top edge", collider=0)],
    )
    start = cloth.particles.x[:3].copy()
    sim = run(built, 0.5, compiled)
    p = sim.system.particles
    np.testing.assert_allclose(p.x[:3], start + np.array([0.3 * np.sin(1.0), 0, 0]), atol=1e-12)
    np.testing.assert_allclose(p.v[:3], np.tile((0.6 * np.cos(1.0), 0, 0), (3, 1)), atol=1e-12)
    assert p.x[3:, 1].max() < 0.1


def test_a_triangle_that_tears_keeps_what_is_tied_to_it_and_ties_of_the_gone_are_gone() -> None:
    built = scene(pm.Attachment("lone", "sheet"))
    sim = built.simulation()
    system, ties = sim.system, sim.constraints[0]._ties
    p = system.particles
    from pointmass.constraints.surgery import divided, star

    shared = int(np.intersect1d(*p.surfaces["sheet"].triangles)[0])
    owners = divided(system, star(p, shared), np.array([0, 1]))
    sim.step()
    assert set(ties.corners[:, :].ravel().tolist()) >= {shared, int(owners[1])}
    np.testing.assert_array_equal(ties.corners, p.surfaces["sheet"].triangles[ties.numbers])
    gone = int(p.rows(ties.corners[0, 0]))
    other = ties.corners[1].copy()
    system.remove([gone])
    sim.step()
    assert (p.rows(other) >= 0).all() == (ties.numbers[1] >= 0)
    system.remove(slice(None))
    sim.step()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_both_paths_have_the_same_bits(dtype: str) -> None:
    ends = []
    for compiled in (False, True):
        built = scene(pm.Attachment("lone", "sheet"), forces=[pm.Gravity(), pm.Drag(k=0.1)], dtype=dtype)
        ends.append(run(built, 0.1, compiled).system.particles.x)
    np.testing.assert_allclose(*ends, atol=1e-4)
    assert dtype == "float32" or ends[0].tobytes() == ends[1].tobytes()


def test_in_a_scene_file_and_back() -> None:
    for tie in (pm.Attachment("lone", "sheet"), pm.Attachment([0, 1], collider=0)):
        built = scene(tie, colliders=[pm.Sphere((0, -3, "t"))])
        again = pm.Scene.from_toml(built.to_toml())
        assert again == built
        assert run(again, 0.02).system.particles.x.tobytes() == run(built, 0.02).system.particles.x.tobytes()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.Attachment("sheet"), "either `to`, the name of a body, or `collider`"),
        (lambda: pm.Attachment("sheet", "lone", collider=0), "either `to`, the name of a body, or `collider`"),
        (lambda: pm.Attachment("sheet", 3), "to = 3 is not allowed"),
        (lambda: scene(pm.Attachment("lone", "shet")).simulation(), "unknown body or group .* did you mean 'sheet'"),
        (lambda: scene(pm.Attachment("lon", "sheet")).simulation(), "unknown group of particles 'lon'"),
        (lambda: scene(pm.Attachment([], "sheet")).simulation(), "has no particles that could be attached"),
        (lambda: scene(pm.Attachment("lone", collider=0)).simulation(), "collider = 0 is not allowed: there are 0"),
        (lambda: scene(pm.Attachment("sheet", "sheet")).simulation(), "no triangle that particle"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make: Any, says: str) -> None:
    with pytest.raises(pm.InvalidInput, match=says):
        make()
