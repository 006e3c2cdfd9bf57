"""Prints the control of the step for one island: the laws of `PIController`, with its decisions around them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pointmass.engine.printing import indented, statements
from pointmass.solvers.control import CLOCK_ULPS, PIController
from pointmass.tracing.columns import expanded
from pointmass.tracing.trace import trace

SIZES = '''@njit(**FLAGS)
def maximum(a, b):
    """The larger of two numbers; NaN wins."""
    return a if a > b or a != a else b


@njit(**FLAGS)
def rms(n, ex, ev):
    """Root of the mean square of the numbers of an island, positions first."""
    total = 0.0
    for q in range(3 * n):
        total += np.float64(ex[q] * ex[q])
    if ORDER == 2:
        for q in range(3 * n):
            total += np.float64(ev[q] * ev[q])
    return np.sqrt(total / (3 * ORDER * n))


'''


def law(name: str, function: Callable[..., Any], arguments: list[str], dtype: str) -> str:
    """A law of the control as a function of the kernel."""
    traced = trace(function, dict.fromkeys(arguments, "scalar"), 1, name)
    lines, (result,) = statements(expanded(traced.program), {a: a for a in arguments}, "r", dtype)
    return "\n".join(
        [
            "@njit(**FLAGS)",
            f"def {name}({', '.join(arguments)}):",
            *indented(lines, 1),
            f"    return {result}",
            "",
            "",
            "",
        ]
    )


def control_text(control: PIController, order: int, dtype: str, deriv: str) -> str:
    """The functions `first_step` and `judge` of an island, and what they call.

    Parameters
    ----------
    order : of the system.
    deriv : the arguments of `deriv` that an island has.
    """
    laws = law("scale", control.scale, ["size"], dtype)
    for name, arguments in (
        ("factor", "error before"),
        ("retreat", "error"),
        ("short", "d0 d1 left"),
        ("first", "short d1 d2"),
    ):
        laws += law(f"{name}_", getattr(control, name), arguments.split(), "float64")
    second = order == 2
    each = [("x", "sx", "tx")] + [("v", "sv", "tv")] * second
    first = [
        "@njit(**FLAGS)",
        f"def first_step({deriv}, t, left, x, v, sx, sv, tx, tv, ux, uv, ex, ev):",
        '    """A step to begin with, from the sizes of y, y\' and y\'\'."""',
        "    slope(" + deriv + ", t, x, v, sx, sv)",
        "    for q in range(3 * n):",
        *(f"        e{y}[q] = {y}[q] / scale(abs({y}[q]))" for y, _, _ in each),
        "    d0 = rms(n, ex, ev)",
        "    for q in range(3 * n):",
        *(f"        e{y}[q] = {s}[q] / scale(abs({y}[q]))" for y, s, _ in each),
        "    d1 = rms(n, ex, ev)",
        "    h = short_(d0, d1, left)",
        "    for q in range(3 * n):",
        *(f"        {u}[q] = {y}[q] + h * {s}[q]" for y, s, u in each),
        "    slope(" + deriv + ", t + h, tx, tv, ux, uv)",
        "    for q in range(3 * n):",
        *(f"        e{y}[q] = (u{y}[q] - {s}[q]) / scale(abs({y}[q]))" for y, s, _ in each),
        "    d2 = rms(n, ex, ev) / h",
        "    return first_(h, d1, d2)",
        "",
        "",
        "",
    ]
    judge = [
        "@njit(**FLAGS)",
        "def judge(error, h, wanted, clock, end, control):",
        '    """Note in `control` what a trial taught; 0: it is kept, 1: it is not, 2: no step is short enough."""',
        "    if error <= 1.0:",
        "        longer = h * factor_(error, control[1])",
        "        if control[2] != 0.0:",
        "            longer = min(longer, h)",
        "        if h < wanted:",
        "            longer = max(longer, wanted)",
        "        control[0] = longer",
        f"        control[1] = max(error, {control.floor!r})",
        "        control[2] = 0.0",
        "        return 0",
        "    control[0] = h * retreat_(error)",
        "    control[2] = 1.0",
        f"    least = {CLOCK_ULPS!r} * {2.0**-52!r} * max(abs(clock), abs(end))",
        "    return 2 if control[0] < least else 1",
        "",
        "",
        "",
    ]
    return f"ORDER = {order}\n\n\n" + SIZES + laws + "\n".join([*first, *judge])
