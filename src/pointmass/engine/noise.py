"""Prints noise and draws for one place, from the program that the reference path runs on columns."""

from __future__ import annotations

from collections.abc import Sequence

from pointmass.engine.printing import function, statements
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Function


def function_of(primitives: Sequence[Function], name: str, dtype: str) -> str:
    """The function `name` that returns several members of a family as a tuple."""
    traced = primitives[0].together(tuple(primitives))
    names = {n: n for n in traced.inputs}
    lines, outputs = statements(expanded(traced.program), names, "r", dtype)
    body = [*lines, f"return {', '.join(outputs)},"]
    return function(name, ", ".join(traced.inputs), "forceinline=True, **FLAGS", body)
