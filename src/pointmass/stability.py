"""How large a step may be: the eigenvalues of the forces as they are now, against the limits of the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput
from pointmass.solvers.base import Solver
from pointmass.solvers.stability import largest_safe_step

if TYPE_CHECKING:
    from pointmass.system import ParticleSystem

DENSE = 900  # up to this dimension all eigenvalues are computed, beyond it those of largest size
WANTED = 12


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
    values = eigenvalues(system)
    fast = values[np.argmax(np.abs(values))] if len(values) else 0.0
    size = float(np.abs(fast))
    return Stability(
        largest_safe_dt=float(largest_safe_step(solver, values)),
        frequency=size,
        damping_ratio=float(-np.real(fast) / size) if size > 0 else 0.0,
        period=2 * math.pi / size if size > 0 else math.inf,
    )


def eigenvalues(system: ParticleSystem) -> NDArray[np.complex128]:
    """Eigenvalues of d(deriv_eval)/dy now [1/s]: all of them, or those of largest size where there are many."""
    if not len(system.particles):
        return np.zeros(0, complex)
    matrix = system.jacobian(system.t, system.get_state())
    if not np.isfinite(matrix.data).all():
        raise InvalidInput("the forces are not finite where the particles are now: there is no largest step")
    if (system.islands == np.arange(system.dim) % (system.dim // system.order) // 3).all():
        return _each_particle(system, matrix)
    if system.dim <= DENSE:
        return np.linalg.eigvals(matrix.toarray()).astype(np.complex128)
    from scipy.sparse.linalg import ArpackNoConvergence, eigs

    start = np.cos(np.arange(system.dim))  # any fixed vector: the same answer each time
    try:
        values = eigs(matrix.astype(float), k=WANTED, which="LM", v0=start, return_eigenvectors=False)
    except ArpackNoConvergence as error:
        values = error.eigenvalues
    return np.asarray(values, np.complex128)


def _each_particle(system: ParticleSystem, matrix: object) -> NDArray[np.complex128]:
    """All particles are alone: one small block each."""
    from scipy.sparse import coo_array

    n, order = len(system.particles), system.order
    entries = coo_array(matrix)
    row, column = entries.coords
    blocks = np.zeros((n, 3 * order, 3 * order))
    place = 3 * (row // (3 * n)) + row % 3, 3 * (column // (3 * n)) + column % 3
    blocks[row % (3 * n) // 3, place[0], place[1]] = entries.data
    return np.unique(np.linalg.eigvals(blocks).ravel().round(12)).astype(np.complex128)
