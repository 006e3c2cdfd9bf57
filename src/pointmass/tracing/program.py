"""The straight-line program that a law becomes when it is called once on symbols.

A program is a list of operations without branches or loops. Everything is printed from it: the NumPy columns of the
reference path, the exact Jacobian, and the source of compiled kernels. Equal operations on equal operands are stored
once, so what two components of a force share is computed once.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.tracing.trace import Traced

Node = tuple[Any, ...]  # ("const", value), ("arg", name), ("call", primitive, *nodes) or (operation, *nodes)

FOLD: dict[str, Callable[..., Any]] = {  # an operation on numbers is done while tracing
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "floor": np.floor,
    "sqrt": np.sqrt,
    "min": np.minimum,
    "max": np.maximum,
    "lt": np.less,
    "le": np.less_equal,
    "eq": np.equal,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "ldexp": lambda a, k: np.ldexp(a, int(k)),
    "significand": lambda a: math.frexp(a)[0],
    "exponent": lambda a: math.frexp(a)[1],
}
CONDITIONS = {"lt", "le", "eq", "and", "or", "not"}  # operations whose result is true or false
BRANCH = (
    "a law cannot branch with `if`, `and`, `or`, `not`, min or max: use pm.where(condition, a, b), &, |, ~, "
    "pm.minimum and pm.maximum"
)
JUNCTIONS = {"and", "or", "not"}  # and whose operands are
COMMUTATIVE = {"add", "mul"}
SIGNS = {"add", "sub", "mul", "div", "neg"}
EXACT = {0.25, 0.5, 2.0, 4.0}  # products of these and a number are not rounded


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
        """The node of an operation, simplified where an operand is 0 or 1.

        Conditions and numbers are kept apart: a condition used as a number is 1 or 0, a number used as a condition
        holds where it is not 0.
        """
        operands = tuple(
            self.condition(o) if name in JUNCTIONS or (name == "where" and k == 0) else self.number(o)
            for k, o in enumerate(operands)
        )
        if name in COMMUTATIVE:
            operands = tuple(sorted(operands))
        simple = self._simplified(name, operands)
        return self._store((name, *operands)) if simple is None else simple

    def call(self, primitive: Primitive, *operands: int) -> int:
        """The node of a registered primitive, such as a look-up in a grid."""
        return self._store(("call", primitive, *(self.number(o) for o in operands)))

    def number(self, node: int) -> int:
        """The node as a number: a condition is 1 where it holds, else 0."""
        if self.nodes[node][0] not in CONDITIONS:
            return node
        return self._store(("where", node, self.constant(1.0), self.constant(0.0)))

    def condition(self, node: int) -> int:
        """The node as a condition: a number holds where it is not 0."""
        if self.nodes[node][0] in CONDITIONS or self.value(node) is not None:
            return node
        return self.operation("not", self._store(("eq", node, self.constant(0.0))))

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

    @property
    def text(self) -> tuple[Any, ...]:
        """What it computes, to be compared: derivatives that were asked for have added nodes that it does not use."""
        return tuple((i, self.nodes[i]) for i in self.live()), tuple(self.outputs)

    def arguments(self) -> set[str]:
        """Names of the inputs that the outputs depend on."""
        return {self.nodes[i][1] for i in self.live() if self.nodes[i][0] == "arg"}

    def check(self) -> None:
        """Refuse what has no value whatever the inputs are.

        Raises
        ------
        InvalidInput
            NaN among its numbers, a division by the number 0, or a result that is always infinite.
        """
        for i in self.live():
            op, *rest = self.nodes[i]
            if op == "const" and math.isnan(rest[0]):
                raise InvalidInput("it computes with nan: use finite numbers")
            if op == "div" and self.value(rest[1]) == 0:
                raise InvalidInput("it divides by zero")
        for i in self.outputs:
            if self.value(i) in (math.inf, -math.inf):
                raise InvalidInput(f"it returns {self.value(i)}: use finite numbers")

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
            with np.errstate(all="ignore"):
                return self.constant(FOLD[name](*values))
        if name == "where" and (nodes[1] == nodes[2] or values[0] is not None):
            return nodes[1] if values[0] is None or values[0] else nodes[2]
        if name in ("and", "or") and any(v is not None for v in values):
            known, other = (values[0], nodes[1]) if values[0] is not None else (values[1], nodes[0])
            return other if bool(known) == (name == "and") else self.constant(float(name == "or"))
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
        return self._without_signs(name, nodes) if name in SIGNS else self._doubled(name, nodes, values)

    def _without_signs(self, name: str, nodes: Sequence[int]) -> int | None:
        """Signs pulled out of products and into differences: exact, and what derivatives leave behind."""
        plain = [self._negated(n) for n in nodes]
        if name == "sub" and ("sub", nodes[1], nodes[0]) in self._known:
            return self.operation("neg", self._known["sub", nodes[1], nodes[0]])
        if name == "neg" or all(p is None for p in plain):
            return plain[0] if name == "neg" else self._doubled(name, nodes, [self.value(n) for n in nodes])
        bare = [n if p is None else p for n, p in zip(nodes, plain, strict=True)]
        both = None not in plain
        match name:
            case "mul" | "div":
                product = self.operation(name, *bare)
                return product if both else self.operation("neg", product)
            case "add":
                if both:
                    return self.operation("neg", self.operation("add", *bare))
                return self.operation("sub", *(bare if plain[0] is None else reversed(bare)))
            case _:
                if both:
                    return self.operation("sub", *reversed(bare))
                total = self.operation("add", *bare)
                return total if plain[0] is None else self.operation("neg", total)

    def _negated(self, node: int) -> int | None:
        """The node whose negative this one is."""
        op, *rest = self.nodes[node]
        return rest[0] if op == "neg" else None

    def _doubled(self, name: str, nodes: Sequence[int], values: Sequence[float | None]) -> int | None:
        """Products with -1 and powers of 2, exact as well."""
        if name == "add" and nodes[0] == nodes[1]:
            return self.operation("mul", self.constant(2.0), nodes[0])
        if name == "mul" and -1.0 in values:
            return self.operation("neg", nodes[1 - values.index(-1.0)])
        if name == "mul" and any(v is not None for v in values):
            known = 0 if values[0] is not None else 1
            op, *rest = self.nodes[nodes[1 - known]]
            inner = [self.value(r) for r in rest] if op == "mul" else []
            for k, value in enumerate(inner):
                if value in EXACT and values[known] in EXACT:
                    return self.operation("mul", self.constant(float(value) * float(values[known])), rest[1 - k])  # type: ignore[arg-type]
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

    def inlined(self, *arguments: Symbol) -> Any:
        """The value as operations on symbols, for a place that calls no functions; None where it has none."""
        return None


class Function(Primitive):
    """An operation with a program of its own, which kernels call as a function.

    Several of a family that have the same arguments are computed together.
    """

    @property
    def family(self) -> Hashable:
        """What those have in common that may be computed together."""
        raise NotImplementedError

    def together(self, members: tuple[Any, ...]) -> Traced:
        """The program of several members of the family, with an output for each."""
        raise NotImplementedError

    def columns(self, *arguments: Any) -> Any:
        return self.together((self,)).columns(*arguments)[0]


class Symbol:
    """A number that is not known yet: what a law sees while it is traced."""

    __slots__ = ("node", "program")
    __hash__ = None  # type: ignore[assignment]  # == builds a program, so a symbol is no key

    def __init__(self, program: Program, node: int) -> None:
        self.program = program
        self.node = node

    def apply(self, name: str, *others: Any) -> Symbol:
        """The operation `name` on this symbol and others."""
        if any(_is_vector(o) for o in others):
            return NotImplemented  # type: ignore[no-any-return]  # vectors know what to do with a number
        nodes = [self.lift(o) for o in others]
        return Symbol(self.program, self.program.operation(name, self.node, *nodes))

    def lift(self, value: Any) -> int:
        """The node of a symbol or number."""
        if isinstance(value, Symbol):
            if value.program is not self.program:
                raise InvalidInput("a law cannot keep an argument of another law: pass it on as a parameter")
            return value.node
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, (int, float, np.floating, np.integer, np.bool_)):
            return self.program.constant(_float(value))
        if isinstance(value, (tuple, list, np.ndarray)):
            raise InvalidInput(
                "a law computes with numbers, and a vector is three of them: use pm.length(v), pm.dot(a, b) or v[0] "
                "where a number is wanted"
            )
        raise InvalidInput(f"a law computes with its arguments and numbers, not with {type(value).__name__}")

    def lifted(self, value: Any) -> Symbol:
        """A symbol or number as a symbol of the same program."""
        return Symbol(self.program, self.lift(value))

    def _flipped(self, name: str, other: Any) -> Symbol:
        return self.lifted(other).apply(name, self)

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

    def __mod__(self, other: Any) -> Symbol:
        if self.program.value(self.lift(other)) == 0:
            raise InvalidInput("it divides by zero")
        return self.apply("sub", self.__floordiv__(other).apply("mul", other))

    def __rmod__(self, other: Any) -> Symbol:
        return self.lifted(other).__mod__(self)

    def __floordiv__(self, other: Any) -> Symbol:
        return self.apply("div", other).apply("floor")

    def __rfloordiv__(self, other: Any) -> Symbol:
        return self.lifted(other).__floordiv__(self)

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
        node = self.lift(exponent)
        known = self.program.value(node)
        if known is not None and whole_power(known):
            return self.lifted(power(self, known))
        return self.apply("sqrt") if known == 0.5 else self.apply("pow", exponent)

    def __rpow__(self, base: Any) -> Symbol:
        return self._flipped("pow", base)

    def __bool__(self) -> bool:
        raise InvalidInput(BRANCH)

    def __iter__(self) -> Iterator[Symbol]:
        raise InvalidInput("a number was used as a vector: a vector of a law is a tuple of three numbers")

    def __float__(self) -> float:
        raise InvalidInput(
            "a law cannot turn its arguments into floats: use pm.sin, pm.exp, pm.length, ... instead of math.sin, "
            "math.exp, np.linalg.norm, ..."
        )

    __int__ = __index__ = __float__

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """np.sqrt(x) and its like work on symbols too."""
        function = UFUNCS.get(ufunc.__name__)
        if function is None or method != "__call__" or options:
            raise InvalidInput(f"a law cannot use np.{ufunc.__name__}: known are {', '.join(sorted(UFUNCS))}")
        return elementwise(lambda *parts: function(*(self.lifted(p) for p in parts)), *inputs)


UFUNCS: dict[str, Callable[..., Symbol]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "remainder": operator.mod,
    "floor_divide": operator.floordiv,
    "power": operator.pow,
    "float_power": operator.pow,
    "square": lambda a: a * a,
    "negative": operator.neg,
    "positive": operator.pos,
    "absolute": abs,
    "fabs": abs,
    "less": operator.lt,
    "less_equal": operator.le,
    "greater": operator.gt,
    "greater_equal": operator.ge,
    "equal": operator.eq,
    "not_equal": operator.ne,
    "logical_and": operator.and_,
    "logical_or": operator.or_,
    "logical_not": operator.invert,
    "sqrt": lambda a: a.apply("sqrt"),
    "floor": lambda a: a.apply("floor"),
    "minimum": lambda a, b: a.apply("min", b),
    "maximum": lambda a, b: a.apply("max", b),
    "sin": lambda a: a.apply("sin"),
    "cos": lambda a: a.apply("cos"),
    "tan": lambda a: a.apply("sin") / a.apply("cos"),
    "exp": lambda a: a.apply("exp"),
    "log": lambda a: a.apply("log"),
    "arctan2": lambda y, x: y.apply("atan2", x),
}


QUOTIENT = "a vector can only be divided by a number: divide by pm.length(v) or v[0], or each component by itself"


class Vector(tuple[Any, ...]):
    """Three numbers of a law, with the operations of vectors: k * v, a + b, -v; `pm.dot` and `pm.cross` of two."""

    __slots__ = ()

    def __add__(self, other: Any) -> Vector:
        return Vector(a + b for a, b in zip(self, three(other), strict=True))

    def __radd__(self, other: Any) -> Vector:
        return Vector(b + a for a, b in zip(self, three(other), strict=True))

    def __sub__(self, other: Any) -> Vector:
        return Vector(a - b for a, b in zip(self, three(other), strict=True))

    def __rsub__(self, other: Any) -> Vector:
        return Vector(b - a for a, b in zip(self, three(other), strict=True))

    def __mul__(self, other: Any) -> Vector:
        if isinstance(other, (tuple, list)):
            raise InvalidInput("two vectors are multiplied with pm.dot(a, b) or pm.cross(a, b)")
        return Vector(a * other for a in self)

    def __rmul__(self, other: Any) -> Vector:
        return self.__mul__(other)

    def __truediv__(self, other: Any) -> Vector:
        if isinstance(other, (tuple, list)):
            raise InvalidInput(QUOTIENT)
        return Vector(a / other for a in self)

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented  # a matrix knows what to do with a vector
        raise InvalidInput("vectors have no operator @: use pm.dot(a, b)")

    def __neg__(self) -> Vector:
        return Vector(-a for a in self)

    def __pos__(self) -> Vector:
        return self

    def __abs__(self) -> Vector:
        raise InvalidInput("a vector has no abs: use pm.length(v)")

    def __bool__(self) -> bool:
        raise InvalidInput(BRANCH)

    def _power(self, other: Any) -> Vector:
        raise InvalidInput("a vector has no powers: use pm.dot(v, v) or pm.length(v)")

    def _quotient(self, other: Any) -> Vector:
        raise InvalidInput(QUOTIENT)

    def _order(self, other: Any) -> bool:
        raise InvalidInput("vectors cannot be compared: compare pm.length(v), pm.dot(a, b) or v[0]")

    __pow__ = __rpow__ = _power
    __rtruediv__ = __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = _quotient
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _order
    __hash__ = None  # type: ignore[assignment]


def elementwise(function: Callable[..., Any], *inputs: Any) -> Any:
    """A function of numbers on arrays of symbols."""
    arrays = np.broadcast_arrays(*(np.asarray(i, dtype=object) for i in inputs))
    if arrays[0].ndim == 0:
        return function(*inputs)
    result = np.empty(arrays[0].shape, dtype=object)
    for index in np.ndindex(result.shape):
        result[index] = function(*(a[index] for a in arrays))
    return result


def whole_power(exponent: float) -> bool:
    """Whether a power is written as a product, which takes a base of any sign."""
    return math.isfinite(exponent) and exponent == int(exponent) and abs(exponent) <= 64


def power(base: Any, exponent: float) -> Any:
    """`base`, a symbol, number or array, to a whole power: a product of squares."""
    if exponent < 0:
        return 1.0 / power(base, -exponent)
    if exponent < 2:
        return base if exponent == 1 else 0.0 * base + 1.0
    half = power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half


def _is_vector(value: Any) -> bool:
    return isinstance(value, Vector) or (isinstance(value, np.ndarray) and value.ndim > 0)


def three(value: Any) -> Any:
    """A vector of a law, if it is one."""
    if isinstance(value, (tuple, list, np.ndarray)) and len(value) == 3:
        return value
    given = "a number" if isinstance(value, (Symbol, int, float, np.number)) else type(value).__name__
    raise InvalidInput(f"a vector of three numbers is wanted, such as x or (1.0, 0.0, 0.0), not {given}")


def flatten(value: Any) -> Iterable[Any]:
    """The numbers in nested tuples, in order."""
    if isinstance(value, (tuple, list)) or (isinstance(value, np.ndarray) and value.ndim):
        for item in value:
            yield from flatten(item)
    else:
        yield value


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise InvalidInput(f"a law computes with numbers below 1e308, not with {str(value)[:20]}...") from None
