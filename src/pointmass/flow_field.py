"""The velocity field of a system at places of our own choice: its values, its exact derivatives, and what is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from pointmass.colors import linear, palette
from pointmass.forces import PlateWind, Wind
from pointmass.frame import Arrows, Curves
from pointmass.laws.force import inputs_for
from pointmass.laws.parameter import Parameter
from pointmass.laws.unary import VelocityField
from pointmass.particles import Array
from pointmass.solvers import DormandPrince, FunctionSystem, integrate
from pointmass.system import ParticleSystem
from pointmass.tracing.trace import Traced

ARROWS, STREAMLINES = "field", "streamlines"  # names of what is drawn
PIECES = 60  # of a streamline
LONG = 0.6  # of the longest side of the box: a streamline
EXACT = 1e-4  # of that side: tolerated error of its adaptive solver in a step
SLOW = 0.02  # of the highest speed: where the field is slower, streamlines become shorter

Paint = Callable[[Array], Any]  # places, shape (k, 3) -> linear RGBA, shape (k, 4)


class FlowField:
    """x' = u(x, t): what particles follow in a flow, or the air that drags them.

    Parameters
    ----------
    parts : programs of (x, t, parameters) whose sum it is, with their parameters; none of them knows particles.

    Attributes
    ----------
    steady : whether it is the same at all times.
    """

    def __init__(self, parts: Sequence[tuple[Traced, Iterable[Parameter]]]) -> None:
        self._parts = [(law, list(parameters)) for law, parameters in parts]
        self.steady = all(
            "t" not in law.depends_on and all(p.steady for p in parameters) for law, parameters in self._parts
        )

    @property
    def key(self) -> tuple[Any, ...]:
        """Another one for another field, if both are steady."""
        return tuple((law, *(p.at(0.0) for p in parameters)) for law, parameters in self._parts)

    def velocity(self, t: float, x: Array) -> Array:
        """u [m/s] at places of shape (k, 3), likewise; it may be infinite or NaN."""
        return self._sum(self._parts, t, x)

    def gradient(self, t: float, x: Array) -> Array:
        """du_i/dx_j [1/s], shape (k, 3, 3): exact, by the programs' derivatives."""
        return self._sum(self._slopes, t, x).reshape(-1, 3, 3)

    @cached_property
    def _slopes(self) -> list[tuple[Traced, list[Parameter]]]:
        return [(law.jacobian("x_x", "x_y", "x_z"), parameters) for law, parameters in self._parts]

    @staticmethod
    def _sum(parts: Sequence[tuple[Traced, list[Parameter]]], t: float, x: Array) -> Array:
        total = np.zeros((len(x), len(parts[0][0].program.outputs)))
        with np.errstate(all="ignore"):
            for law, parameters in parts:
                inputs = inputs_for(law, {"x": x}, {"t": t}, {p.name: p.at(t) for p in parameters})
                for k, column in enumerate(law.columns(*inputs)):
                    total[:, k] += column
        return total


def field_of(system: ParticleSystem) -> FlowField | None:
    """The flow of a system, or the air of its first wind; None without one, or if it is another for each particle."""
    if system.order == 1:
        flows = [f for f in system.forces if f.enabled and f.on is None and isinstance(f, VelocityField)]
        parts = [(f.traced, list(f.parameters.values())) for f in flows]
    else:
        winds = (f for f in system.forces if f.enabled and isinstance(f, (Wind, PlateWind)))
        parts = [(f.air.traced, f.air.parameters) for f in winds][:1]
    known = all(p.common for _, parameters in parts for p in parameters)
    return FlowField(parts) if parts and known else None


def divergence(gradient: Array) -> Array:
    """div u [1/s] from du_i/dx_j, shape (k,)."""
    return np.asarray(np.trace(gradient, axis1=1, axis2=2))


def curl(gradient: Array) -> Array:
    """curl u [1/s] from du_i/dx_j, shape (k, 3)."""
    g = gradient
    return np.stack([g[:, 2, 1] - g[:, 1, 2], g[:, 0, 2] - g[:, 2, 0], g[:, 1, 0] - g[:, 0, 1]], axis=1)


def grid(low: Array, high: Array, count: int) -> Array:
    """Places in the cells of a box, `count` along its longest side, shape (k, 3)."""
    step = float((high - low).max()) / count
    wide = high - low > step / 2
    axes = [np.arange(a + step / 2, b, step) if w else [(a + b) / 2] for a, b, w in zip(low, high, wide, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def field_arrows(
    field: FlowField, t: float, low: Array, high: Array, count: int, version: int, paint: Paint | None = None
) -> Arrows:
    """Arrows in a box at time t, `count` along its longest side; by default in colours of the speed."""
    middles = grid(low, high, count)
    flow = _finite(field.velocity(t, middles))
    speed = np.sqrt((flow * flow).sum(axis=1))
    step = float((high - low).max()) / count
    top = float(np.percentile(speed, 95)) if len(speed) else 0.0
    size = 0.8 * step * np.minimum(speed / top, 1) if top > 0 else np.zeros(len(speed))
    vectors = flow * (size / np.where(speed > 0, speed, 1))[:, None]
    color = palette("ice", 0.25 + 0.5 * np.minimum(speed / (top or 1), 1)) if paint is None else paint(middles)
    return Arrows(
        name=ARROWS,
        version=version,
        vertices=(middles - 0.5 * vectors).astype(np.float32),
        vectors=vectors.astype(np.float32),
        width=0.07 * step,
        color=color,
    )


def streamlines(
    field: FlowField, t: float, low: Array, high: Array, count: int, version: int, paint: Paint | None = None
) -> Curves:
    """About `count` integral curves of the field frozen at t, from evenly spread places in a box, by adaptive steps.

    The field is taken by its direction alone, so that they are equally long where it is fast and slow.
    """
    side = float(np.prod((high - low)[high > low]) / count) ** (1 / max(1, int((high > low).sum())))
    size = float((high - low).max())
    x = grid(low, high, max(1, round(size / side)))
    top = float(np.percentile(np.linalg.norm(_finite(field.velocity(t, x)), axis=1), 95))

    def direction(_t: Any, y: Array) -> Array:
        flow = _finite(field.velocity(t, y.reshape(-1, 3)))
        speed = np.sqrt((flow * flow).sum(axis=1) + (SLOW * top) ** 2)
        return (flow / np.where(speed > 0, speed, 1)[:, None]).ravel()

    solver, times = DormandPrince(rtol=0.0, atol=EXACT * size), np.linspace(0.0, LONG * size, PIECES + 1)
    run = integrate(FunctionSystem(direction, x.size), solver, (0.0, times[-1]), times[-1], x.ravel(), dense=True)
    points = run.at(times).reshape(len(times), -1, 3).transpose(1, 0, 2)
    inside = np.all((points >= low - 1e-9) & (points <= high + 1e-9), axis=2)
    length = np.where(inside.all(axis=1), points.shape[1], np.argmin(inside, axis=1))
    keep = np.arange(points.shape[1])[None, :] < length[:, None]
    vertices = points[keep]
    return Curves(
        name=STREAMLINES,
        version=version,
        vertices=vertices.astype(np.float32),
        index=np.arange(len(vertices), dtype=np.int32),
        offsets=np.concatenate([[0], np.cumsum(length)]).astype(np.int32),
        width=0.15 * times[1],
        color=linear("#3d6d8f") if paint is None else paint(vertices),
    )


def _finite(flow: Array) -> Array:
    """0 where a field is not finite, or beyond all measure."""
    return np.where(np.abs(flow) < 1e150, flow, 0.0)
