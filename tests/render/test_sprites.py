"""Streaks, smeared balls, smoke and flakes."""

import math

import numpy as np
import pytest
from render_scenes import FRONT, frame, square

from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Points, Triangles
from pointmass.render import Style, image
from pointmass.render.camera import look
from pointmass.render.haze import light
from pointmass.render.image import _light
from pointmass.render.lamp import lamp
from pointmass.render.shadow import no_shadow
from pointmass.render.sprites import PUFF, sprites

BLACK = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0.0, pool=0.0)
SIZE = (160, 120)
SCALE = 60.0 / math.tan(math.radians(15.0)) / 10.0  # pixels of a metre at the origin


def shone(places, *drawables, size=SIZE, style=BLACK, camera=FRONT):
    """Linear light of the picture before the tone map, shape (height, width, 3)."""
    return _light(frame(places, *drawables), camera, look(camera, size), style)[0].transpose(1, 2, 0).astype(float)


def spark(motion=None, radius=0.15, alpha=1.0, index=None):
    return Points(name="s", index=index, radius=radius, color=(0.4, 0.2, 0.1, alpha), glow=True, motion=motion)


@pytest.mark.parametrize("radius", [0.002, 0.03, 0.2])
@pytest.mark.parametrize("motion", [(1e-9, 0, 0), (0.05, 0.03, 0), (1.5, 0.9, 0), (0, 2, 0), (0, 0, 3.0), (1, 1, -1)])
def test_a_streak_has_the_light_of_its_spark(motion, radius):
    place = np.array([[0.013, -0.021, 0.0]])
    still, moved = (shone(place, spark(m, radius)) for m in (None, np.array([motion])))
    mean = 10 / (10 + motion[2])  # of its area on the way, which begins nearer to the eye or farther away
    assert moved.sum() == pytest.approx(mean * still.sum(), rel=0.01 if mean == 1 else 0.03)
    if np.hypot(*motion[:2]) > 0.9:
        assert moved.max() < 0.5 * still.max()


def test_a_streak_is_the_mean_of_sparks_on_its_way():
    # The naive way: many sparks, each a share as bright.
    end, motion = np.array([0.7, 0.3, 0.0]), np.array([1.3, 0.4, 0.0])
    count = 400
    way = end - motion * ((np.arange(count) + 0.5) / count)[:, None]
    many = shone(way, spark(alpha=1.0 / count))
    one = shone(end[None], spark(motion[None]))
    assert np.abs(one - many).max() < 2e-3 * many.max()


def test_a_streak_ends_at_solid_things():
    places = np.array([[1.5, 0.0, -1.0]])
    seen = shone(places, square(1.0), spark(np.array([[3.0, 0, 0]])))
    wall = shone(places, square(1.0))
    within = np.s_[50:70, 80 - int(0.8 * SCALE) : 80 + int(0.8 * SCALE)]
    assert np.abs(seen - wall)[within].max() < 1e-5
    assert (seen - wall)[60, 80 + int(1.2 * SCALE), 0] > 0.01


DARK = Style(light=(0, 0, -1), ambient=0.0, bottom=(1, 1, 1), top=(1, 1, 1), bloom=0.0, pool=0.0, shadows=False)


def ball(motion=None, radius=0.3, color=(0.0, 0.0, 0.0, 1.0), **more):
    return Points(name="b", radius=radius, color=color, motion=motion, **more)


def covered(*drawables, place=(0.013, -0.021, 0.0)):
    """Which part of each pixel of a white picture black things hide, shape (height, width)."""
    return 1.0 - shone(np.array([place]), *drawables, style=DARK)[:, :, 1]


