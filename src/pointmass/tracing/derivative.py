"""Exact derivatives of a program, by one table with a rule for each operation.

A rule gives the derivative of a result from those of its operands. Forward differentiation goes through the program
once for each input, and is for Jacobians; backward differentiation once for each output, and is for gradients: a rule
is linear in the derivatives, so that it also says what each operand alone contributes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pointmass.tracing import functions as fn
from pointmass.tracing.program import Program, Symbol, operands

Rule = Callable[..., Any]  # (result, *operands, *their derivatives) -> derivative of the result


def _sqrt(r: Symbol, a: Symbol, da: Any) -> Any:
    return 0.5 * da * fn.inverse(r)  # 0 where r is 0: the length of nothing; NaN stays what it is


def _pow(r: Symbol, a: Symbol, b: Symbol, da: Any, db: Any) -> Any:
    return b * fn.operation("pow", a, b - 1.0) * da + fn.where(a > 0.0, r * fn.log(fn.where(a > 0.0, a, 1.0)) * db, 0.0)


def _atan2(r: Symbol, y: Symbol, x: Symbol, dy: Any, dx: Any) -> Any:
    return (x * dy - y * dx) * fn.inverse(x * x + y * y)


RULES: dict[str, Rule] = {
    "add": lambda r, a, b, da, db: da + db,
    "sub": lambda r, a, b, da, db: da - db,
    "mul": lambda r, a, b, da, db: da * b + a * db,
    "div": lambda r, a, b, da, db: (da - r * db) / b,
    "neg": lambda r, a, da: -da,
    "abs": lambda r, a, da: fn.where(a < 0.0, -da, da),
    "min": lambda r, a, b, da, db: fn.where(b < a, db, da),
    "max": lambda r, a, b, da, db: fn.where(a < b, db, da),
    "where": lambda r, c, a, b, dc, da, db: fn.where(c, da, db),
    "sqrt": _sqrt,
    "sin": lambda r, a, da: fn.cos(a) * da,
    "cos": lambda r, a, da: -fn.sin(a) * da,
    "exp": lambda r, a, da: r * da,
    "log": lambda r, a, da: da / a,
    "pow": _pow,
    "atan2": _atan2,
}
FLAT = {"const", "arg", "floor", "lt", "le", "eq", "and", "or", "not"}  # derivative 0 wherever they have one


def differentiate(program: Program, outputs: Sequence[int], name: str) -> list[int]:
    """Nodes of d(output)/d(argument `name`), added to the same program."""
    zero = program.constant(0.0)
    known: dict[int, int] = {}
    for i in range(max(outputs, default=-1) + 1):
        known[i] = _node_derivative(program, i, name, known, zero)
    return [known[o] for o in outputs]


def jacobian(program: Program, arguments: Sequence[str]) -> Program:
    """A program whose outputs are d(output o)/d(argument a), row by row (o major)."""
    rows = [differentiate(program, program.outputs, name) for name in arguments]
    return Program(program.nodes, [rows[a][o] for o in range(len(program.outputs)) for a in range(len(arguments))])


def gradient(value: Any, vector: Sequence[Symbol]) -> tuple[Any, ...]:
    """Exact gradient of a traced number with respect to a vector argument of the law, or other numbers in it."""
    if not isinstance(value, Symbol):
        return (0.0,) * len(vector)
    program, inputs = value.program, {c.node for c in vector}
    inner = set(inputs)  # nodes that depend on the inputs
    for i in range(value.node + 1):
        if program.nodes[i][0] not in FLAT and not inner.isdisjoint(operands(program.nodes[i])):
            inner.add(i)
    slopes: dict[int, Any] = {value.node: 1.0}  # of the value, with respect to nodes
    for i in sorted(inner - inputs, reverse=True):
        if i in slopes:
            for o in sorted(inner.intersection(operands(program.nodes[i]))):
                slopes[o] = slopes.get(o, 0.0) + _contribution(program, i, o, slopes[i])
    return tuple(slopes.get(c.node, 0.0) for c in vector)


def _contribution(program: Program, i: int, operand: int, slope: Any) -> Any:
    """What node i passes on to one of its operands of the derivative with respect to itself."""
    op, *_ = node = program.nodes[i]
    values = [Symbol(program, o) for o in operands(node)]
    if op == "call":
        parts = [k for k, o in enumerate(operands(node)) if o == operand]
        derivatives = (Symbol(program, program.call(node[1].derivative(k), *operands(node))) for k in parts)
        return sum((d * slope for d in derivatives), start=0.0)
    if op == "mul" and values[0].node == values[1].node:
        return (slope + slope) * values[0]
    return RULES[op](Symbol(program, i), *values, *(slope if v.node == operand else 0.0 for v in values))


def _node_derivative(program: Program, i: int, name: str, known: dict[int, int], zero: int) -> int:
    op, *_ = node = program.nodes[i]
    if op == "arg" and node[1] == name:
        return program.constant(1.0)
    inner = [known[o] for o in operands(node)]
    if op in FLAT or all(d == zero for d in inner):
        return zero
    values = [Symbol(program, o) for o in operands(node)]
    slopes = [Symbol(program, d) for d in inner]
    if op == "call":
        total: Any = 0.0
        for k, slope in enumerate(slopes):
            if slope.node != zero:
                part = Symbol(program, program.call(node[1].derivative(k), *operands(node)))
                total = part * slope + total
        return values[0].lift(total)
    return values[0].lift(RULES[op](Symbol(program, i), *values, *slopes))
