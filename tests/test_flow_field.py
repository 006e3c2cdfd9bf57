"""The velocity field of a system: exact derivatives, arrows and streamlines."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.flow_field import curl, divergence, field_arrows, field_of, grid, streamlines

PLACES = np.random.default_rng(3).uniform(-2, 2, (40, 3))
X, Y, Z = PLACES.T
LOW, HIGH = np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 0.0])
FIELDS = {  # formulas, divergence and curl
    "rotation": (("-y", "x", "0"), 0 * X, [0 * X, 0 * X, 0 * X + 2]),
    "saddle": (("x", "-y", "0"), 0 * X, [0 * X, 0 * X, 0 * X]),
    "source": (("x", "y", "z"), 0 * X + 3, [0 * X, 0 * X, 0 * X]),
    "shear": (("y*z", "0", "0"), 0 * X, [0 * X, Y, -Z]),
    "ABC": (
        ("sin(z) + cos(y)", "sin(x) + cos(z)", "sin(y) + cos(x)"),
        0 * X,
        [np.cos(Y) + np.sin(Z), np.cos(Z) + np.sin(X), np.cos(X) + np.sin(Y)],  # it is its own curl
    ),
    "radial": (("x**3", "t*y**2", "0"), 3 * X**2 + 2 * 0.7 * Y, [0 * X, 0 * X, 0 * X]),
}


def flow(*velocity: str) -> pm.ParticleSystem:
    return pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Flow(velocity)])


def wind(velocity: object) -> pm.ParticleSystem:
    return pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Gravity(), pm.Wind(velocity, k=0.1)])


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("air", [False, True])
def test_divergence_and_curl_are_exact(name: str, air: bool) -> None:
    velocity, spread, turned = FIELDS[name]
    field = field_of(wind(pm.Flow(velocity)) if air else flow(*velocity))
    assert field is not None
    gradient = field.gradient(0.7, PLACES)
    np.testing.assert_allclose(divergence(gradient), spread, atol=1e-13)
    np.testing.assert_allclose(curl(gradient), np.stack(turned, axis=1), atol=1e-13)
    assert field.steady == ("t" not in "".join(velocity))


def test_curl_noise_is_free_of_divergence_and_its_slopes_are_those_of_the_values() -> None:
    field = field_of(pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.CurlNoise(octaves=1)]))
    assert field is not None
    gradient, h = field.gradient(0.3, PLACES), 1e-5
    np.testing.assert_allclose(divergence(gradient), 0, atol=1e-12)
    for axis in range(3):
        aside = h * np.eye(3)[axis]
        slope = (field.velocity(0.3, PLACES + aside) - field.velocity(0.3, PLACES - aside)) / (2 * h)
        np.testing.assert_allclose(gradient[:, :, axis], slope, atol=1e-7)  # h^2 times the third derivative / 6


def test_the_field_is_the_sum_of_flows_and_the_first_wind_that_blows() -> None:
    both = pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Flow(("-y", "x")), pm.Flow(("1", "t"))])
    np.testing.assert_array_equal(field_of(both).velocity(2.0, PLACES), np.stack([1 - Y, X + 2.0, 0 * X], axis=1))
    blown = wind([(1.0, 0.0, "t"), pm.Flow(("0", "x"))])
    np.testing.assert_array_equal(field_of(blown).velocity(3.0, PLACES), np.stack([0 * X + 1, X, 0 * X + 3], axis=1))
    blown.forces[1].set(k=5.0)
    blown.forces[1].flows[0].enabled = False  # of no matter: it is a part of the wind
    assert field_of(blown) is not None
    blown.forces[1].enabled = False
    assert field_of(blown) is None
    assert field_of(pm.ParticleSystem(pm.Particles([[0, 0, 0]], lean=0.1), [pm.Flow(("lean*x", "0"))])) is None


def test_streamlines_keep_the_stream_function() -> None:
    field = field_of(flow("sin(x)*cos(y)", "-cos(x)*sin(y)"))
    curves = streamlines(field, 0.0, LOW, HIGH, 30, 0)
    assert len(curves.offsets) > 25
    psi = np.sin(curves.vertices[:, 0]) * np.sin(curves.vertices[:, 1])
    for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True):
        np.testing.assert_allclose(psi[a:b], psi[a], atol=2e-3)
    assert (np.abs(curves.vertices) <= [2, 2, 0]).all()


@pytest.mark.parametrize("velocity", [("1/x", "0"), ("where(x > 0, -1, 1)", "0"), ("0", "0"), ("exp(400*x)", "y")])
def test_fields_with_poles_jumps_and_nothing_can_be_drawn(velocity: tuple[str, str]) -> None:
    field = field_of(flow(*velocity))
    for drawn in (field_arrows(field, 0.0, LOW, HIGH, 9, 0), streamlines(field, 0.0, LOW, HIGH, 9, 0)):
        assert np.isfinite(drawn.vertices).all()


def test_a_box_that_is_thin_has_places_in_its_middle() -> None:
    places = grid(np.array([0.0, -1.0, 3.0]), np.array([10.0, -0.9, 3.0]), 5)
    np.testing.assert_allclose(places, [[x, -0.95, 3.0] for x in (1, 3, 5, 7, 9)])


def test_painted_arrows_have_the_colours_of_their_places() -> None:
    def paint(places: np.ndarray) -> np.ndarray:
        return np.concatenate([places, 0 * places[:, :1]], axis=1)

    arrows = field_arrows(field_of(flow("-y", "x")), 0.0, LOW, HIGH, 4, 3, paint)
    np.testing.assert_array_equal(arrows.color[:, :3], grid(LOW, HIGH, 4))
    assert arrows.version == 3
