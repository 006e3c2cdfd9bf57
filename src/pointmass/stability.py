"""How large a step may be: the eigenvalues of the forces as they are now, against the limits of the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput
from pointmass.solvers.base import Solver
from pointmass.solvers.stability import largest_safe_step

if TYPE_CHECKING:
    from pointmass.system import ParticleSystem

DENSE = 900  # islands up to this dimension are solved for all eigenvalues
WORK = 2  # as long as that is no more work than for this many of them
WANTED = 4  # eigenvalues of each kind in larger systems
ACCURACY = 1e-9
ITERATION: dict[str, Any] = {"ncv": 80, "maxiter": 100, "tol": ACCURACY}


@dataclass(frozen=True)
class Stability:
    """A report.

    Attributes
    ----------
    largest_safe_dt : largest step with which no motion is amplified [s]; inf = any.
    frequency : highest angular frequency of the system, |lambda| [rad/s]; 0 without forces that vary.
    damping_ratio : of that motion, -Re(lambda)/|lambda|.
    period : 2 pi / frequency [s].
    """

    largest_safe_dt: float
    frequency: float
    damping_ratio: float
    period: float


def stability(system: ParticleSystem, solver: Solver) -> Stability:
    """Linearise a system where it is and compare its motions with the solver's limits.

    Raises
    ------
    InvalidInput
        A force has no Jacobian (a NumPy function that couples particles).
    """
    parts = spectra(system)
    values = np.concatenate(parts)
    fast = values[np.argmax(np.abs(values))] if len(values) else 0.0
    size = float(np.abs(fast))
    return Stability(
        largest_safe_dt=float(largest_safe_step(solver, *parts)),
        frequency=size,
        damping_ratio=float(-np.real(fast) / size) if size > 0 else 0.0,
        period=2 * math.pi / size if size > 0 else math.inf,
    )


def eigenvalues(system: ParticleSystem) -> NDArray[np.complex128]:
    """Eigenvalues of d(deriv_eval)/dy now [1/s], of all islands (see `spectra`)."""
    return np.concatenate(spectra(system))


def spectra(system: ParticleSystem) -> list[NDArray[np.complex128]]:
    """Eigenvalues of d(deriv_eval)/dy now [1/s], one array for each island that is different from the others.

    All of them; where that is too much work, those of largest size, of largest frequency and of strongest damping.

    Raises
    ------
    InvalidInput
        The forces are not finite, or have no Jacobian, or the iteration does not converge.
    """
    if not len(system.particles):
        return [np.zeros(0, complex)]
    matrix = system.jacobian(system.t, system.get_state())
    if not np.isfinite(matrix.data).all():
        raise InvalidInput("the forces are not finite where the particles are now: there is no largest step")
    islands = system.islands
    sizes = np.bincount(islands).astype(float)
    if sizes.max() <= DENSE and (sizes**3).sum() <= WORK * DENSE**3:
        return _dense(matrix, islands)
    return [_extreme(matrix.astype(np.float64), system.inertia if system.order == 2 else None)]


def _dense(matrix: Any, islands: NDArray[np.intp]) -> list[NDArray[np.complex128]]:
    """All eigenvalues: one block for each island, islands of equal size at once."""
    entries = matrix.tocoo()
    row, column = entries.coords
    sizes = np.bincount(islands)
    order = np.argsort(islands, kind="stable")
    place = np.empty(len(islands), np.intp)  # of each entry within its island
    place[order] = np.arange(len(islands)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    found: list[NDArray[np.complex128]] = []
    for size in np.unique(sizes):
        number = np.cumsum(sizes == size) - 1
        mine = sizes[islands[row]] == size
        blocks = np.zeros((int((sizes == size).sum()), size, size))
        blocks[number[islands[row[mine]]], place[row[mine]], place[column[mine]]] = entries.data[mine]
        for block in np.unique(blocks, axis=0):
            values = np.linalg.eigvals(block).astype(np.complex128)
            found.append(values if block[size // 2 :, : size // 2].any() else _strongest_drag(values))
    return found


def _strongest_drag(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Of a part without stiffness, where each real eigenvalue is a drag by itself: the others are slower."""
    real = values.imag == 0
    return np.concatenate([values[~real], values[real][np.argsort(values[real].real)[:1]]])


def _extreme(matrix: Any, inertia: NDArray[np.floating[Any]] | None) -> NDArray[np.complex128]:
    """The eigenvalues that limit steps, by ARPACK's iterations from a fixed vector: the same answer each time.

    Without damping, x'' = -K x with M K symmetric, the frequencies are roots of eigenvalues of a symmetric matrix.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import ArpackNoConvergence, eigs, eigsh

    start = np.cos(np.arange(matrix.shape[0]))
    if inertia is not None:
        n = len(inertia)
        pull, damping = matrix[n:, :n], matrix[n:, n:]
        root = diags_array(np.sqrt(np.where(np.isfinite(inertia), inertia, 1.0)))
        stiff = -(root @ pull @ diags_array(1 / root.diagonal()))
        if not damping.count_nonzero() and abs(stiff - stiff.T).max() <= ACCURACY * abs(stiff).max():
            squares = eigsh(stiff, k=WANTED, which="LA", v0=start[:n], tol=ACCURACY, return_eigenvectors=False)
            return np.concatenate([sign * np.sqrt(squares.astype(complex)) for sign in (1j, -1j)])
    found: list[NDArray[np.complex128]] = []
    values: NDArray[Any]
    for which in ("LM", "LI", "SR"):
        try:
            values = eigs(matrix, WANTED, v0=start, return_eigenvectors=False, which=which, **ITERATION)
        except ArpackNoConvergence as error:  # where all motions are of one kind, another kind is not found
            values = error.eigenvalues
        found.append(values.astype(np.complex128))
    extreme = np.concatenate(found)
    if not len(extreme):
        raise InvalidInput("the highest frequency of this system could not be found: try a smaller part of it")
    return extreme
