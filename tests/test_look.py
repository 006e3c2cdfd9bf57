"""What a frame shows."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.colors import PALETTES, blackbody, linear, palette
from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Curves, Points, Segments, Triangles
from pointmass.over_life import CURVES, GRADIENTS, values


def last_frame(system: pm.ParticleSystem, look: pm.Look, frames: int = 20) -> pm.Frame:
    return list(pm.Simulation(system, look=look, dt=1 / 60).frames(frames))[-1]


def of_kind(frame: pm.Frame, kind: type) -> list:  # type: ignore[type-arg]
    return [d for d in frame.drawables if isinstance(d, kind)]


def falling() -> pm.ParticleSystem:
    p = pm.Particles([[0, 1, 0], [1, 2, 0]], radius=[0.1, 0.0], heat=[0.0, 1.0])
    return pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)])], [pm.Plane(), pm.Sphere((0, -5, 0))])


def test_particles_springs_and_surfaces_are_drawn() -> None:
    frame = last_frame(falling(), pm.Look())
    (points,), (segments,), surfaces = (of_kind(frame, k) for k in (Points, Segments, Triangles))
    assert not points.glow
    assert points.radius[0] == pytest.approx(0.1)
    assert points.radius[1] > 0
    np.testing.assert_array_equal(segments.pairs, [[0, 1]])
    assert [s.name for s in surfaces] == ["plane 0", "sphere 1"]


@pytest.mark.parametrize(("kind", "corners", "faces"), [("birds", 4, 2), ("fish", 6, 3)])
def test_animals_look_where_they_go_and_stand_upright(kind: str, corners: int, faces: int) -> None:
    v = np.array([[0, 0, 2.0], [3, 4, 0], [0, -1, 0], [0, 0, 0]])
    p = pm.Particles(np.arange(12.0).reshape(4, 3), v, hunter=[0, 0, 1.0, 0])
    look = pm.Look(particles=kind, size=0.5, groups={"hunter": {"particles": kind, "size": 0.5, "color": "#ff0000"}})
    hunter, rest = of_kind(last_frame(pm.ParticleSystem(p), look, 7), Triangles)
    assert (len(rest.vertices), len(rest.faces), len(hunter.vertices)) == (3 * corners, 3 * faces, corners)
    assert (hunter.color[:, 0] > 0.9).all()
    around = np.concatenate([rest.vertices[: 2 * corners], hunter.vertices, rest.vertices[2 * corners :]])
    shape = around.reshape(4, corners, 3) - p.x[:, None]
    ways = np.array([[0, 0, 1.0], [0.6, 0.8, 0], [0, -1, 0], [1, 0, 0]])
    head = shape[:, 0] - 0.5 * ways
    assert np.abs(head).max() < 0.05  # a fish swings its head a little
    sizes = np.linalg.norm(shape, axis=2)
    assert (sizes < 0.9).all()
    across = shape[:, 3] - shape[:, 1]  # from wing to wing, from the back to the belly
    assert np.abs((across * ways).sum(axis=1)).max() < 1e-5
    upright = across[[0, 1, 3], 1]
    assert (upright < -0.2).all() if kind == "fish" else np.abs(upright).max() < 1e-5


def test_what_is_switched_off_is_not_drawn() -> None:
    frame = last_frame(falling(), pm.Look(particles="none", springs=False, colliders=False))
    assert frame.drawables == ()


def test_colour_by_attribute_and_speed() -> None:
    (points,) = of_kind(last_frame(falling(), pm.Look(color_by="heat", color_range=(0, 1), palette="ice")), Points)
    np.testing.assert_allclose(points.color, [linear(PALETTES["ice"][0]), linear(PALETTES["ice"][-1])], atol=1e-6)
    with pytest.raises(InvalidInput, match="heat"):
        last_frame(falling(), pm.Look(color_by="haet"))


def test_trail_follows_the_particle_for_its_span() -> None:
    p = pm.Particles([[0, 0, 0]], v=[[1, 0, 0]])
    look = pm.Look(trails=0.1)
    (curve,) = of_kind(last_frame(pm.ParticleSystem(p), look, 31), Curves)
    np.testing.assert_allclose(curve.vertices[:, 0], np.arange(24, 31) / 60, atol=1e-6)
    assert (np.diff(curve.width) > 0).all()
    np.testing.assert_array_equal(curve.offsets, [0, 7])


def test_trails_of_the_dead_vanish() -> None:
    nozzle = pm.Nozzle(rate=10, lifetime=0.3, speed=1.0)
    sim = pm.Simulation(
        pm.ParticleSystem(pm.Particles(np.zeros((0, 3)))), emitters=[nozzle], look=pm.Look(trails=1.0), dt=1 / 60
    )
    for frame in sim.frames(60):
        for curve in of_kind(frame, Curves):
            assert len(curve.offsets) == len(frame.ids) + 1
            ends = curve.vertices[curve.index[curve.offsets[1:] - 1]]
            np.testing.assert_allclose(ends, frame.positions, atol=1e-6)


def test_field_arrows_point_along_the_flow() -> None:
    p = pm.Particles([[-1, -1, 0], [1, 1, 0]])
    system = pm.ParticleSystem(p, [pm.Flow(("-y", "x", "0"))])
    frame = last_frame(system, pm.Look(arrows=8, streamlines=9), 2)
    (arrows,), (curves,) = of_kind(frame, Arrows), of_kind(frame, Curves)
    middle = arrows.vertices + 0.5 * arrows.vectors
    along = np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], axis=1)
    np.testing.assert_allclose(np.cross(arrows.vectors, along), 0, atol=1e-6)
    assert arrows.version == curves.version == 0
    for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True):  # circles about the origin
        radius = np.linalg.norm(curves.vertices[a:b], axis=1)
        np.testing.assert_allclose(radius, radius[0], rtol=2e-3, atol=2e-3)  # who stands still may be off, too


def test_a_field_that_changes_is_drawn_anew() -> None:
    p = pm.Particles([[-1, -1, 0], [1, 1, 0]])
    frame = last_frame(pm.ParticleSystem(p, [pm.Flow(("sin(t)", "x", "0"))]), pm.Look(arrows=4), 3)
    (arrows,) = of_kind(frame, Arrows)
    assert arrows.version == 2


def test_moving_surfaces_are_drawn_where_they_are() -> None:
    system = pm.ParticleSystem(pm.Particles([[0, 3, 0]]), colliders=[pm.Sphere(("t", "0", "0"), 0.5)])
    frame = last_frame(system, pm.Look(), 61)
    (ball,) = of_kind(frame, Triangles)
    assert ball.version == 60
    np.testing.assert_allclose(ball.vertices.mean(axis=0)[0], 1.0, atol=1e-6)


def test_palette_ends_and_colours() -> None:
    np.testing.assert_allclose(
        palette("fire", np.array([0.0, 1.0])), [linear(PALETTES["fire"][0]), linear(PALETTES["fire"][-1])]
    )
    np.testing.assert_allclose(linear("white"), 1.0)
    np.testing.assert_allclose(linear("#bc0000")[0], 0.5029, atol=1e-3)  # sRGB 188 is half the light


def aging(**look: object) -> Points:
    """Three particles at age 0.5 s that live for 1 s, 2 s and for ever."""
    p = pm.Particles(np.eye(3), v=[[0, 6, 0]], radius=0.1, lifetime=[1, 2, np.inf], red=0.1, green=0.2, blue=[0, 1, 0])
    sim = pm.Simulation(pm.ParticleSystem(p), look=pm.Look(**look), dt=0.125, compiled=False)  # type: ignore[arg-type]
    sim.step(4)
    (points,) = of_kind(sim.frame(), Points)
    return points


def test_looks_change_over_the_life() -> None:
    points = aging(
        size_over_life="grow",
        opacity=0.5,
        opacity_over_life=((0, 0.2), (0.5, 1.0)),
        brightness=2.0,
        brightness_over_life=((0.25, 1), (0.75, 3)),
        color_over_life=((0, "black"), (1, "white")),
    )
    np.testing.assert_allclose(points.radius, [0.05, 0.025, 0.0], rtol=1e-6)
    np.testing.assert_allclose(points.color[:, 3], [0.5, 0.3, 0.1], rtol=1e-6)
    own = np.array([[0.1, 0.2, 0], [0.1, 0.2, 1], [0.1, 0.2, 0]])  # on which the gradient is a factor
    np.testing.assert_allclose(points.color[:, :3], 2 * np.array([[1.0], [0.25], [0.0]]) * own, rtol=1e-6)


def test_gradients_and_temperatures() -> None:
    p = pm.Particles(np.eye(3), lifetime=1.0, temperature=[1000, 2000, 1e5])
    sim = pm.Simulation(pm.ParticleSystem(p), look=pm.Look(color_by="temperature"), dt=0.25, compiled=False)
    (points,) = of_kind(sim.frame(), Points)
    np.testing.assert_allclose(points.color[:, :3], blackbody([1000, 2000, 1e5]), rtol=1e-6)
    sim.look = pm.Look(color_over_life=((0, 3000), (1, 1000)))
    sim.step(2)
    (points,) = of_kind(sim.frame(), Points)
    np.testing.assert_allclose(points.color[:, :3], [blackbody(2000)] * 3, rtol=1e-6)


@pytest.mark.parametrize("name", [*CURVES, *GRADIENTS])
def test_named_curves_are_as_written(name: str) -> None:
    pairs = CURVES.get(name) or GRADIENTS[name]
    look = pm.Look(size_over_life=pairs) if name in CURVES else pm.Look(color_over_life=pairs)  # type: ignore[arg-type]
    assert (look.size_over_life or look.color_over_life) == pairs
    if name in CURVES:
        np.testing.assert_array_equal(values(name, np.array([f for f, _ in pairs])), [v for _, v in pairs])


def test_a_frame_within_a_step_shows_ages_of_its_own_time() -> None:
    p = pm.Particles([[0, 0, 0]], lifetime=1.0)
    look = pm.Look(size=1.0, size_over_life="grow")
    for frame in pm.Simulation(pm.ParticleSystem(p), look=look, dt=0.1, compiled=False).frames(8, fps=13):
        (points,) = of_kind(frame, Points)
        np.testing.assert_allclose(points.radius, frame.time, atol=1e-6)


def test_a_streak_is_the_way_since_the_shutter_opened_or_the_birth() -> None:
    points = aging(particles="glow", shutter=0.25)
    np.testing.assert_allclose(points.motion, [[0, 1.5, 0]] * 3, rtol=1e-6)
    points = aging(particles="glow", shutter=2.0)
    np.testing.assert_allclose(points.motion, [[0, 3, 0]] * 3, rtol=1e-6)


def test_in_a_flow_the_shutter_and_the_colours_know_the_speed_of_the_field() -> None:
    p = pm.Particles([[1.0, 0, 0], [0, 2.0, 0]])
    look = pm.Look(shutter=0.25, color_by="speed", color_range=(0.0, 6.0))
    system = pm.ParticleSystem(p, [pm.Flow(("-3*y", "3*x", "0"))])
    sim = pm.Simulation(system, look=look, dt=1.0, compiled=False)
    p.age[:] = 1.0
    (points,) = of_kind(sim.frame(), Points)
    np.testing.assert_allclose(points.motion, [[0, 0.75, 0], [-1.5, 0, 0]], rtol=1e-6)
    np.testing.assert_allclose(points.color[:, :3], palette("fire", np.array([0.5, 1.0]))[:, :3], rtol=1e-6)


def test_groups_look_otherwise() -> None:
    p = pm.Particles(np.arange(15.0).reshape(5, 3), hot=[0, 0, 1, 1, 0], radius=0.1, red=1, green=0, blue=0)
    p.tag("smoke", [0, 3])
    groups = {"smoke": {"particles": "smoke", "size": 0.5}, "hot": pm.Look(particles="glow", shutter=0.1)}
    frame = last_frame(pm.ParticleSystem(p), pm.Look(groups=groups, trails=0.5), 5)  # type: ignore[arg-type]
    smoke, hot, rest = of_kind(frame, Points)
    assert [d.name for d in (smoke, hot, rest)] == ["particles of smoke", "particles of hot", "particles"]
    np.testing.assert_array_equal(smoke.index, [0, 3])
    np.testing.assert_array_equal(hot.index, [2])  # 3 has gone to the first
    np.testing.assert_array_equal(rest.index, [1, 4])
    assert (smoke.soft, smoke.radius, hot.glow, hot.motion.shape) == (True, 0.5, True, (1, 3))
    assert smoke.color.shape == (2, 4)
    (trails,) = of_kind(frame, Curves)
    assert len(trails.offsets) == 3
    with pytest.raises(InvalidInput, match="unknown group or attribute of particles in look"):
        last_frame(pm.ParticleSystem(p), pm.Look(groups={"smok": pm.Look()}))


@pytest.mark.parametrize(
    ("group", "sentence"),
    [
        ("glow", "look.groups.a must be a look or a table"),
        ({"trails": 1.0}, "unknown key in look.groups.a: 'trails'"),
        ({"size": -1}, "look.groups.a: look.size = -1"),
        (pm.Look(trails=1.0), "look.groups.a.trails is not allowed"),
    ],
)
def test_bad_looks_of_groups(group: object, sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        pm.Look(groups={"a": group})  # type: ignore[dict-item]
    if isinstance(group, dict | str):
        text = f"[look.groups]\na = {group!r}\n".replace(": ", " = ").replace("{'", "{").replace("' =", " =")
        with pytest.raises(InvalidInput, match=r"look\.groups\.a"):
            pm.Scene.from_toml('[[bodies]]\ntype = "points"\nx = [[0, 0, 0]]\n' + text)


def test_looks_survive_as_text() -> None:
    look = pm.Look(
        particles="smoke",
        color=2000.0,
        size_over_life=[[0, 1], [1, 4]],  # type: ignore[arg-type]
        opacity_over_life="fade",
        color_over_life=[[0, "#ffffff"], [0.5, 2000]],  # type: ignore[arg-type]
        shutter=0.01,
        groups={"points": {"particles": "glow", "size_over_life": [[0, 1], [1, 2]]}, "hot": pm.Look(color=900.0)},  # type: ignore[dict-item]
    )
    scene = pm.Scene(bodies=[pm.points([[0, 0, 0], [1, 0, 0]], lifetime=[1.5, np.inf])], look=look)
    again = pm.Scene.from_toml(scene.to_toml())
    assert again.look == look
    assert again == scene
    np.testing.assert_array_equal(again.simulation().system.particles.lifetime, [1.5, np.inf])


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"particles": "balls"}, "must be solid, glow, smoke, flakes, birds, fish, none"),
        ({"opacity": 1.5}, "look.opacity = 1.5"),
        ({"shutter": -1.0}, "look.shutter = -1.0"),
        ({"color": 300.0}, "color = 300.0"),
        ({"size_over_life": "grwo"}, "did you mean 'grow'"),
        ({"size_over_life": ()}, "look.size_over_life must be a list of pairs"),
        ({"size_over_life": ((0.0, 1.0, 2.0),)}, "must be a list of pairs"),
        ({"size_over_life": ((0.5, 1.0), (0.2, 2.0))}, "look.size_over_life is out of order"),
        ({"size_over_life": ((0.5, 1.0), (0.5, 2.0))}, "0.5 comes after 0.5"),
        ({"size_over_life": ((0.0, 1.0), (1.5, 2.0))}, "a fraction of look.size_over_life = 1.5"),
        ({"brightness_over_life": ((0.0, -1.0),)}, "the value at 0.0 of look.brightness_over_life = -1.0"),
        ({"opacity_over_life": ((0.0, 2.0),)}, "at most 1"),
        ({"opacity_over_life": ((float("nan"), 0.0),)}, "a fraction of look.opacity_over_life = nan"),
        ({"color_over_life": ((0.0, "reddish"),)}, "color 'reddish'"),
        ({"color_over_life": "hot"}, "unknown gradient"),
        ({"color": "reddish"}, "color 'reddish' is not known"),
        ({"palette": "fyre"}, "did you mean 'fire'"),
        ({"size": 0.0}, "look.size = 0.0"),
        ({"trails": -1.0}, "look.trails = -1.0"),
        ({"arrows": 2.5}, "look.arrows = 2.5"),
        ({"field_box": ((0, 0, 0),)}, "look.field_box"),
    ],
)
def test_bad_looks_are_refused_in_one_sentence(values: dict[str, object], sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        pm.Look(**values)  # type: ignore[arg-type]
