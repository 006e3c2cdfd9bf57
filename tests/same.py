"""Whether two frames have the same bits."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from pointmass.frame import Frame


def assert_same_bits(a: Any, b: Any) -> None:
    if isinstance(a, (np.ndarray, np.generic)):
        assert type(a) is type(b)
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    elif isinstance(a, float) and math.isnan(a):
        assert math.isnan(b)
    else:
        assert (type(a), a) == (type(b), b)


def assert_same_frame(a: Frame, b: Frame) -> None:
    for name in ("number", "time", "ids", "positions", "velocities"):
        assert_same_bits(getattr(a, name), getattr(b, name))
    assert list(a.quantities) == list(b.quantities)
    for name, value in a.quantities.items():
        assert_same_bits(value, b.quantities[name])
    for p, q in zip(a.drawables, b.drawables, strict=True):
        assert type(p) is type(q)
        for f in fields(p):
            assert_same_bits(getattr(p, f.name), getattr(q, f.name))
