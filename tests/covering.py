"""Which of all combinations of parameters the usual run takes: every value of each, the rest only with --full."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import pytest


def covering(keep: int, *sides: Iterable[Any]) -> list[Any]:
    """All combinations for `pytest.mark.parametrize`, one of `keep` of them in the usual run.

    These lie on diagonals: each value of a side is there with one of `keep` values of each other side, by turns.

    Parameters
    ----------
    sides : values, each a text, or a `pytest.param` with an id.
    """
    listed = [[s if hasattr(s, "values") else pytest.param(s, id=s) for s in side] for side in sides]
    return [
        pytest.param(
            *(value.values[0] for _, value in chosen),
            id="-".join(value.id for _, value in chosen),
            marks=() if sum(k for k, _ in chosen) % keep == 0 else pytest.mark.full,
        )
        for chosen in itertools.product(*(enumerate(side) for side in listed))
    ]
