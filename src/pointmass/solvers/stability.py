"""How long a step may be before a solver amplifies what should not grow.

All functions run the solver itself on linear systems; no stability function is written down a second time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.solvers.base import Array, Memory, Solver
from pointmass.solvers.control import control_of
from pointmass.solvers.function_system import FunctionSystem

MOST_MODES = 300
SHORTEST, LONGEST, TRIALS = 2e-3, 1e4, 200  # steps to try, times the size of the eigenvalue
STRICT, TOLERANCE = 1e-12, 1e-9  # growth per step that is round-off, for short steps and for others
SHORT = 0.02
HALVINGS = 40
RATIOS = 64  # damping ratios of many modes that are tried; what lies between is interpolated
RUN, GROWTH, SHORTENED = 300, 10.0, 0.98  # a run that finds growth: steps of each half, factor; step after it

Complex = NDArray[np.complex128]


def amplification(solver: Solver | type[Solver], omega: ArrayLike, zeta: ArrayLike, h: ArrayLike) -> Any:
    """Factor by which one step multiplies an oscillator x'' = -omega^2 x - 2 zeta omega x' in the long run.

    The spectral radius of the step, from steps of basis vectors; for methods with a memory that of the companion
    matrix at constant h.

    Parameters
    ----------
    solver : a solver, or its class for default arguments. An adaptive one takes the steps it is given.
    omega : [1/s], zeta : [1], h : [s]; numbers, or arrays that broadcast.

    Returns
    -------
    A number, or an array of the broadcast shape.
    """
    solver = solver() if isinstance(solver, type) else solver
    omega, zeta, h = np.broadcast_arrays(*(np.asarray(each, np.float64) for each in (omega, zeta, h)))
    stiffness, damping = (omega * omega).astype(complex), (2.0 * zeta * omega).astype(complex)
    return _amplification(solver, stiffness.ravel(), damping.ravel(), h.ravel()).reshape(h.shape)[()]


def amplification_of_modes(solver: Solver, stiffness: Complex, damping: Complex, h: float) -> Array:
    """Likewise for modes x'' = -stiffness x - damping x', complex where forces turn; shape (k,)."""
    return _amplification(solver, stiffness, damping, np.full(len(stiffness), h))


def largest_safe_step(solver: Solver, stiffness: ArrayLike, damping: ArrayLike) -> float:
    """The largest h such that no step in (0, h] amplifies a mode x'' = -stiffness x - damping x'.

    Parameters
    ----------
    solver : with its arguments.
    stiffness, damping : of each mode [1/s^2, 1/s], shape (k,). Complex where forces turn: x'' = -i g x' is a charge in
        a magnetic field. Modes that stand still or grow by themselves are left out.

    Returns
    -------
    float
        h [s]; infinity if no step is too long, and for adaptive solvers, whose error control bounds the step itself;
        0 if every step is.
    """
    modes = np.stack(np.broadcast_arrays(np.atleast_1d(stiffness), np.atleast_1d(damping))).astype(complex)
    if control_of(solver) is not None or not modes.size:
        return float("inf")
    return float(_limits(solver, *_fastest(modes)).min(initial=float("inf")))


def largest_safe_steps(solver: Solver, stiffness: ArrayLike, damping: ArrayLike) -> Array:
    """The limit of `largest_safe_step` for each of many modes on its own [s].

    A solver knows no unit of time, so the limit times the speed of a mode depends on its damping ratio alone: of more
    than 64 different ones, 64 are tried, and what lies between is interpolated.

    Parameters
    ----------
    solver : with its arguments.
    stiffness, damping : of each mode [1/s^2, 1/s], real numbers, shape (k,). What pushes apart has no limit.

    Returns
    -------
    array
        h [s], shape (k,); infinity where no step is too long, 0 where every step is.
    """
    pull, drag = np.broadcast_arrays(np.maximum(stiffness, 0.0), np.maximum(damping, 0.0))
    root = np.sqrt(pull)
    speed = root + drag
    result = np.full(speed.shape, np.inf)
    moves = speed > 0.0
    if control_of(solver) is not None or not moves.any():
        return result
    ratio = (drag[moves] / speed[moves]).round(9)
    tried = np.unique(ratio)
    if len(tried) > RATIOS:
        tried = np.unique(np.quantile(tried, np.linspace(0.0, 1.0, RATIOS)))
    limit = _limits(solver, ((1.0 - tried) ** 2).astype(complex), tried.astype(complex))
    reached = np.interp(ratio, tried, np.minimum(limit, LONGEST))
    result[moves] = np.where(reached < LONGEST, reached, np.inf) / speed[moves]
    return result