@pytest.mark.parametrize("alpha", [1.0, 0.4])
@pytest.mark.parametrize("radius", [0.01, 0.06, 0.3])
@pytest.mark.parametrize("motion", [(0.06, 0, 0), (0.1, 0.07, 0), (0, -0.7, 0), (1.1, 1.3, 0)])
def test_a_smeared_ball_hides_as_much_as_a_sharp_one(motion, radius, alpha):
    hidden = covered(ball(np.array([motion]), radius, (0, 0, 0, alpha)))
    assert hidden.sum() == pytest.approx(alpha * math.pi * (radius * SCALE) ** 2, rel=0.05)
    assert hidden.min() > -1e-6
    assert hidden.max() < alpha + 1e-6


@pytest.mark.parametrize("motion", [(0.9, 0.4, 0.0), (0.25, -0.1, 0.0), (0.5, 0.2, 1.5)])
def test_a_smeared_ball_is_the_mean_of_balls_on_its_way(motion):
    # The naive way: the mean of many pictures while the shutter is open.
    end, motion, count = np.array([0.4, 0.2, 0.0]), np.array(motion), 200
    lit_ball = ball(color=(0.6, 0.3, 0.2, 1.0))
    way = end - motion * ((np.arange(count) + 0.5) / count)[:, None]
    style = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0.0, pool=0.0, shadows=False)
    mean = np.mean([shone(x[None], lit_ball, style=style) for x in way], axis=0)
    one = shone(end[None], ball(motion[None], color=lit_ball.color), style=style)
    assert np.abs(one - mean).max() < 0.15 * mean.max()
    assert one.sum() == pytest.approx(mean.sum(), rel=0.05)


def test_a_ball_that_hardly_moves_is_sharp_and_one_from_behind_the_eye_too():
    place = (0.0, 0.0, 9.5)
    for motion, spot in (((1e-3, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.1, 0.0, -3.0), place)):
        still, moved = (covered(ball(m, 0.1), place=spot) for m in (None, np.array([motion])))
        np.testing.assert_array_equal(moved, still)


def test_a_smeared_ball_passes_behind_solid_things():
    place, wall = (1.5, 0.0, -1.0), square(1.0, color=(0, 0, 0, 1))
    passing = ball(np.array([[3.0, 0, 0]]), color=(1.0, 1.0, 1.0, 1.0))
    style = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0.0, pool=0.0, shadows=False)
    seen, alone = (shone(np.array([place]), wall, *more, style=style) for more in ((passing,), ()))
    within = np.s_[45:75, 80 - int(0.95 * SCALE) : 80 + int(0.95 * SCALE)]
    np.testing.assert_allclose(seen[within], alone[within], atol=1e-5)
    assert (seen - alone).max() > 0.05


def puff(alpha=0.5, radius=0.5, color=(0.5, 0.5, 0.5), **more):
    return Points(name="p", radius=radius, color=(*color, alpha), soft=True, **more)


def test_a_puff_lets_a_share_through():
    wall = (0.8, 0.1, 0.1, 1.0)
    behind = shone(np.zeros((1, 3)), square(4.0, -2.0, wall), style=Style(shadows=False, bloom=0, pool=0))[60, 80]
    alone = shone(np.zeros((1, 3)), puff(), style=BLACK)[60, 80]
    both = shone(np.zeros((1, 3)), square(4.0, -2.0, wall), puff(), style=Style(shadows=False, bloom=0, pool=0))[60, 80]
    assert both == pytest.approx(alone + 0.5 * behind, abs=0.01)


@pytest.mark.parametrize(("z", "share"), [(2.0, 1.0), (0.0, 0.5), (-2.0, 0.0)])
def test_a_puff_is_soft_where_it_meets_something_solid(z, share):
    style = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0, pool=0, shadows=False)
    place, wall = np.array([[0, 0, z]]), square(4.0, 0.0, (0.0, 0.0, 0.0, 1.0))
    free, met, dark = (shone(place, *d, style=style)[60, 80] for d in ((puff(),), (wall, puff()), (wall,)))
    assert met == pytest.approx(share * free + (1.0 - 0.5 * share) * dark, abs=0.01)


