"""How long a step may be before a solver amplifies what should not grow.

Both functions run the solver itself on oscillators; no stability function is written down a second time.
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
    radius = _amplification(solver, (omega * omega).ravel(), (2.0 * zeta * omega).ravel(), h.ravel())
    return radius.reshape(h.shape)[()]


def largest_safe_step(solver: Solver, *eigenvalues: ArrayLike) -> float:
    """The largest h such that no step in (0, h] amplifies a mode that does not grow by itself.

    Parameters
    ----------
    solver : with its arguments.
    eigenvalues : of the Jacobian of dy/dt [1/s], complex, shape (k,), for each independent part of a system. Zeros and
        growing modes are left out.

    Returns
    -------
    float
        h [s]; infinity if no step is too long, and for adaptive solvers, whose error control bounds the step itself;
        0 if every step is.

    Notes
    -----
    For methods that treat x and v differently the limit of an overdamped mode depends on both of its eigenvalues.
    Which real ones of a part belong together is not known, so its two largest are taken for a pair: a bound that is
    never too large. A single real eigenvalue is a drag without a spring.
    """
    if control_of(solver) is not None:
        return float("inf")
    modes = {mode for part in eigenvalues for mode in _modes(np.asarray(part, np.complex128).ravel())}
    if not modes:
        return float("inf")
    return float(_limits(solver, *_fastest(np.array(sorted(modes))).T).min())


def _fastest(modes: Array) -> Array:
    """Without weaker drags than the strongest, and no more modes than can be tried, shape (k, 2)."""
    drag = modes[:, 0] == 0
    modes = np.concatenate([modes[~drag], modes[drag][-1:]])
    speed = np.sqrt(modes[:, 0]) + modes[:, 1]
    kept: Array = modes[np.argsort(-speed, kind="stable")[:MOST_MODES]]
    return kept


def _modes(eigenvalues: NDArray[np.complex128]) -> list[tuple[float, float]]:
    """Stiffness w^2 and damping 2 zeta w of the oscillators that have these eigenvalues."""
    size = np.abs(eigenvalues)
    kept = eigenvalues[(size > 1e-12 * size.max(initial=0.0)) & (eigenvalues.real <= TOLERANCE * size)]
    real = np.abs(kept.imag) <= TOLERANCE * np.abs(kept)
    modes = {(float(np.abs(e) ** 2), float(max(-2.0 * e.real, 0.0))) for e in kept[~real]}
    decays = [*sorted(-kept[real].real), 0.0]
    if real.any():
        first, second = decays[-2], decays[-3] if len(decays) > 2 else 0.0
        modes.add((float(first * second), float(first + second)))
    return sorted(modes)


def _limits(solver: Solver, stiffness: Array, damping: Array) -> Array:
    """The steps at which the amplification of oscillators first exceeds 1, by trials and bisection, shape (k,)."""
    scale = np.maximum(np.sqrt(stiffness), damping)
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


def _grows(solver: Solver, stiffness: Array, damping: Array, h: Array) -> NDArray[np.bool_]:
    short = h * np.maximum(np.sqrt(stiffness), damping) < SHORT
    allowed = 1.0 + np.where(short, STRICT, TOLERANCE)
    result: NDArray[np.bool_] = ~(_amplification(solver, stiffness, damping, h) <= allowed)
    return result


def _amplification(solver: Solver, stiffness: Array, damping: Array, h: Array) -> Array:
    """Spectral radius of a step, for k oscillators with steps of their own at once, shape (k,)."""
    k = len(h)
    system = _oscillators(stiffness, damping)
    lengths = np.tile(h, 2)
    history: tuple[str, ...] = getattr(solver, "history", ())
    settled = solver.step(system, np.zeros(2 * k), np.zeros(2 * k), lengths, solver.start(system)).memory
    size = 2 * (1 + len(history))
    matrices = np.empty((k, size, size))
    for column in range(size):
        basis = np.zeros((size, k))
        basis[column] = 1.0
        parts = basis.reshape(1 + len(history), 2 * k)
        memory: Memory = {**settled, **dict(zip(history, parts[1:], strict=True))}
        with np.errstate(all="ignore"):
            step = solver.step(system, np.zeros(2 * k), parts[0], lengths, memory)
        after = [step.y1, *(step.memory[name] for name in history)]
        matrices[:, :, column] = np.concatenate(after).reshape(size, k).T
    return _radius(matrices)


def _oscillators(stiffness: Array, damping: Array) -> FunctionSystem:
    """x'' = -stiffness x - damping x' for each entry, every one an island."""
    from scipy import sparse

    k = len(stiffness)
    jacobian = sparse.block_array(
        [[None, sparse.eye_array(k)], [sparse.diags_array(-stiffness), sparse.diags_array(-damping)]], format="csr"
    )
    return FunctionSystem(
        lambda t, y: np.concatenate([y[k:], -stiffness * y[:k] - damping * y[k:]]),
        2 * k,
        order=2,
        jacobian=lambda t, y: jacobian,
        velocity_dependent=bool(damping.any()),
        islands=np.tile(np.arange(k), 2),
    )


def _radius(matrices: Array) -> Array:
    """Largest absolute eigenvalue of each matrix, shape (k,).

    A pair from trace and determinant: an eigenvalue routine would lose half of the digits where both meet.
    """
    if matrices.shape[1] > 2:
        widest: Array = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
        return widest
    (a, b), (c, d) = matrices.transpose(1, 2, 0)
    middle, determinant = 0.5 * (a + d), a * d - b * c
    gap = (0.5 * (a - d)) ** 2 + b * c
    radius: Array = np.where(gap < 0.0, np.sqrt(np.abs(determinant)), np.abs(middle) + np.sqrt(np.maximum(gap, 0.0)))
    return radius