def grows(solver: Solver, stiffness: ArrayLike, damping: ArrayLike, h: ArrayLike) -> NDArray[np.bool_]:
    """Whether steps of h amplify modes that do not grow by themselves, see `largest_safe_steps`; shape (k,)."""
    pull, drag, length = np.broadcast_arrays(np.maximum(stiffness, 0.0), np.maximum(damping, 0.0), h)
    return _grows(solver, pull.astype(complex), drag.astype(complex), length.astype(np.float64))


def safe_step(solver: Solver, matrix: Any, h: float, growth: float) -> float:
    """A step up to h with which a solver keeps all of dy/dt = matrix y in bounds.

    Splitting methods take x and v apart, so modes of `matrix` are not modes of their step unless stiffness and damping
    share them; and of a large matrix not all modes are known. A run finds what they did not tell.

    Parameters
    ----------
    matrix : for y = [x, v], shape (2n, 2n), an array or sparse.
    h : the limit of the modes, see `largest_safe_step` [s].
    growth : largest real part of the eigenvalues [1/s]; what grows by itself may.
    """
    n = matrix.shape[0] // 2
    if not 0.0 < h < float("inf") or not abs(matrix[n:, n:]).max() > 0.0:
        return h
    system = FunctionSystem(lambda t, y: matrix @ y, 2 * n, order=2)
    while h > 0.0 and _runs_away(solver, system, h, growth):
        h *= SHORTENED
    return h


