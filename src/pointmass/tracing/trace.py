"""Calls a law once on symbols and keeps the program that it recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from pointmass.errors import InvalidInput, about
from pointmass.tracing.columns import columns
from pointmass.tracing.derivative import jacobian
from pointmass.tracing.program import Program, Symbol, Vector, flatten

AXES = "xyz"


def vector_names(name: str) -> tuple[str, str, str]:
    """The three inputs that a vector argument stands for."""
    return f"{name}_x", f"{name}_y", f"{name}_z"


class Traced:
    """A law as a program.

    Attributes
    ----------
    name : of the law, for messages.
    inputs : names of the scalar inputs in order; a vector `v` is `v_x, v_y, v_z`.
    program : the program; its outputs are the numbers that the law returned, flattened.
    """

    def __init__(self, name: str, inputs: tuple[str, ...], program: Program) -> None:
        self.name = name
        self.inputs = inputs
        self.program = program

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "columns"}  # compiled again where it is needed

    @cached_property
    def columns(self) -> Callable[..., tuple[Any, ...]]:
        """The law on whole columns, one array per input, one per output."""
        return columns(self.program, self.inputs, "law")

    @cached_property
    def depends_on(self) -> frozenset[str]:
        """Names of the arguments that the result depends on, vectors by their own name."""
        return frozenset(n[:-2] if n[-2:] in ("_x", "_y", "_z") else n for n in self.program.arguments())

    def jacobian(self, *arguments: str) -> Traced:
        """d(outputs)/d(arguments) as a law of the same inputs, output-major."""
        return Traced(f"d {self.name}", self.inputs, jacobian(self.program, arguments))


def trace(
    law: Callable[..., Any], arguments: Mapping[str, str], returns: int | None, name: str | None = None
) -> Traced:
    """Call `law` on symbols.

    Parameters
    ----------
    law : takes the arguments in order, scalars as numbers and vectors as `Vector`s; returns numbers or tuples.
    arguments : name -> "scalar" or "vector".
    returns : how many numbers the law must return in all; None = any.
    name : for messages.

    Raises
    ------
    InvalidInput
        The law cannot be turned into a straight-line program; the sentence says why and what to write instead.
    """
    name = name or str(getattr(law, "__name__", type(law).__name__))
    program = Program()
    inputs: list[str] = []
    values: list[Any] = []
    for argument, kind in arguments.items():
        names = vector_names(argument) if kind == "vector" else (argument,)
        inputs.extend(names)
        symbols = Vector(Symbol(program, program.argument(n)) for n in names)
        values.append(symbols if kind == "vector" else symbols[0])
    if len(set(inputs)) != len(inputs):
        twice = next(n for n in inputs if inputs.count(n) > 1)
        raise InvalidInput(f"law {name!r} has two inputs of the name {twice!r}: rename one of its parameters")
    try:
        result = law(*values)
    except InvalidInput as error:
        raise InvalidInput(f"law {name!r}: {error}") from error
    except Exception as error:
        raise InvalidInput(f"law {name!r} failed on symbols: {type(error).__name__}: {error}") from error
    if result is None:
        raise InvalidInput(f"law {name!r} must return numbers, but returned nothing: does it end with `return`?")
    numbers = list(flatten(result))
    if returns is not None and len(numbers) != returns:
        raise InvalidInput(
            f"law {name!r} must return {returns} number{'s' * (returns > 1)}, but returned {len(numbers)}"
        )
    anchor = Symbol(program, program.constant(0.0))
    with about(f"law {name!r} must return numbers"):
        program.outputs = [program.number(anchor.lift(n)) for n in numbers]
    with about(f"law {name!r}"):
        program.check()
    return Traced(name, tuple(inputs), program)
