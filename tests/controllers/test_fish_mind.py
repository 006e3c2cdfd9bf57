"""What fish see, feel and decide: closed forms, without any run."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.controllers import intention as order
from pointmass.controllers import mental_state as mental
from pointmass.controllers import senses

CALM = {
    **{"obstacle": False, "crowded": False, "fear": 0.0, "greatest": 0.0, "hunger": 0.0, "libido": 0.0},
    **{"before": -1, "suits": True, "schools": True, "coin": 0.2, "afraid": 0.3, "panic": 0.7, "urge": 0.3},
}


@pytest.mark.parametrize(("angle", "seen"), [(0, True), (149, True), (151, False), (180, False)])
def test_fish_see_300_degrees(angle, seen):
    a = math.radians(angle)
    for up in (0.0, 1.0):
        target = np.array([math.cos(a), up * math.sin(a), (1 - up) * math.sin(a)])
        assert senses.in_view(np.zeros(3), np.array([1.0, 0.0, 0.0]), target, 2.0) == seen
        assert not senses.in_view(np.zeros(3), np.array([1.0, 0.0, 0.0]), 3 * target, 2.0)


def test_nobody_sees_through_an_obstacle():
    eyes, targets = np.zeros((3, 3)), np.array([(4.0, 0, 0), (4, 3, 0), (1, 0, 0)])
    assert senses.hidden(eyes, targets, [pm.Sphere((2, 0, 0), 0.5)], 0.0).tolist() == [True, False, False]


def test_the_nearest_are_found():
    found, d = senses.nearest(np.zeros((1, 3)), np.array([(3.0, 0, 0), (1, 0, 0), (0, 2, 0), (9, 0, 0)]), 4, 5.0)
    assert found[0, :3].tolist() == [1, 2, 0]
    assert d[0].tolist() == [1.0, 2.0, 3.0, np.inf]


def test_stimulus_hunger_libido_and_fear_have_their_closed_forms():
    np.testing.assert_allclose(
        mental.stimulus([0.01, 0.05, 0.125, 0.2, 9.0], 0.05, 0.2), [0, 0, 1 / 3, 1, 1], atol=1e-12
    )
    assert mental.hunger(0, 0.0, 5.0) == 1.0
    assert mental.hunger(5, 0.0, 5.0) == 0.0
    assert mental.hunger(5, 100.0, 5.0) == pytest.approx(100 * mental.P0)
    assert mental.hunger(50, 0.0, 5.0) == 0.0
    assert mental.hunger(5, 0.0, 5.0, 0.5) == pytest.approx(0.4)
    assert mental.libido(100.0, 0.5) == pytest.approx(0.125)
    assert mental.libido(1e6, 0.5) == 1.0
    total, most = mental.fear([[2.0, np.inf], [2.0, 4.0], [0.5, 0.5]], 1.0)
    np.testing.assert_allclose(total, [0.5, 0.75, 1.0])
    np.testing.assert_allclose(most, [0.5, 0.5, 1.0])


@pytest.mark.parametrize(
    ("changes", "routine"),
    [
        ({}, order.WANDER),
        ({"suits": False}, order.LEAVE),
        ({"suits": False, "hunger": 0.5}, order.EAT),
        ({"hunger": 0.4, "libido": 0.5}, order.MATE),
        ({"hunger": 0.2, "libido": 0.2}, order.WANDER),
        ({"hunger": 0.5, "libido": 0.5}, order.EAT),
        ({"hunger": 0.5, "libido": 0.5, "coin": 0.8}, order.MATE),
        ({"hunger": 0.5, "libido": 0.5, "before": order.MATE}, order.MATE),
        ({"hunger": 0.1, "before": order.EAT}, order.EAT),
        ({"hunger": 0.9, "fear": 0.4, "greatest": 0.4}, order.SCHOOL),
        ({"hunger": 0.9, "fear": 0.8, "greatest": 0.8}, order.ESCAPE),
        ({"fear": 0.4, "greatest": 0.4, "schools": False}, order.ESCAPE),
        ({"fear": 0.9, "greatest": 0.9, "crowded": True}, order.AVOID_FISH),
        ({"fear": 0.9, "greatest": 0.9, "crowded": True, "obstacle": True}, order.AVOID_OBSTACLE),
    ],
)
def test_the_order_of_concerns(changes, routine):
    assert order.NAMES[int(order.intention(**{**CALM, **changes}))] == order.NAMES[routine]
