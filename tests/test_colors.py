"""Colours of hot bodies."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.colors import COOLEST, HOTTEST, blackbody, linear, planckian
from pointmass.errors import InvalidInput


@pytest.mark.parametrize(
    ("kelvin", "x", "y"),
    [(1000, 0.6528, 0.3444), (2000, 0.5267, 0.4133), (2856, 0.4476, 0.4074), (6500, 0.3135, 0.3237)],
)
def test_black_bodies_stand_on_the_planckian_locus(kelvin: float, x: float, y: float) -> None:
    # Wyzecki and Stiles, Color Science (1982); the fit of the observer is good to 0.01, best in the visible's middle.
    found = planckian(np.array([float(kelvin)]))[0, :2]
    np.testing.assert_allclose(found, [x, y], atol=0.012 if kelvin < 1500 else 0.004)


def test_hot_things_go_from_red_over_white_to_blue() -> None:
    kelvin = np.linspace(COOLEST, HOTTEST, 500)
    light = blackbody(kelvin)
    assert ((light >= 0) & (light <= 1)).all()
    np.testing.assert_allclose(light.max(axis=1), 1, atol=0.01)
    assert (np.diff(light[:, 2] / light[:, 0]) >= 0).all()
    np.testing.assert_allclose(blackbody(6600.0), 1.0, atol=0.08)  # close to the white of sRGB
    np.testing.assert_array_equal(blackbody([0.0, 1e9]), light[[0, -1]])


def test_a_temperature_is_a_colour() -> None:
    np.testing.assert_allclose(linear(2000.0, 3.0), [*(3 * blackbody(2000.0)), 1], rtol=1e-6)
    for wrong in (300, 1e5, float("nan"), None, [1]):
        with pytest.raises(InvalidInput, match="color"):
            linear(wrong)  # type: ignore[arg-type]
