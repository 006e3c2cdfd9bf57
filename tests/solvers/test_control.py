"""The step control's formulas: what they say, and that a printed program says the same to the bit."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from pointmass.solvers.control import PIController
from pointmass.tracing.columns import columns
from pointmass.tracing.trace import trace

ERRORS = np.array([0.0, 1e-12, 0.3, 1.0, 7.0, 1e30, np.inf, np.nan])


@pytest.mark.parametrize("order", [1, 3, 5])
def test_factors_are_those_of_dopri5(order):
    control = PIController(1e-6, 1e-9, order)
    error = np.geomspace(1e-9, 1e9, 50)
    slow = error ** (1 / order - 0.03) / 0.2**0.04 / 0.9
    np.testing.assert_allclose(control.factor(error, 0.2 + 0 * error), 1 / np.clip(slow, 0.1, 5.0), rtol=1e-13)
    np.testing.assert_allclose(control.retreat(error), np.maximum(0.2, 0.9 / error ** (1 / order - 0.03)), rtol=1e-13)


def test_errors_that_are_no_numbers_shorten_the_step_the_most():
    control = PIController(1e-6, 1e-9, 5)
    with np.errstate(divide="ignore"):
        assert control.retreat(ERRORS)[-2:].tolist() == [0.2, 0.2]
    assert control.factor(ERRORS, np.full(len(ERRORS), 1e-4))[0] == 10.0


@pytest.mark.parametrize("name", ["scale", "factor", "retreat", "short", "first"])
def test_the_formulas_are_laws(name):
    law = getattr(PIController(1e-6, 1e-9, 5), name)
    names = list(inspect.signature(law).parameters)
    rng = np.random.default_rng(1)
    inputs = [np.concatenate([ERRORS, 10.0 ** rng.uniform(-20, 20, 50)]) for _ in names]
    traced = trace(law, dict.fromkeys(names, "scalar"), 1)
    (printed,) = columns(traced.program, names)(*inputs)
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(printed, law(*inputs))
