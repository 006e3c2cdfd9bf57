"""The linear systems of Newton's method: (1 - gamma J) delta = load, for each island on its own.

An order 2 system, J = [[0, P], [A, B]], is solved for the change of the velocities: (1 - gamma B - gamma^2 A P) dv
= load (Baraff and Witkin, SIGGRAPH 1998, eq. 6). P is 0 for pinned entries, else 1. An island of three unknowns, one
particle, is solved by a text of its own, which compiled kernels print as well.
"""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar, Protocol, final

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, System
from pointmass.solvers.islands import Islands, Mask, number_of, total
from pointmass.tracing import functions as fn
from pointmass.tracing.functions import Number, Triple
from pointmass.tracing.trace import Traced, trace

SMALL = 64  # up to this many unknowns a dense matrix is faster
BLOCK = 3  # unknowns of one particle in space; any size is correct
DEFINITE = 1e-12  # a pivot that is a smaller part of its diagonal entry counts as none
VECTORS = [f"{m}{i}" for m in "ab" for i in range(BLOCK)]


class LinearSolver(Protocol):
    """Solves matrix delta = load."""

    def __call__(self, matrix: Any, load: Array, inertia: Array, islands: Islands) -> tuple[Array, int, Mask]:
        """delta, shape (m,), the number of iterations that it took, counted for each island, and on which islands no
        direction was met in which the matrix curves downwards.

        Parameters
        ----------
        matrix : scipy.sparse, shape (m, m).
        load : shape (m,).
        inertia : mass of each unknown, 0 for one that is pinned, shape (m,): M times the matrix is nearly symmetric.
        islands : of each unknown, shape (m,).
        """


def solve(
    linear: LinearSolver, blocks: tuple[Any, Any], gamma: Array, load: Array, free: Mask, system: System
) -> tuple[Array, int, Mask]:
    """delta of all unknowns, shape (m,), 0 where the load is 0; the number of iterations of the linear solver; and
    on which islands it saw a matrix that is positive definite, as far as it looked.

    Parameters
    ----------
    blocks : A and B of the Jacobian, scipy.sparse of shape (m, m); for order 1 A is None, and B is J.
    gamma : of each unknown [s], shape (m,).
    load : shape (m,), 0 on islands that are solved.
    free : unknowns that are not pinned.
    """
    islands = system.islands[-len(load) :]
    n = number_of(islands)
    alone = np.bincount(islands, minlength=n) == BLOCK
    busy = np.zeros(n, np.bool_)
    busy[islands[load != 0.0]] = True
    delta, count, definite = np.zeros_like(load), 0, np.ones(n, np.bool_)
    if (busy & alone).any():
        rows = rows_of(busy & alone, islands)
        delta[rows] = _alone(blocks, gamma[rows[:, 0]], load[rows], rows)
    rest = np.flatnonzero((busy & ~alone)[islands])
    if len(rest):
        inertia = np.where(free, system.inertia if system.order == 2 else 1.0, 0.0)[rest]
        matrix = _matrix(blocks, gamma, free)[rest][:, rest]
        delta[rest], count, seen = linear(matrix, load[rest], inertia, islands[rest])
        definite[: len(seen)] = seen
    return np.where(free, delta, 0.0), count, definite


def rows_of(mask: Mask, islands: Islands) -> NDArray[np.intp]:
    """The three unknowns of each island of a mask, shape (k, 3)."""
    rows = np.flatnonzero(mask[islands])
    return rows[np.argsort(islands[rows], kind="stable")].reshape(-1, BLOCK)


def diagonal(matrix: Any, rows: NDArray[np.intp]) -> Array:
    """The blocks of a sparse matrix on the diagonal, shape (k, 3, 3)."""
    i, j = np.repeat(rows, BLOCK, axis=1), np.tile(rows, BLOCK)
    result: Array = matrix[i, j].toarray().reshape(-1, BLOCK, BLOCK)
    return result


