"""Prints noise for one place, from the program that the reference path runs on columns."""

from __future__ import annotations

from collections.abc import Sequence

from pointmass.engine.printing import function, statements
from pointmass.tracing.columns import expanded
from pointmass.tracing.noise import Noise, traced_noise


def function_of(primitives: Sequence[Noise], name: str, dtype: str) -> str:
    """The function `name` of a place and a seed that returns some components and derivatives as a tuple."""
    traced = traced_noise(tuple(primitives))
    names = {n: n for n in traced.inputs}
    lines, outputs = statements(expanded(traced.program), names, "r", dtype)
    body = [*lines, f"return {', '.join(outputs)},"]
    return function(name, ", ".join(traced.inputs), "forceinline=True, **FLAGS", body)
