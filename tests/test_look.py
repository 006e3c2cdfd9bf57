"""What a frame shows."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Curves, Points, Segments, Triangles
from pointmass.look import PALETTES, linear, palette


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
        np.testing.assert_allclose(radius, radius[0], rtol=2e-3)


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


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"particles": "balls"}, "must be solid, glow or none"),
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
