"""Prints a program as scalar, typed statements: what compiled kernels are made of.

The same operations in the same order as the NumPy columns, so that float64 gives the same bits. Conditions become
selects, which vectorise; literals carry the precision of the kernel, so that none turns a float32 loop into double.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pointmass.tracing.columns import INFIX
from pointmass.tracing.noise import Whole
from pointmass.tracing.program import Primitive, Program, operands

CALLS = {
    "sqrt": "np.sqrt({0})",
    "abs": "abs({0})",
    "floor": "np.floor({0})",
    "neg": "-{0}",
    "not": "not {0}",
    "where": "({1} if {0} else {2})",
    "min": "({0} if {0} < {1} or {0} != {0} else {1})",  # as np.minimum: NaN wins
    "max": "({0} if {0} > {1} or {0} != {0} else {1})",
    "and": "({0} and {1})",
    "or": "({0} or {1})",
    "ldexp": "scaled({0}, {1})",
    "significand": "significand({0})",
    "exponent": "exponent({0})",
}


def literal(value: float, dtype: str) -> str:
    """A number as the source of a constant of a precision."""
    text = {"inf": "np.inf", "-inf": "-np.inf", "nan": "np.nan"}.get(repr(float(value)), repr(float(value)))
    if dtype == "float32":
        return f"np.float32({text})"
    return f"({text})" if text.startswith("-") else text


# A call of a primitive: an expression, and which of its values it is if there are several.
Call = Callable[[Primitive, list[str]], tuple[str, int | None]]


def statements(
    program: Program, names: Mapping[str, str], prefix: str, dtype: str, call: Call | None = None
) -> tuple[list[str], list[str]]:
    """A program as assignments to local variables, and the expressions of its outputs.

    Parameters
    ----------
    program : without elementary functions (`tracing.columns.expanded`).
    names : expression in the kernel of each input.
    prefix : of the local variables, which keeps several laws in one kernel apart.
    dtype : "float64" or "float32", the precision of every operation.
    call : how primitives are called, where it has any besides operations on whole numbers.
    """
    text: dict[int, str] = {}
    several: dict[str, str] = {}  # calls of functions that return several values
    lines = []
    for i in program.live():
        op, *rest = node = program.nodes[i]
        if op == "const":
            text[i] = literal(rest[0], dtype)
        elif op == "arg":
            text[i] = names[rest[0]]
        else:
            text[i] = f"{prefix}{i}"
            parts = [text[o] for o in operands(node)]
            if op == "call":
                right, place = _whole(rest[0], parts, dtype) if call is None else call(rest[0], parts)
                if place is not None:
                    if right not in several:
                        several[right] = f"{prefix}{i}_all"
                        lines.append(f"{several[right]} = {right}")
                    right = f"{several[right]}[{place}]"
            elif op in CALLS:
                right = CALLS[op].format(*parts)
            else:
                right = f"{parts[0]} {INFIX[op]} {parts[1]}"
            lines.append(f"{text[i]} = {right}")
    return lines, [text[o] for o in program.outputs]


def _whole(primitive: Primitive, parts: list[str], dtype: str) -> tuple[str, None]:
    """An operation on whole numbers."""
    assert isinstance(primitive, Whole)
    return primitive.text.format(*parts, real=f"np.{dtype}"), None


def indented(lines: Sequence[str], depth: int) -> list[str]:
    """Lines at a depth of blocks."""
    return [f"{'    ' * depth}{line}" if line else line for line in lines]


def function(name: str, arguments: str, flags: str, lines: Sequence[str]) -> str:
    """The text of a compiled function, with two empty lines behind."""
    return "\n".join([f"@njit({flags})", f"def {name}({arguments}):", *indented(lines, 1), "", "", ""])
