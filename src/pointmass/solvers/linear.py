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
    """Solves (1 - gamma J) delta = right."""

    def __call__(self, jacobian: Any, gamma: Array, right: Array, system: System) -> Array:
        """delta, shape (dim,).

        Parameters
        ----------
        jacobian : of deriv_eval, scipy.sparse, shape (dim, dim).
        gamma : of each entry of y [s], shape (dim,).
        right : shape (dim,).
        system : that the Jacobian belongs to.
        """


def direct(jacobian: Any, gamma: Array, right: Array, system: System) -> Array:
    """By LU factors, dense for small systems and sparse for large ones."""
    from scipy import sparse

    if len(right) <= SMALL:
        return _factored(np.eye(len(right)) - gamma[:, None] * jacobian.toarray(), right)
    if system.order == 1:
        return _factored(sparse.eye_array(len(right)) - sparse.diags_array(gamma) @ jacobian, right)
    matrix, load = velocity_block(jacobian, gamma, right)
    return with_positions(jacobian, gamma, right, _factored(matrix, load))


def velocity_block(jacobian: Any, gamma: Array, right: Array) -> tuple[Any, Array]:
    """What is left for dv of an order 2 system, J = [[0, P], [A, B]]: matrix (n, n) and right side (n,).

    (1 - gamma B - gamma A gamma P) dv = rv + gamma A rx, then dx = rx + gamma P dv (Baraff and Witkin, SIGGRAPH 1998,
    eq. 6). P is 0 for pinned entries, else 1.
    """
    from scipy import sparse

    n = len(right) // 2
    lift, push = sparse.diags_array(gamma[:n]), sparse.diags_array(gamma[n:])
    moves, pull, damp = jacobian[:n, n:], jacobian[n:, :n], jacobian[n:, n:]
    matrix = sparse.eye_array(n) - push @ damp - push @ pull @ lift @ moves
    return matrix, right[n:] + gamma[n:] * (pull @ right[:n])


def with_positions(jacobian: Any, gamma: Array, right: Array, dv: Array) -> Array:
    """[dx, dv] from dv."""
    n = len(dv)
    return np.concatenate([right[:n] + gamma[:n] * (jacobian[:n, n:] @ dv), dv])


def _factored(matrix: Any, right: Array) -> Array:
    from scipy.sparse.linalg import splu

    try:
        if isinstance(matrix, np.ndarray):
            return np.linalg.solve(matrix, right)
        result: Array = splu(matrix.tocsc()).solve(right)
    except (np.linalg.LinAlgError, RuntimeError):
        raise Diverged("the equations of an implicit step are singular: use a smaller dt") from None
    return result


@final
class ConjugateGradients:
    """By conjugate gradients on the symmetric part of M times the matrix, with block-Jacobi preconditioning.

    Each island has step lengths and an end of its own, so that islands do not influence each other. Only movable
    entries take part. What is not symmetric, some damping, is left to Newton's method to correct. Compressed springs
    make the matrix indefinite; the iteration goes on through directions that curve downwards, because the steps of
    Newton's method that stop there do not converge for stiff chains.

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

    def __call__(self, jacobian: Any, gamma: Array, right: Array, system: System) -> Array:
        """delta of the symmetric part, shape (dim,); order 1 has no symmetry to use and is solved directly."""
        from scipy import sparse

        if system.order == 1:
            return direct(jacobian, gamma, right, system)
        n = len(right) // 2
        matrix, load = velocity_block(jacobian, gamma, right)
        free = np.isfinite(system.inertia) & (system.inertia > 0.0) & (jacobian[:n, n:].diagonal() != 0.0)
        mass, fixed = np.where(free, system.inertia, 0.0), np.where(free, 0.0, load)
        stiff = sparse.diags_array(mass) @ matrix @ sparse.diags_array(free.astype(np.float64))
        symmetric = sparse.csr_array(0.5 * (stiff + stiff.T))
        dv = fixed + self._iterate(symmetric, mass * (load - matrix @ fixed), free, system.islands[n:])
        return with_positions(jacobian, gamma, right, dv)

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
            going = (rho > goal) & (curvature != 0.0)
            if not going.any():
                break
            alpha = np.divide(rho, curvature, out=np.zeros(n), where=going)[islands]
            x, r = x + alpha * p, r - alpha * q
            z = precondition @ r
            fresh = np.where(going, total(r * z, islands, n), rho)
            p = z + np.divide(fresh, rho, out=np.zeros(n), where=going)[islands] * p
            rho = np.where(going, fresh, 0.0)
        return x


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