def three(
    a0: Triple, a1: Triple, a2: Triple, b0: Triple, b1: Triple, b2: Triple, g: Number, load: Triple
) -> tuple[Number, ...]:
    """delta of one particle, (1 - g B - g^2 A) delta = load, by Cramer's rule; the matrices are given by their rows."""
    rows = []
    for i, (a, b) in enumerate(((a0, b0), (a1, b1), (a2, b2))):
        rows.append(tuple((1.0 if i == j else 0.0) - g * b[j] - (g * g) * a[j] for j in range(BLOCK)))
    c = [fn.cross(rows[(i + 1) % BLOCK], rows[(i + 2) % BLOCK]) for i in range(BLOCK)]
    determinant = fn.dot(rows[0], c[0])
    return tuple((load[0] * c[0][j] + load[1] * c[1][j] + load[2] * c[2][j]) / determinant for j in range(BLOCK))


def block_inverse(d00: Number, d01: Number, d02: Number, d11: Number, d12: Number, d22: Number) -> tuple[Number, ...]:
    """The upper triangle of the inverse of a symmetric 3x3 matrix; where that is not positive definite, a diagonal."""
    a, b, c = d11 * d22 - d12 * d12, d02 * d12 - d01 * d22, d01 * d12 - d02 * d11
    minor, determinant = d00 * d11 - d01 * d01, d00 * a + d01 * b + d02 * c
    flat = DEFINITE * fn.absolute(d00 * d11)
    definite = (d00 > 0.0) & (minor > flat) & (determinant > flat * fn.absolute(d22))
    inner = a, b, c, d00 * d22 - d02 * d02, d01 * d02 - d00 * d12, minor
    sizes = [
        fn.absolute(p) + fn.absolute(q) + fn.absolute(r)
        for p, q, r in ((d00, d01, d02), (d01, d11, d12), (d02, d12, d22))
    ]
    outer = sizes[0], 0.0, 0.0, sizes[1], 0.0, sizes[2]
    return tuple(fn.where(definite, i / determinant, fn.inverse(o)) for i, o in zip(inner, outer, strict=True))


@cache
def traced_three() -> Traced:
    """`three` as a program."""
    return trace(three, {**dict.fromkeys(VECTORS, "vector"), "g": "scalar", "load": "vector"}, BLOCK)


@cache
def traced_block_inverse() -> Traced:
    """`block_inverse` as a program."""
    return trace(block_inverse, dict.fromkeys(("d00", "d01", "d02", "d11", "d12", "d22"), "scalar"), 6)


def _alone(blocks: tuple[Any, Any], gamma: Array, load: Array, rows: NDArray[np.intp]) -> Array:
    """delta of islands of one particle, shape (k, 3)."""
    a, b = (np.zeros((len(rows), BLOCK, BLOCK), load.dtype) if m is None else diagonal(m, rows) for m in blocks)
    columns = [m[:, i, j] for m in (a, b) for i in range(BLOCK) for j in range(BLOCK)]
    delta: Array = np.stack(traced_three().columns(*columns, gamma, *load.T), axis=1)
    if not np.isfinite(delta[np.isfinite(load).all(axis=1)]).all():
        raise singular()
    return delta


def _matrix(blocks: tuple[Any, Any], gamma: Array, free: Mask) -> Any:
    """1 - gamma B - gamma A gamma P, shape (m, m)."""
    from scipy import sparse

    pull, damp = blocks
    push, one = sparse.diags_array(gamma), sparse.eye_array(len(gamma))
    matrix = one - push @ damp
    if pull is not None:
        matrix = matrix - push @ pull @ sparse.diags_array(gamma * free)
    return sparse.csr_array(matrix)


def direct(matrix: Any, load: Array, inertia: Array, islands: Islands) -> tuple[Array, int, Mask]:
    """By LU factors, dense for small systems and sparse for large ones."""
    from scipy.sparse.linalg import splu

    definite = np.ones(number_of(islands), np.bool_)
    try:
        if len(load) <= SMALL:
            return np.linalg.solve(matrix.toarray(), load), 0, definite
        return splu(matrix.tocsc()).solve(load), 0, definite
    except (np.linalg.LinAlgError, RuntimeError):
        raise singular() from None


