"""Formulas of scene files, such as "-k*x" or "sin(t)*y": parsed into the same programs as laws written in Python.

The text is read with Python's own parser and only arithmetic, comparisons, `a if c else b`, known names and known
functions are accepted; nothing is ever evaluated as Python.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput, unknown
from pointmass.tracing import functions as fn
from pointmass.tracing.noise import noise
from pointmass.tracing.program import Symbol


def seeded_noise(x: Any, y: Any, z: Any, t: Any, seed: Any) -> Any:
    """Gradient noise of features of size 1: mean 0, root mean square 1 (see `pm.noise`)."""
    return noise(x, y, z, t, seed=seed)


FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "sin": (fn.sin, 1),
    "cos": (fn.cos, 1),
    "tan": (fn.tan, 1),
    "exp": (fn.exp, 1),
    "log": (fn.log, 1),
    "sqrt": (fn.sqrt, 1),
    "abs": (fn.absolute, 1),
    "floor": (fn.floor, 1),
    "pow": (fn.pow, 2),
    "atan2": (fn.atan2, 2),
    "min": (fn.minimum, 2),
    "max": (fn.maximum, 2),
    "where": (fn.where, 3),
    "noise": (seeded_noise, 5),
}
CONSTANTS = {"pi": math.pi, "e": math.e}
BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Mod: lambda a, b: a % b,
    ast.Pow: fn.pow,
}
COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
    ast.Eq: lambda a, b: a == b,
    ast.NotEq: lambda a, b: a != b,
}
LONGEST = 2000  # characters; a formula is a line, and the parser's stack has an end
DEEPEST = 100  # operations inside one another


class Formula:
    """A parsed formula.

    Parameters
    ----------
    text : such as "-k*x".
    names : what the formula may refer to besides functions, `pi` and `e`; None = anything (checked on use).
    gathers : further functions, of one argument, such as a mean of all particles.

    Raises
    ------
    InvalidInput
        Not a formula, a name or function that is not known, a part without names that is not finite: log(-1).
    """

    def __init__(
        self,
        text: str,
        names: Iterable[str] | None = None,
        what: str = "formula",
        gathers: Mapping[str, Callable[[Any], Any]] | None = None,
    ) -> None:
        self.text = str(text).strip()
        self._gathers = gathers or {}
        self.shown = self.text if len(self.text) <= 60 else f"{self.text[:57]}..."
        self.what = what
        if not self.text or len(self.text) > LONGEST:
            raise InvalidInput(f"{what} must be a formula of 1 to {LONGEST} characters, not {self.text[:20]!r}")
        try:
            with warnings.catch_warnings(action="ignore"):  # of the parser, about other uses of the text
                self._tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InvalidInput(f"{what} {self.shown!r} is not a formula; write it like -k*x + sin(t)") from None
        self.names: set[str] = set()
        with np.errstate(all="ignore"):
            self._check(self._tree, 0)
        if names is not None:
            self.restrict(names)

    def restrict(self, names: Iterable[str]) -> None:
        """Refuse a formula that refers to anything else than `names`."""
        known = set(names)
        for name in sorted(self.names - known):
            inside = "" if name == self.text else f" {self.shown!r}"
            raise unknown(f"name in {self.what}{inside}:", name, [*known, *CONSTANTS, *FUNCTIONS, *self._gathers])

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """The value, for numbers, arrays or symbols by name."""
        with np.errstate(all="ignore"):
            return self._value(self._tree, values)

    def _check(self, node: ast.expr, depth: int) -> Any:
        """The value of a part without names, or None."""
        if depth > DEEPEST:
            raise InvalidInput(f"{self.what} nests more than {DEEPEST} operations: split it into several formulas")
        values = [self._check(part, depth + 1) for part in self._parts(node)]
        if isinstance(node, ast.Name) and node.id in (FUNCTIONS.keys() | self._gathers.keys()):
            count = 1 if node.id in self._gathers else FUNCTIONS[node.id][1]
            call = f"{node.id}({', '.join('xyzts'[:count])})"
            raise InvalidInput(
                f"{self.what} {self.shown!r}: {node.id} is a function, so write it with brackets: {call}"
            )
        if isinstance(node, ast.Name) and node.id not in CONSTANTS:
            self.names.add(node.id)
            return None
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div | ast.Mod) and values[1] == 0:
            raise self._zero()
        if any(value is None for value in values):
            return None
        value = self._apply(node, values)
        if not math.isfinite(value):
            part = ast.get_source_segment(self.text, node)
            raise InvalidInput(f"{self.what} {self.shown!r} has a part that is not finite: {part} = {value}")
        return value

    def _parts(self, node: ast.expr) -> list[ast.expr]:
        """The operands of what a formula may contain; everything else is refused here."""
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                self._number(value)
                return []
            case ast.Name():
                return []
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=inner):
                return [inner]
            case ast.BinOp(left=a, op=op, right=b) if type(op) in BINARY:
                return [a, b]
            case ast.Compare(left=a, ops=[op], comparators=[b]) if type(op) in COMPARE:
                return [a, b]
            case ast.IfExp(test=c, body=a, orelse=b):
                return [c, a, b]
            case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in self._gathers:
                return [inner]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                if name not in FUNCTIONS:
                    raise unknown(f"function in {self.what} {self.shown!r}:", name, [*FUNCTIONS, *self._gathers])
                if len(arguments) != FUNCTIONS[name][1]:
                    raise InvalidInput(f"{name} in {self.what} {self.shown!r} takes {FUNCTIONS[name][1]} argument(s)")
                return arguments
        raise InvalidInput(
            f"{self.what} {self.shown!r} may use numbers, names, + - * / % **, comparisons, `a if c else b` "
            f"and {', '.join(dict.fromkeys([*FUNCTIONS, *self._gathers]))}, but not {_description(node)}"
        )

    def _number(self, value: float) -> None:
        try:
            finite = math.isfinite(float(value))
        except OverflowError:
            finite = False
        if not finite:
            raise InvalidInput(f"{self.what} {self.shown!r} has a number above 1e308")

    def _value(self, node: ast.expr, values: Mapping[str, Any]) -> Any:
        if isinstance(node, ast.Name) and node.id not in CONSTANTS:
            return values[node.id]
        return self._apply(node, [self._value(part, values) for part in self._parts(node)])

    def _apply(self, node: ast.expr, parts: Sequence[Any]) -> Any:
        """What a node makes of the values of its parts."""
        try:
            match node:
                case ast.Constant(value=number):
                    return float(number)  # type: ignore[arg-type]
                case ast.Name(id=name):
                    return CONSTANTS[name]
                case ast.UnaryOp(op=op):
                    return -parts[0] if isinstance(op, ast.USub) else parts[0]
                case ast.BinOp(op=op):
                    return BINARY[type(op)](*parts)
                case ast.Compare(ops=[compared]):
                    holds = COMPARE[type(compared)](*parts)
                    return holds if isinstance(holds, Symbol) else fn.where(holds, 1.0, 0.0)
                case ast.IfExp():
                    return fn.where(*parts)
                case ast.Call(func=ast.Name(id=name)):
                    gathers = len(parts) == 1 and name in self._gathers
                    return self._gathers[name](*parts) if gathers else FUNCTIONS[name][0](*parts)
        except (ZeroDivisionError, OverflowError):
            raise self._zero() from None
        raise AssertionError(node)

    def _zero(self) -> InvalidInput:
        return InvalidInput(f"{self.what} {self.shown!r} divides by zero or overflows")


def _description(node: ast.expr) -> str:
    """What is wrong in the words of who wrote it."""
    match node:
        case ast.Constant(value=value):
            return repr(value)
        case ast.Compare():
            return "chained comparisons such as a < b < c"
        case ast.Attribute() | ast.Call():
            return "anything with a dot, or functions of one's own"
    return type(node).__name__
