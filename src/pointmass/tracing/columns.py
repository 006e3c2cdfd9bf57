"""Prints a program as NumPy: every operation on whole columns, one line each. The reference path runs this."""

from __future__ import annotations

import inspect
import linecache
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from hashlib import sha256
from typing import Any

import numpy as np

from pointmass.tracing.elementary import EXPANSIONS
from pointmass.tracing.functions import NUMPY
from pointmass.tracing.program import Function, Node, Primitive, Program, Symbol, operands

INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "and": "&", "or": "|"}
FLOATS = (np.dtype(np.float64), np.dtype(np.float32))


def expanded(
    program: Program, after: Program | None = None, names: Mapping[str, str] | None = None, inline: bool = False
) -> Program:
    """The program with sin, exp, ... replaced by their polynomials.

    Parameters
    ----------
    after : a program whose operations go before, so that those which are equal are stored once.
    names : new names of inputs.
    inline : whether primitives are replaced by operations too, where they can.
    """
    result = Program() if after is None else replace(after, outputs=[])
    new: dict[int, int] = {}
    for i in program.live():
        node = program.nodes[i]
        moved = [new[o] for o in operands(node)]
        if node[0] in EXPANSIONS:
            new[i] = result_node(result, EXPANSIONS[node[0]](*(Symbol(result, m) for m in moved)))
        elif node[0] == "const":
            new[i] = result.constant(node[1])
        elif node[0] == "arg":
            new[i] = result.argument((names or {}).get(node[1], node[1]))
        elif node[0] == "call":
            inlined = node[1].inlined(*(Symbol(result, m) for m in moved)) if inline else None
            new[i] = result.call(node[1], *moved) if inlined is None else result_node(result, inlined)
        else:
            new[i] = result.operation(node[0], *moved)
    result.outputs = [new[o] for o in program.outputs]
    return result


def result_node(program: Program, value: Any) -> int:
    """The node of what a traced function returned: a symbol or a number."""
    return value.node if isinstance(value, Symbol) else program.constant(value)


def source(program: Program, arguments: Sequence[str], name: str) -> str:
    """The program as the text of a Python function of whole columns."""
    return _printed(expanded(program), arguments, name)


def _printed(program: Program, arguments: Sequence[str], name: str) -> str:
    """The same of a program without elementary functions."""
    calls = {nodes[0]: (k, nodes) for k, nodes in enumerate(_calls(program))}
    later = {i for _, nodes in calls.values() for i in nodes[1:]}

    def text(i: int) -> str:
        op, *rest = program.nodes[i]
        if op == "const":
            return _literal(rest[0])
        return str(rest[0]) if op == "arg" else f"r{i}"

    lines = []
    for i in program.live():
        op, *_ = node = program.nodes[i]
        parts = [text(o) for o in operands(node)]
        if op in ("const", "arg") or i in later:
            continue
        left = f"r{i}"
        if op == "call":
            k, nodes = calls[i]
            left = ", ".join(f"r{other}" for other in nodes)
            right = f"calls[{k}]({', '.join(parts)})"
        elif op == "neg":
            right = f"-{parts[0]}"
        elif op in INFIX:
            right = f"{parts[0]} {INFIX[op]} {parts[1]}"
        else:
            right = f"{op}_({', '.join(parts)})"
        lines.append(f"    {left} = {right}")
    outputs = ", ".join(text(o) for o in program.outputs)
    return "\n".join([f"def {name}({', '.join(arguments)}):", *lines, f"    return ({outputs},)", ""])


def columns(program: Program, arguments: Sequence[str], name: str = "law") -> Callable[..., tuple[Any, ...]]:
    """The program as a function of arrays (one for each argument) that returns one array or number per output.

    It computes in float32 where an argument is float32, else in float64, from the first operation to the last.
    """
    program = expanded(program)
    text = _printed(program, arguments, name)
    file = f"<pointmass law {name} {sha256(text.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # tracebacks show the line
    code = compile(text, file, "exec")
    calls = [_function([program.nodes[i][1] for i in nodes]) for nodes in _calls(program)]
    scopes: dict[np.dtype[Any], dict[str, Any]] = {}
    for dtype in FLOATS:
        scopes[dtype] = {f"{op}_": function for op, function in NUMPY.items()}
        scopes[dtype] |= {"calls": calls, "inf": np.inf, "nan": np.nan, "where_": _where(dtype)}
        exec(code, scopes[dtype])

    def run(*values: Any) -> tuple[Any, ...]:
        dtype = FLOATS[any(getattr(v, "dtype", None) == FLOATS[1] for v in values)]
        typed = (np.asarray(v, dtype)[()] for v in values)
        with np.errstate(all="ignore"):  # the branch that `where` drops may divide by zero; divergence is found in f
            return scopes[dtype][name](*typed)  # type: ignore[no-any-return]

    return run


@cache
def elementary(name: str) -> Callable[..., tuple[Any, ...]]:
    """sin, exp, ... of arrays: what a law's columns run, so that they agree on every bit."""
    program = Program()
    names = list(inspect.signature(EXPANSIONS[name]).parameters)
    program.outputs = [program.operation(name, *(program.argument(n) for n in names))]
    return columns(program, names, name)


def _where(dtype: np.dtype[Any]) -> Callable[[Any, Any, Any], Any]:
    """np.where whose branches have the precision of the law, also where both are literals."""
    return lambda c, a, b: np.where(c, np.asarray(a, dtype), np.asarray(b, dtype))[()]


def _calls(program: Program) -> list[list[int]]:
    """Nodes that one call computes: functions of a family with the same operands, and each other primitive alone."""
    found: dict[Node, list[int]] = {}
    for i in program.live():
        op, *rest = program.nodes[i]
        if op == "call":
            primitive, *places = rest
            kind = primitive.family if isinstance(primitive, Function) else primitive
            found.setdefault((kind, *places), []).append(i)
    return list(found.values())


def _function(primitives: Sequence[Primitive]) -> Callable[..., Any]:
    """What computes those of one call: one column, or one for each where there are several."""
    first, *others = primitives
    if others and isinstance(first, Function):
        return first.together(tuple(primitives)).columns
    return first.columns


def _literal(value: float) -> str:
    text = repr(value)
    return f"({text})" if value < 0 else text
