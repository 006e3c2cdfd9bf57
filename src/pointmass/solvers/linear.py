"""The linear systems of Newton's method: (1 - gamma J) delta = right."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, final

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, System
from pointmass.solvers.islands import Islands, number_of, total

SMALL = 64  # up to this many unknowns a dense matrix is faster
BLOCK = 3  # unknowns of one particle in space; any size is correct


class LinearSolver(Protocol):
    """Solves the velocity block of (1 - gamma J) delta = right."""

    def __call__(self, matrix: Any, right: Array, movable: NDArray[np.bool_], system: System) -> Array:
        """`matrix` and `right` are those of the velocities (order 2) or of all entries (order 1)."""


def solve_newton(jacobian: Any, gamma: Array, right: Array, system: System, linear: LinearSolver) -> Array:
    """delta with (1 - gamma J) delta = right.

    For order 2, with J = [[0, P], [A, B]], only (1 - gamma B - gamma A gamma P) dv = rv + gamma A rx is solved, and
    dx = rx + gamma P dv follows (Baraff and Witkin, SIGGRAPH 1998, eq. 6). P is 0 for pinned entries, else 1.

    Parameters
    ----------
    jacobian : of deriv_eval, scipy.sparse, shape (dim, dim).
    gamma : of each entry of y [s], shape (dim,).
    right : shape (dim,).
    """
    from scipy import sparse

    if system.order == 1:
        matrix = sparse.eye_array(len(right)) - sparse.diags_array(gamma) @ jacobian
        return direct(matrix, right, np.ones(len(right), np.bool_), system)
    n = len(right) // 2
    moves, pull, damp = jacobian[:n, n:], jacobian[n:, :n], jacobian[n:, n:]
    lift = sparse.diags_array(gamma[:n])
    push = sparse.diags_array(gamma[n:])
    matrix = sparse.eye_array(n) - push @ damp - push @ pull @ lift @ moves
    dv = linear(matrix, right[n:] + gamma[n:] * (pull @ right[:n]), moves.diagonal() != 0.0, system)
    return np.concatenate([right[:n] + gamma[:n] * (moves @ dv), dv])


def direct(matrix: Any, right: Array, movable: NDArray[np.bool_], system: System) -> Array:
    """By LU factors, sparse for large systems."""
    from scipy.sparse.linalg import splu

    try:
        if len(right) <= SMALL:
            return np.linalg.solve(matrix.toarray(), right)
        result: Array = splu(matrix.tocsc()).solve(right)
    except (np.linalg.LinAlgError, RuntimeError):
        raise Diverged("the equations of an implicit step are singular: use a smaller dt") from None
    return result


@final
class ConjugateGradients:
    """By conjugate gradients on the symmetric part of M times the matrix, with block-Jacobi preconditioning.

    Each island has step lengths and an end of its own, so that islands do not influence each other. Only movable
    entries take part. What is not symmetric, some damping, is left to Newton's method to correct.

    Parameters
    ----------
    tolerance : residual over right side, in the preconditioned norm of each island.

    Notes
    -----
    Hestenes and Stiefel, J. Res. NBS 49 (1952), 409; Baraff and Witkin, SIGGRAPH 1998, sec. 5.2.
    """

    restarts: ClassVar[int] = 4  # passes allowed for each unknown of the largest island

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance

    def __call__(self, matrix: Any, right: Array, movable: NDArray[np.bool_], system: System) -> Array:
        """The solution of the symmetric part, shape (n,)."""
        from scipy import sparse

        free = movable & np.isfinite(system.inertia) & (system.inertia > 0.0)
        mass = np.where(free, system.inertia, 0.0)
        fixed = np.where(free, 0.0, right)
        kept = sparse.diags_array(free.astype(np.float64))
        stiff = sparse.csr_array(kept @ sparse.diags_array(mass) @ matrix @ kept)
        symmetric = sparse.csr_array(0.5 * (stiff + stiff.T))
        load = mass * (right - matrix @ fixed)
        return fixed + self._iterate(symmetric, load, free, system.islands[len(right) :])

    def _iterate(self, matrix: Any, load: Array, free: NDArray[np.bool_], islands: Islands) -> Array:
        n = number_of(islands)
        precondition = block_inverse(matrix, free)
        x, r = np.zeros_like(load), load
        z = precondition @ r
        p, rho = z, total(r * z, islands, n)
        goal = self.tolerance**2 * rho
        for _ in range(self.restarts * int(np.bincount(islands).max())):
            q = matrix @ p
            curvature = total(p * q, islands, n)
            going = (rho > goal) & (curvature > 0.0)  # a direction that does not curve upwards ends the island
            if not going.any():
                break
            alpha = np.divide(rho, curvature, out=np.zeros(n), where=going)[islands]
            x, r = x + alpha * p, r - alpha * q
            z = precondition @ r
            fresh = np.where(going, total(r * z, islands, n), rho)
            p = z + np.divide(fresh, rho, out=np.zeros(n), where=going)[islands] * p
            rho = np.where(going, fresh, 0.0)
        bare = (rho > goal) & ~np.bincount(islands, weights=x != 0.0, minlength=n).astype(np.bool_)
        return np.where(bare[islands], precondition @ load, x)  # no upward curve at all: go down the gradient


def block_inverse(matrix: Any, free: NDArray[np.bool_]) -> Any:
    """The inverse of the diagonal blocks, made positive definite; 0 where nothing is free."""
    from scipy import sparse

    n = len(free)
    count = -(-n // BLOCK)
    entries = matrix.tocoo()
    rows, columns = entries.coords
    near = rows // BLOCK == columns // BLOCK
    blocks = np.zeros((count, BLOCK, BLOCK))
    blocks[rows[near] // BLOCK, rows[near] % BLOCK, columns[near] % BLOCK] = entries.data[near]
    idle = np.append(~free, np.ones(count * BLOCK - n, np.bool_)).reshape(count, BLOCK)
    blocks[:, range(BLOCK), range(BLOCK)] += idle
    values, vectors = np.linalg.eigh(blocks)
    size = np.abs(values)
    size = np.maximum(size, 1e-12 * size.max(axis=1, keepdims=True))
    inverse = (vectors / size[:, None, :]) @ vectors.transpose(0, 2, 1)
    shape = (count * BLOCK, count * BLOCK)
    index = np.arange(count)
    return sparse.bsr_array((inverse, index, np.arange(count + 1)), shape=shape).tocsr()[:n, :n]