def _runs_away(solver: Solver, system: FunctionSystem, h: float, growth: float) -> bool:
    """Whether velocities of a run grow more than they do by themselves."""
    y, sizes = np.cos(np.arange(system.dim)), []
    memory = solver.start(system)
    for _ in range(2):
        for _ in range(RUN):
            with np.errstate(all="ignore"):
                step = solver.step(system, 0.0, y, h, memory)
            y, memory = step.y1, step.memory
        sizes.append(float(np.linalg.norm(y[system.dim // 2 :])))
    allowed = GROWTH * float(np.exp(min(max(growth, 0.0) * h * RUN, 600.0)))
    return not sizes[1] <= allowed * max(sizes[0], 1.0)


def _fastest(modes: Complex) -> Complex:
    """Modes that tell something, shape (2, k): no more than can be tried, and of plain drags the strongest."""
    modes = np.unique(modes, axis=1)
    stiffness, damping = modes
    middle, gap = -0.5 * damping, np.sqrt(0.25 * damping * damping - stiffness)
    speed = np.maximum(np.abs(middle + gap), np.abs(middle - gap))
    grows = np.maximum((middle + gap).real, (middle - gap).real) > TOLERANCE * speed
    kept = ~grows & (speed > 1e-12 * speed.max(initial=0.0))
    drag = kept & (stiffness == 0.0) & (damping.imag == 0.0)
    kept &= ~drag | (np.arange(len(drag)) == np.where(drag, speed, -1.0).argmax())
    fastest = np.argsort(np.where(kept, -speed, 0.0), kind="stable")[: min(int(kept.sum()), MOST_MODES)]
    result: Complex = modes[:, fastest]
    return result


def _limits(solver: Solver, stiffness: Complex, damping: Complex) -> Array:
    """The steps at which the amplification of modes first exceeds 1, by trials and bisection, shape (k,)."""
    if not len(stiffness):
        return np.zeros(0)
    scale = _scale(stiffness, damping)
    trials = np.geomspace(SHORTEST, LONGEST, TRIALS)[:, None] / scale
    lanes = _grows(solver, np.tile(stiffness, TRIALS), np.tile(damping, TRIALS), trials.ravel())
    growing = lanes.reshape(trials.shape)
    first, modes = growing.argmax(axis=0), np.arange(len(scale))
    low, high = trials[np.maximum(first - 1, 0), modes], trials[first, modes]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        beyond = _grows(solver, stiffness, damping, middle)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.where(growing.any(axis=0), np.where(first == 0, 0.0, low), np.inf)


def _scale(stiffness: Complex, damping: Complex) -> Array:
    return np.asarray(np.maximum(np.sqrt(np.abs(stiffness)), np.abs(damping)))


def _grows(solver: Solver, stiffness: Complex, damping: Complex, h: Array) -> NDArray[np.bool_]:
    allowed = 1.0 + np.where(h * _scale(stiffness, damping) < SHORT, STRICT, TOLERANCE)
    return np.asarray(~(_amplification(solver, stiffness, damping, h) <= allowed))


def _amplification(solver: Solver, stiffness: Complex, damping: Complex, h: Array) -> Array:
    """Spectral radius of a step, for k modes with steps of their own at once, shape (k,)."""
    k = len(h)
    system = _oscillators(stiffness, damping)
    lengths = np.tile(h, 4)
    history: tuple[str, ...] = getattr(solver, "history", ())
    settled = solver.step(system, np.zeros(4 * k), np.zeros(4 * k), lengths, solver.start(system)).memory
    size = 2 * (1 + len(history))
    matrices = np.empty((k, size, size), complex)
    for column in range(size):
        basis = np.zeros((size, 2, k))  # real and imaginary parts
        basis[column, 0] = 1.0
        parts = basis.reshape(1 + len(history), 4 * k)
        memory: Memory = {**settled, **dict(zip(history, parts[1:], strict=True))}
        with np.errstate(all="ignore"):
            step = solver.step(system, np.zeros(4 * k), parts[0], lengths, memory)
        after = np.concatenate([step.y1, *(step.memory[name] for name in history)]).reshape(size, 2, k)
        matrices[:, :, column].real, matrices[:, :, column].imag = after[:, 0].T, after[:, 1].T
    return _radius(matrices)


def _oscillators(stiffness: Complex, damping: Complex) -> FunctionSystem:
    """x'' = -stiffness x - damping x' for each entry, every one an island; x = [real parts, imaginary parts]."""
    from scipy import sparse

    k = len(stiffness)

    i, one = np.arange(k), np.ones(k)
    entries = [(i, 2 * k + i, one), (k + i, 3 * k + i, one)]
    for first, factor in ((0, stiffness), (2 * k, damping)):
        entries += [(2 * k + i, first + i, -factor.real), (2 * k + i, first + k + i, factor.imag)]
        entries += [(3 * k + i, first + i, -factor.imag), (3 * k + i, first + k + i, -factor.real)]
    rows, columns, values = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    there = values != 0.0
    jacobian = sparse.csr_array((values[there], (rows[there], columns[there])), (4 * k, 4 * k))
    return FunctionSystem(
        lambda t, y: jacobian @ y,
        4 * k,
        order=2,
        jacobian=lambda t, y: jacobian,
        velocity_dependent=bool(damping.any()),
        islands=np.tile(np.arange(k), 4),
    )


def _radius(matrices: Complex) -> Array:
    """Largest absolute eigenvalue of each matrix, shape (k,).

    A pair from trace and determinant: an eigenvalue routine would lose half of the digits where both meet.
    """
    if matrices.shape[1] > 2:
        finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
        widest = np.abs(np.linalg.eigvals(np.where(finite[:, None, None], matrices, 0.0))).max(axis=1)
        return np.where(finite, widest, np.inf)
    (a, b), (c, d) = matrices.transpose(1, 2, 0)
    with np.errstate(all="ignore"):
        middle, gap = 0.5 * (a + d), np.sqrt((0.5 * (a - d)) ** 2 + b * c)
        return np.asarray(np.maximum(np.abs(middle + gap), np.abs(middle - gap)))