def lit(places, alpha=0.5, normals=None, glows=None, style=None):
    """Light that leaves the middles of grey sprites, shape (n, 3)."""
    style = style or Style(light=(0, 1, 0), ambient=0.0, pool=0.0)
    drawn = Points(name="p", radius=0.2, color=(1, 1, 1, alpha), soft=normals is None, normals=normals)
    view = look(FRONT, SIZE)
    rows = sprites(drawn, frame(places), view, 10.0).rows
    light(rows, lamp(style, view, FRONT, no_shadow()), no_shadow(), np.zeros((0, 6)) if glows is None else glows)
    return rows[:, 9:12]


def test_puffs_take_each_others_light():
    column = np.stack([np.zeros(12), np.linspace(2, -2, 12), np.zeros(12)], axis=1)
    down = lit(column)[:, 0]
    assert (np.diff(down) < 0).all()
    assert down[-1] < 0.3 * down[0]
    np.testing.assert_allclose(lit(column[::-1])[::-1, 0], down, rtol=1e-5)  # in whatever order they are given
    apart = np.stack([np.linspace(-4, 4, 12), np.zeros(12), np.zeros(12)], axis=1)
    np.testing.assert_allclose(lit(apart), lit(apart[:1])[0] * np.ones((12, 1)), rtol=1e-5)
    thin = lit(column, alpha=0.01)[:, 0]
    assert thin.min() > 0.85 * thin.max()


def test_at_night_only_glows_light_smoke():
    night = Style(bottom=(0, 0, 0), top=(0, 0, 0), bloom=0, pool=0)
    assert shone(np.zeros((1, 3)), puff(daylight=0.0), style=night).max() == 0
    half, whole = (shone(np.zeros((1, 3)), puff(daylight=d), style=night) for d in (0.5, 1.0))
    np.testing.assert_allclose(half, 0.5 * whole, rtol=1e-5)


def test_glows_light_smoke_by_the_square_of_the_distance():
    places = np.array([[0.0, 0, 0], [3.0, 0, 0]])
    dark = Style(light=(0, -1, 0), ambient=0.0, pool=0.0)
    view = look(FRONT, SIZE)
    near = np.column_stack([view.see(np.array([[0.0, 1.0, 0.0]])), [[0.3, 0.2, 0.1]]])
    gained = lit(places, glows=near, style=dark) - lit(places, style=dark)
    expected = np.array([[0.3, 0.2, 0.1]]) / np.array([[1.0 + 0.04], [10.0 + 0.04]])
    np.testing.assert_allclose(gained, expected, rtol=1e-3)
    # A thousand in a small place are as one.
    many = np.repeat(near, 1000, axis=0) * np.array([1, 1, 1, 1e-3, 1e-3, 1e-3])
    many[:, :3] += np.random.default_rng(1).normal(0, 0.01, (1000, 3))
    np.testing.assert_allclose(lit(places, glows=many, style=dark) - lit(places, style=dark), expected, rtol=0.02)


def test_one_puff_far_away_spoils_nothing():
    random = np.random.default_rng(7)
    cloud = random.normal(0, 0.5, (3000, 3))
    alone, joined = lit(cloud, 0.1), lit(np.concatenate([cloud, [[0, 1e9, 0], [1e9, 0, -5]]]), 0.1)[:3000]
    np.testing.assert_allclose(joined, alone, rtol=0.05)


def test_smoke_is_the_same_in_any_order_of_drawing():
    random = np.random.default_rng(5)
    places = random.normal(0, 0.8, (300, 3))
    shuffled = random.permutation(300)
    one, other = (image(frame(p, puff(0.2, 0.4)), camera=FRONT, size=SIZE) for p in (places, places[shuffled]))
    assert np.abs(one.astype(int) - other).max() <= 1


