"""Objects that remember how they were made, so that a scene in Python can be written as text and read back."""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

import numpy as np

from pointmass.errors import InvalidInput

T = TypeVar("T", bound="Described")


class Described:
    """Keeps the arguments of its constructor in `arguments`.

    A wrong argument is reported by name with the list of those that exist.
    """

    arguments: dict[str, Any]

    def __new__(cls: type[T], *args: Any, **kwargs: Any) -> T:
        self = super().__new__(cls)
        self.arguments = bind(cls, *args, **kwargs)
        return self

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        return (), self.arguments  # copies and pickles are made like the object itself

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v!r}" for k, v in self.arguments.items())
        return f"{type(self).__name__}({inside if len(inside) < 100 else '...'})"


def parameters_of(factory: Any) -> dict[str, inspect.Parameter]:
    """The named parameters of a class or function, by name."""
    signature = inspect.signature(factory.__init__ if inspect.isclass(factory) else factory)
    keep = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {n: p for n, p in signature.parameters.items() if n != "self" and p.kind in keep}


def bind(factory: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
    """The arguments of a call by name, without those left at their default.

    Raises
    ------
    InvalidInput
        An argument that does not exist, or one that is missing.
    """
    known = parameters_of(factory)
    positional = [n for n, p in known.items() if p.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
    name = factory.__name__
    given = dict(zip(positional, args, strict=False)) | kwargs
    if len(args) > len(positional) or len(given) != len(args) + len(kwargs):
        raise InvalidInput(f"{name} takes {len(positional)} arguments without a name, but got {len(args)}")
    for argument in given:
        if argument not in known and not _takes_any(factory):
            raise InvalidInput(f"{name} has no parameter {argument!r}: known are {', '.join(known) or 'none'}")
    for argument, parameter in known.items():
        if parameter.default is inspect.Parameter.empty and argument not in given:
            raise InvalidInput(f"{name} needs the parameter {argument!r}")
    return {n: v for n, v in given.items() if n not in known or not same(v, known[n].default)}


def same(a: Any, b: Any) -> bool:
    """Whether two arguments are equal, arrays and nested lists included."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        try:
            return bool(np.array_equal(np.asarray(a), np.asarray(b)))
        except (TypeError, ValueError):
            return False
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(same(p, q) for p, q in zip(a, b, strict=True))
    alike = type(a) is type(b) or (isinstance(a, (int, float)) and isinstance(b, (int, float)))
    return alike and bool(a == b)


def _takes_any(factory: Any) -> bool:
    signature = inspect.signature(factory.__init__ if inspect.isclass(factory) else factory)
    return any(p.kind is inspect.Parameter.VAR_KEYWORD for p in signature.parameters.values())
