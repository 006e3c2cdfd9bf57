"""The shape of a surface as traced laws, from which both paths are printed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_
from typing import Any

from pointmass.tracing.functions import Number, Triple, dot, where
from pointmass.tracing.program import Program, Symbol, Vector, operands
from pointmass.tracing.trace import Traced, trace, vector_names

UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Laws:
    """What a kind of surface computes from a place `x` relative to its own and from `count` numbers of its shape.

    Attributes
    ----------
    distance : (x, shape) -> signed distance [m].
    normal : (x, shape) -> unit normal to the free side, three numbers.
    bending : (x, v, shape) -> v . H v [m/s^2], with H the Hessian of the distance; exact, from the normal.
    apart : (four points, room, shape) -> 1 if their convex hull is farther away than `room` [m], 0 if that is not sure;
        None if the kind has no such test.
    """

    distance: Traced
    normal: Traced
    bending: Traced
    apart: Traced | None


def laws_of(
    name: str,
    distance: Callable[..., Number],
    normal: Callable[..., Triple],
    apart: Callable[..., Any],
    count: int,
    curved: bool,
) -> Laws:
    """Trace the laws of a kind of surface: see `Collider`. `count` is how many numbers its shape has."""
    x, v, shape = {"x": "vector"}, {"v": "vector"}, {f"s{k}": "scalar" for k in range(count)}
    across = trace(normal, x | shape, 3, f"{name}.normal")
    turn = across.jacobian(*vector_names("x"))

    def bending(x: Vector, v: Vector, *shape: Symbol) -> Number:
        if not curved:
            return 0.0
        slopes = _replayed(turn.program, dict(zip(turn.inputs, (*x, *shape), strict=True)))
        return dot(v, [dot(slopes[3 * k : 3 * k + 3], v) for k in range(3)])  # type: ignore[arg-type]

    points = {f"b{k}": "vector" for k in range(4)}
    hull = trace(lambda *a: apart(a[:4], *a[4:]), points | {"room": "scalar"} | shape, 1, f"{name}.apart")
    return Laws(
        trace(distance, x | shape, 1, f"{name}.distance"),
        across,
        trace(bending, x | v | shape, 1, f"{name}.bending"),
        hull if hull.depends_on else None,
    )


def along(a: Triple, size: Number, otherwise: Triple = UP) -> Vector:
    """A vector divided by its length `size`; `otherwise` where that is 0."""
    long = size > 0.0
    safe = where(long, size, 1.0)
    return Vector(where(long, p / safe, q) for p, q in zip(a, otherwise, strict=True))


def all_of(conditions: Iterable[Any]) -> Any:
    """Whether all conditions hold."""
    return reduce(and_, conditions)


def any_of(conditions: Iterable[Any]) -> Any:
    """Whether one of the conditions holds."""
    return reduce(or_, conditions)


def _replayed(program: Program, inputs: dict[str, Any]) -> list[Symbol]:
    """Outputs of a program on symbols of another one."""
    target: Program = next(iter(inputs.values())).program
    new: dict[int, int] = {}
    for i in program.live():
        op, *rest = node = program.nodes[i]
        parts = [new[o] for o in operands(node)]
        if op == "const":
            new[i] = target.constant(rest[0])
        elif op == "arg":
            new[i] = inputs[rest[0]].node
        else:
            new[i] = target.call(rest[0], *parts) if op == "call" else target.operation(op, *parts)
    return [Symbol(target, new[o]) for o in program.outputs]
