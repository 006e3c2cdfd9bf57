"""The straight-line program that a law becomes when it is called once on symbols.

A program is a list of operations without branches or loops. Everything is printed from it: the NumPy columns of the
reference path, the exact Jacobian, and the source of compiled kernels. Equal operations on equal operands are stored
once, so what two components of a force share is computed once.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput

Node = tuple[Any, ...]  # ("const", value), ("arg", name), ("call", primitive, *nodes) or (operation, *nodes)

FOLD: dict[str, Callable[..., float]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "neg": operator.neg,
    "abs": abs,
    "floor": lambda a: float(math.floor(a)),
}


@dataclass(eq=False)
class Program:
    """Operations in the order in which they can run, and the nodes that are the result."""

    nodes: list[Node] = field(default_factory=list)
    outputs: list[int] = field(default_factory=list)
    _known: dict[Node, int] = field(default_factory=dict, repr=False)

    def constant(self, value: float) -> int:
        """The node of a number."""
        return self._store(("const", float(value)))

    def argument(self, name: str) -> int:
        """The node of an input."""
        return self._store(("arg", name))

    def operation(self, name: str, *operands: int) -> int:
        """The node of an operation, simplified where an operand is 0 or 1."""
        simple = self._simplified(name, operands)
        return self._store((name, *operands)) if simple is None else simple

    def call(self, primitive: Primitive, *operands: int) -> int:
        """The node of a registered primitive, such as a look-up in a grid."""
        return self._store(("call", primitive, *operands))

    def live(self) -> list[int]:
        """The nodes that the outputs need, in order."""
        used: set[int] = set()
        stack = list(self.outputs)
        while stack:
            node = stack.pop()
            if node not in used:
                used.add(node)
                stack.extend(operands(self.nodes[node]))
        return sorted(used)

    def arguments(self) -> set[str]:
        """Names of the inputs that the outputs depend on."""
        return {self.nodes[i][1] for i in self.live() if self.nodes[i][0] == "arg"}

    def value(self, node: int) -> float | None:
        """The number that a node is, or None where it is computed."""
        op, *rest = self.nodes[node]
        return rest[0] if op == "const" else None

    def _store(self, node: Node) -> int:
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return self._known[node]

    def _simplified(self, name: str, nodes: Sequence[int]) -> int | None:
        values = [self.value(n) for n in nodes]
        if name in FOLD and all(v is not None for v in values):
            return self.constant(FOLD[name](*values))
        if name == "where" and (nodes[1] == nodes[2] or values[0] is not None):
            return nodes[1] if values[0] is None or values[0] else nodes[2]
        for unit, ops, other in ((0.0, ("add",), 1), (1.0, ("mul",), 1)):
            if name in ops and unit in values:
                return nodes[other - values.index(unit)]
        if name == "mul" and 0.0 in values:
            return self.constant(0.0)
        if name == "div" and values[0] == 0.0:
            return self.constant(0.0)
        if (name == "sub" and values[1] == 0.0) or (name == "div" and values[1] == 1.0):
            return nodes[0]
        if name == "sub" and values[0] == 0.0:
            return self.operation("neg", nodes[1])
        return None


def operands(node: Node) -> tuple[int, ...]:
    """The nodes that an operation reads."""
    match node[0]:
        case "const" | "arg":
            return ()
        case "call":
            return node[2:]
        case _:
            return node[1:]


class Primitive:
    """An operation that a program calls by reference: a look-up in a table, a noise.

    A leaf says how it runs on columns and which primitive is its derivative.
    """

    def columns(self, *arguments: Any) -> Any:
        """The value for arrays of arguments."""
        raise NotImplementedError

    def derivative(self, argument: int) -> Primitive:
        """The primitive, with the same arguments, that is the derivative to one of them."""
        raise NotImplementedError


UFUNCS = {
    "add": "add",
    "subtract": "sub",
    "multiply": "mul",
    "divide": "div",
    "negative": "neg",
    "sqrt": "sqrt",
    "absolute": "abs",
    "fabs": "abs",
    "floor": "floor",
    "minimum": "min",
    "maximum": "max",
    "less": "lt",
    "less_equal": "le",
    "sin": "sin",
    "cos": "cos",
    "exp": "exp",
    "log": "log",
    "power": "pow",
    "arctan2": "atan2",
}


class Symbol:
    """A number that is not known yet: what a law sees while it is traced."""

    __slots__ = ("node", "program")
    __hash__ = None  # type: ignore[assignment]  # == builds a program, so a symbol is no key

    def __init__(self, program: Program, node: int) -> None:
        self.program = program
        self.node = node

    def apply(self, name: str, *others: Any) -> Symbol:
        """The operation `name` on this symbol and others."""
        nodes = [self.lift(o) for o in others]
        return Symbol(self.program, self.program.operation(name, self.node, *nodes))

    def lift(self, value: Any) -> int:
        """The node of a symbol or number."""
        if isinstance(value, Symbol):
            return value.node
        if isinstance(value, (int, float, np.number, np.bool_)):
            return self.program.constant(float(value))
        raise InvalidInput(f"a law computes with its arguments and numbers, not with {type(value).__name__}")

    def _flipped(self, name: str, other: Any) -> Symbol:
        return Symbol(self.program, self.program.operation(name, self.lift(other), self.node))

    def __add__(self, other: Any) -> Symbol:
        return self.apply("add", other)

    def __radd__(self, other: Any) -> Symbol:
        return self._flipped("add", other)

    def __sub__(self, other: Any) -> Symbol:
        return self.apply("sub", other)

    def __rsub__(self, other: Any) -> Symbol:
        return self._flipped("sub", other)

    def __mul__(self, other: Any) -> Symbol:
        return self.apply("mul", other)

    def __rmul__(self, other: Any) -> Symbol:
        return self._flipped("mul", other)

    def __truediv__(self, other: Any) -> Symbol:
        return self.apply("div", other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self._flipped("div", other)

    def __neg__(self) -> Symbol:
        return self.apply("neg")

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return self.apply("abs")

    def __lt__(self, other: Any) -> Symbol:
        return self.apply("lt", other)

    def __le__(self, other: Any) -> Symbol:
        return self.apply("le", other)

    def __gt__(self, other: Any) -> Symbol:
        return self._flipped("lt", other)

    def __ge__(self, other: Any) -> Symbol:
        return self._flipped("le", other)

    def __eq__(self, other: object) -> Symbol:  # type: ignore[override]
        return self.apply("eq", other)

    def __ne__(self, other: object) -> Symbol:  # type: ignore[override]
        return self.apply("eq", other).apply("not")

    def __and__(self, other: Any) -> Symbol:
        return self.apply("and", other)

    def __or__(self, other: Any) -> Symbol:
        return self.apply("or", other)

    def __invert__(self) -> Symbol:
        return self.apply("not")

    def __pow__(self, exponent: Any) -> Symbol:
        if isinstance(exponent, (int, float, np.number)):
            return _power(self, float(exponent))
        return self.apply("pow", exponent)

    def __rpow__(self, base: Any) -> Symbol:
        return self._flipped("pow", base)

    def __bool__(self) -> bool:
        raise InvalidInput(
            "a law cannot branch with `if`, `and`, `or` or `not`: use pm.where(condition, a, b), & and |"
        )

    def __iter__(self) -> Iterator[Symbol]:
        raise InvalidInput("a number was used as a vector: a vector of a law is a tuple of three numbers")

    def __float__(self) -> float:
        raise InvalidInput(
            "a law cannot turn its arguments into floats: use pm.sin, pm.exp, ... instead of math.sin, ..."
        )

    __int__ = __index__ = __float__  # type: ignore[assignment]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Symbol:
        """np.sqrt(x) and its like work on symbols too."""
        name = UFUNCS.get(ufunc.__name__)
        if name is None or method != "__call__" or options:
            raise InvalidInput(f"a law cannot use np.{ufunc.__name__}: known are {', '.join(sorted(UFUNCS))}")
        return Symbol(self.program, self.program.operation(name, *(self.lift(i) for i in inputs)))


def _power(base: Symbol, exponent: float) -> Symbol:
    if exponent == 0.5:
        return base.apply("sqrt")
    if exponent != int(exponent) or abs(exponent) > 64:
        return base.apply("pow", exponent)
    if exponent < 0:
        return 1.0 / _power(base, -exponent)
    if exponent == 0:
        return Symbol(base.program, base.program.constant(1.0))
    half = _power(base, float(int(exponent) // 2))
    return (half * half * base if int(exponent) % 2 else half * half) if exponent > 1 else base


def flatten(value: Any) -> Iterable[Any]:
    """The numbers in nested tuples, in order."""
    if isinstance(value, (tuple, list)):
        for item in value:
            yield from flatten(item)
    else:
        yield value