def singular() -> Diverged:
    """The error for a matrix that has no inverse."""
    return Diverged("the equations of an implicit step are singular: use a smaller dt")


@final
class ConjugateGradients:
    """By conjugate gradients on the symmetric part of M times the matrix, with block-Jacobi preconditioning.

    Each island has step lengths and an end of its own, so that islands do not influence each other. Only movable
    entries take part. What is not symmetric, some damping, is left to Newton's method to correct. Compressed springs
    make the matrix indefinite; the iteration ends where it meets a direction that curves downwards, and goes along
    the first one if that is it.

    Parameters
    ----------
    tolerance : residual over right side, in the preconditioned norm of each island.

    Notes
    -----
    Hestenes and Stiefel, J. Res. NBS 49 (1952), 409; Baraff and Witkin, SIGGRAPH 1998, sec. 5.2; Steihaug, SIAM J.
    Numer. Anal. 20 (1983), 626.
    """

    restarts: ClassVar[int] = 4  # passes allowed for each unknown of an island
    most: ClassVar[int] = 5000  # passes at all; Newton's method goes on from there

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance

    def __call__(self, matrix: Any, load: Array, inertia: Array, islands: Islands) -> tuple[Array, int, Mask]:
        """delta of the symmetric part."""
        from scipy import sparse

        free = inertia > 0.0
        stiff = sparse.diags_array(inertia) @ matrix @ sparse.diags_array(free.astype(np.float64))
        symmetric = sparse.csr_array(0.5 * (stiff + stiff.T))
        n = number_of(islands)
        precondition = _preconditioner(symmetric, free)
        x, r = np.zeros_like(load), inertia * load
        z = precondition @ r
        p, rho = z, total(r * z, islands, n)
        goal, count, definite = self.tolerance**2 * rho, 0, np.ones(n, np.bool_)
        for k in range(min(self.restarts * int(np.bincount(islands).max()), self.most)):
            q = symmetric @ p
            curvature = total(p * q, islands, n)
            down = (rho > goal) & ~(curvature > 0.0)
            definite &= ~down
            if k == 0:
                x = x + np.where(down[islands], p, 0.0)
            going = (rho > goal) & ~down
            if not going.any():
                break
            count += int(going.sum())
            alpha = np.divide(rho, curvature, out=np.zeros(n), where=going)[islands]
            x, r = x + alpha * p, r - alpha * q
            z = precondition @ r
            fresh = np.where(going, total(r * z, islands, n), rho)
            p = z + np.divide(fresh, rho, out=np.zeros(n), where=going)[islands] * p
            rho = np.where(going, fresh, 0.0)
        return x, count, definite


def _preconditioner(matrix: Any, free: Mask) -> Any:
    """The inverses of the diagonal blocks of a symmetric matrix, scipy.sparse."""
    from scipy import sparse

    n = len(free)
    count = -(-n // BLOCK)
    entries = matrix.tocoo()
    rows, columns = entries.coords
    near = rows // BLOCK == columns // BLOCK
    d = np.zeros((count, BLOCK, BLOCK))
    d[rows[near] // BLOCK, rows[near] % BLOCK, columns[near] % BLOCK] = entries.data[near]
    idle = np.append(~free, np.ones(count * BLOCK - n, np.bool_)).reshape(count, BLOCK)
    d[:, range(BLOCK), range(BLOCK)] += idle
    upper = np.triu_indices(BLOCK)
    inverse = np.empty_like(d)
    for i, j, column in zip(*upper, traced_block_inverse().columns(*d[:, *upper].T), strict=True):
        inverse[:, i, j] = inverse[:, j, i] = column
    index = np.arange(count)
    shape = (count * BLOCK, count * BLOCK)
    return sparse.bsr_array((inverse, index, np.arange(count + 1)), shape=shape).tocsr()[:n, :n]
