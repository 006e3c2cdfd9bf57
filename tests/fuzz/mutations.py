"""Ways in which files are damaged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from pointmass.errors import InvalidInput

QUICK = settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
FULL = settings(QUICK, max_examples=10_000)


@contextmanager
def refused_or_right() -> Iterator[None]:
    """What is refused is refused in one sentence."""
    try:
        yield
    except InvalidInput as error:
        if "\n" in str(error):
            pytest.fail(f"more than a sentence: {error}")


@st.composite
def damages(draw: st.DrawFn, data: bytes) -> bytes:
    """The data with a bit flipped, cut off, with bytes replaced, inserted or left out, or a piece twice."""
    place = draw(st.integers(0, max(0, len(data) - 1)))
    match draw(st.sampled_from(("flip", "cut", "replace", "insert", "leave out", "twice", "other"))):
        case "flip" if data:
            flipped = data[place] ^ 1 << draw(st.integers(0, 7))
            return data[:place] + bytes([flipped]) + data[place + 1 :]
        case "cut":
            return data[:place]
        case "replace":
            new = draw(st.binary(min_size=1, max_size=8))
            return data[:place] + new + data[place + len(new) :]
        case "insert":
            return data[:place] + draw(st.binary(min_size=1, max_size=8)) + data[place:]
        case "leave out":
            return data[:place] + data[place + draw(st.integers(1, 40)) :]
        case "twice":
            return data[:place] + data[place : place + draw(st.integers(1, 200))] * 2 + data[place:]
    return draw(st.binary(max_size=200))