@pytest.mark.parametrize(
    ("normal", "wide", "high"), [((0, 0, 1), 1.0, 1.0), ((0.8, 0, 0.6), 0.6, 1.0), ((0, 1, 1), 1.0, 0.7)]
)
def test_flakes_are_discs_seen_at_a_slant(normal, wide, high):
    flake = Points(name="f", radius=1.0, color=(0.6, 0.6, 0.6, 1.0), normals=np.array([normal], float))
    seen = shone(np.zeros((1, 3)), flake, size=(320, 240))[:, :, 1]
    covered = seen / seen.max()
    assert covered.sum() == pytest.approx(math.pi * wide * high * (2 * SCALE) ** 2, rel=0.08)
    rows, columns = np.nonzero(covered > 0.5)
    assert np.ptp(columns) + 1 == pytest.approx(2 * wide * 2 * SCALE, abs=4)
    assert np.ptp(rows) + 1 == pytest.approx(2 * high * 2 * SCALE, abs=4)


def test_small_and_blurred_flakes_keep_their_light():
    def total(radius, z=0.0, way=0.0):
        motion, normals = np.array([[way, 0.3 * way, 0]]), np.array([[0.0, 0, 1]])
        flake = Points(name="f", radius=radius, color=(0.6, 0.6, 0.6, 1.0), normals=normals, motion=motion)
        return shone(np.array([[0, 0, z]]), flake, size=(320, 240))[:, :, 1].sum()

    assert total(0.01) / total(0.005) == pytest.approx(4.0, rel=0.05)
    assert total(0.02, way=0.5) == pytest.approx(total(0.02), rel=0.02)
    assert total(0.02, 8.0) / total(0.02) == pytest.approx(25.0, rel=0.2)  # near the eye it is large, and out of focus


def test_a_puff_ends_at_its_reach():
    seen = shone(np.zeros((1, 3)), puff(0.9, 1.0))[:, :, 1]
    columns = np.flatnonzero(seen.max(axis=0) > 0)
    assert np.ptp(columns) + 1 == pytest.approx(2 * PUFF * SCALE, abs=3)


def test_sprites_with_nothing_and_with_numbers_that_are_not_finite():
    bad = np.array([[0, 0, 0], [np.nan, 0, 0], [0, 0, 10.0], [0, 0, 40.0], [1e300, 0, 0]])
    for more in ({"soft": True}, {"normals": np.zeros((5, 3))}, {"glow": True, "motion": bad}, {"motion": bad}):
        picture = image(frame(bad, Points(name="p", radius=0.2, **more)), camera=FRONT, size=SIZE)
        assert picture.shape == (120, 160, 3)
    for more in ({"soft": True}, {"normals": np.zeros((0, 3))}, {"glow": True, "motion": np.zeros((0, 3))}):
        image(frame(np.zeros((0, 3)), Points(name="p", **more)), camera=FRONT, size=SIZE)


@pytest.mark.parametrize(
    "more",
    [
        {"normals": np.zeros((2, 3))},
        {"soft": True, "motion": np.zeros((2, 3))},
        {"glow": True, "motion": np.zeros((4, 3))},
        {"motion": np.zeros((2, 3))},
    ],
)
def test_arrays_that_do_not_fit_are_named(more):
    with pytest.raises(InvalidInput, match="'p' has 3 items"):
        image(frame(np.zeros((3, 3)), Points(name="p", **more)), camera=FRONT, size=SIZE)


def test_smoke_stands_in_the_shadow_of_solid_things():
    roof = Triangles(
        name="roof",
        vertices=np.array([[-2, 2, -2], [2, 2, -2], [2, 2, 2], [-2, 2, 2]], float),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    camera = Camera(position=(0.0, 0.0, 10.0), target=(0.0, 0.0, 0.0), fov=40.0)
    style = Style(light=(0, 1, 0), bottom=(0, 0, 0), top=(0, 0, 0), bloom=0, pool=0, ambient=0.1)
    shaded, free = (shone(np.zeros((1, 3)), *d, puff(), camera=camera, style=style) for d in ((roof,), ()))
    assert shaded[60, 80, 1] < 0.5 * free[60, 80, 1]
