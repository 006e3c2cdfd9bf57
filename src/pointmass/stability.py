"""How large a step may be: the eigenvalues of the forces as they are now, against the limits of the solver."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pointmass.element_motion import (
    Element,
    ElementMotions,
    bent,
    element_blocks,
    element_motions,
    element_sums,
)
from pointmass.errors import InvalidInput
from pointmass.laws.elements import ElementForce
from pointmass.laws.force import Blocks
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.base import Array, Solver
from pointmass.solvers.stability import Complex, largest_safe_step, largest_safe_steps, safe_step

if TYPE_CHECKING:
    from pointmass.system import ParticleSystem

DENSE = 900  # islands up to this dimension are solved for all eigenvalues
WORK = 2  # as long as that is no more work than for this many of them
WANTED = 4  # eigenvalues of each kind in larger systems
ACCURACY = 1e-9
STANDING = 1e-6  # of the fastest motion: slower ones are round-off of those that stand still, double eigenvalues
SMALL = 200  # dimension up to which all motions are found to get one
VECTOR = 1e-4  # residual of the motion that elements carry: their energies are off by its square
NOTHING = 1e-3  # of what the first one carries: who has less is not named
PARTS = 12  # of the largest stiffness and damping that are tried
NOT_FINITE = "the forces are not finite where the particles are now: there is no largest step"
NOT_FOUND = "the highest frequency of this system could not be found: try a smaller part of it"
ITERATION: dict[str, Any] = {"ncv": 80, "maxiter": 100, "tol": ACCURACY}


@dataclass(frozen=True)
class Stability:
    """A report; as text it is a page for people.

    Attributes
    ----------
    largest_safe_dt : largest step with which no motion is amplified [s]; inf = any.
    frequency : highest angular frequency of the system, |lambda| [rad/s]; 0 without forces that vary.
    damping_ratio : of that motion, -Re(lambda)/|lambda|.
    period : 2 pi / frequency [s].
    solver : name of the solver whose limits these are.
    elements : of each force on springs, joints and other elements that acts: how near each of them is to the limit, and
        what it carries of the motion that limits the step.
    """

    largest_safe_dt: float
    frequency: float
    damping_ratio: float
    period: float
    solver: str = ""
    elements: tuple[ElementMotions, ...] = field(default=(), compare=False)

    def carriers(self, count: int = 3) -> list[Element]:
        """The elements with most of the energy of the motion that limits the step, at most `count` of them."""
        most = [(table, np.argsort(-table.part, kind="stable")[:count]) for table in self.elements]
        found = [table.element(int(number)) for table, numbers in most for number in numbers]
        found.sort(key=lambda e: -e.part)
        return [e for e in found[:count] if e.part > max(0.0, NOTHING * found[0].part)]

    def __str__(self) -> str:
        step = "any" if math.isinf(self.largest_safe_dt) else f"{self.largest_safe_dt:.4g} s"
        lines = [f"largest safe dt of {self.solver}: {step}", f"fastest motion: {self.motion}"]
        for table in sorted(self.elements, key=lambda table: -table.frequency.max()):
            low, high = table.frequency.min(), table.frequency.max()
            lines.append(
                f"{table.family}: {len(table.ids)} elements of {low:.4g} to {high:.4g} rad/s alone, "
                f"damping ratio {table.damping_ratio.min():.3g} to {table.damping_ratio.max():.3g}"
            )
        lines += [f"{100 * e.part:.3g} % of the fastest motion is in {e}" for e in self.carriers()]
        return "\n".join(lines)

    @property
    def motion(self) -> str:
        """The fastest motion in words."""
        if not self.frequency:
            return "nothing swings or decays"
        return f"{self.frequency:.4g} rad/s, period {self.period:.4g} s, damping ratio {self.damping_ratio:.3g}"


def stability(system: ParticleSystem, solver: Solver) -> Stability:
    """Linearise a system where it is and compare its motions with the solver's limits.

    Raises
    ------
    InvalidInput
        A force has no Jacobian (a NumPy function that couples particles), or is not finite.
    """
    matrix = _linearised(system)
    bound, found = matrix, _modes(system, matrix)
    fast = found.values[np.abs(found.values).argmax()] if len(found.values) else 0.0
    size = float(np.abs(fast))
    if solver.relaxes:
        with system.slack():
            bound = _linearised(system)
            found = _modes(system, bound)
    limit = largest_safe_step(solver, found.stiffness, found.damping)
    if system.order == 2:
        limit = safe_step(solver, bound, limit, found.growth)
    return Stability(
        largest_safe_dt=limit,
        frequency=size,
        damping_ratio=float(0.0 - np.real(fast) / size) if size > 0 else 0.0,
        period=2 * math.pi / size if size > 0 else math.inf,
        solver=solver.name,
        elements=_elements(system, solver, matrix, limit),
    )


def safe_bound(system: ParticleSystem, solver: Solver) -> float | None:
    """A step with which stiffness and damping amplify no motion [s], found in a moment: safe, but not the longest one.

    With the matrices K_e of the elements e, for x and v times the root of the mass, a motion x has no more energy than

        x . K x = sum_e x_e . K_e x_e <= sum_i |x_i|^2 sum_(e at i) |K_e|,

    so all stiffnesses, and likewise all dampings, are below the largest of these sums over the elements at a particle,
    |K_e| being the root of the sum of squares. The bound of a cloth is some 0.6 of its longest step.

    Returns
    -------
    float or None
        inf = any; None where this tells nothing: forces that are not on elements or single particles, a flow.

    Raises
    ------
    InvalidInput
        A parameter is not allowed now, or the forces are not finite.
    """
    with limiting(system, solver):
        known = all(isinstance(force, (ElementForce, UnaryForce)) for force in system.forces if force.enabled)
        if system.order == 1 or not known:
            return None
        sums = element_sums(system) + _own_norms(system)
    if not np.isfinite(sums).all():
        raise InvalidInput(NOT_FINITE)
    stiffness, damping = sums.max(axis=1, initial=0.0)
    parts = np.linspace(0.0, 1.0, PARTS)
    step = largest_safe_step(solver, np.repeat(parts, PARTS) * stiffness, np.tile(parts, PARTS) * damping)
    return step if step > 0.0 or damping == 0.0 else None


def limiting(system: ParticleSystem, solver: Solver) -> AbstractContextManager[None]:
    """Inside, only those forces act that limit the steps of a solver: XPBD takes elastic elements of any stiffness."""
    return system.slack() if solver.relaxes else nullcontext()


def eigenvalues(system: ParticleSystem) -> Complex:
    """Eigenvalues of d(deriv_eval)/dy now [1/s], of all islands that are different from each other.

    All of them; where that is too much work, those of largest size, of largest frequency and of strongest damping.

    Raises
    ------
    InvalidInput
        The forces are not finite, or have no Jacobian, or the iteration does not converge.
    """
    return modes(system).values


def modes(system: ParticleSystem) -> Modes:
    """The motions whose eigenvalues `eigenvalues` gives."""
    return _modes(system, _linearised(system))


class Modes(NamedTuple):
    """Motions x'' = -stiffness x - damping x' of a linear system.

    Attributes
    ----------
    values : eigenvalues [1/s], shape (k,).
    stiffness, damping : of the motion that each belongs to [1/s^2, 1/s], shape (k,).
    growth : bound of the real parts of all eigenvalues, not of these only [1/s].
    """

    values: Complex
    stiffness: Complex
    damping: Complex
    growth: float


def _linearised(system: ParticleSystem) -> Any:
    """d(deriv_eval)/dy now, for x and v times the root of the mass: symmetric where forces have a potential."""
    from scipy.sparse import csr_array

    if not len(system.particles):
        return csr_array((0, 0))
    state = system.get_state()
    state[: 3 * len(system.particles)] = bent(system).ravel()
    matrix = system.jacobian(system.t, state).astype(np.float64)
    if not np.isfinite(matrix.data).all():
        raise InvalidInput(NOT_FINITE)
    if system.order == 1:
        return matrix
    held = ~np.isfinite(system.inertia)
    root, held = np.tile(np.sqrt(np.where(held, 1.0, system.inertia)), 2), np.tile(held, 2)
    entries = matrix.tocoo()
    row, column = entries.coords
    scaled = entries.data * root[row] / root[column]  # x' = v stays exactly that
    scaled[held[column]] = 0.0  # who is held moves nobody, and all that moves keeps its eigenvalue
    return csr_array((scaled, (row, column)), shape=matrix.shape)


def _own_norms(system: ParticleSystem) -> Array:
    """Norms of what forces on single particles add to the stiffness and to the damping of each, shape (2, n)."""
    p, blocks = system.particles, Blocks()
    for force in system.forces:
        if isinstance(force, UnaryForce) and force.enabled:
            force.add_jacobian(p, system.t, p.x, p.v, blocks)
    sums = np.zeros((2, len(p), 3, 3))
    for rows, dx, dv in blocks.own:
        sums[:, rows] += dx, dv
    norms: Array = np.sqrt((sums * sums).sum(axis=(2, 3))) * np.where(p.pinned, 0.0, p.w)
    return norms


def _elements(system: ParticleSystem, solver: Solver, matrix: Any, limit: float) -> tuple[ElementMotions, ...]:
    """What each element does by itself, and what it carries of the motion that limits the step."""
    blocks = element_blocks(system)
    if not blocks:
        return ()
    n = len(system.particles)
    pull, damping = (-_symmetric_part(part) for part in (matrix[3 * n :, : 3 * n], matrix[3 * n :, 3 * n :]))
    islands = np.repeat(system.island_of_particle, 3)
    motions = [_strongest(part, islands) for part in (pull, damping)]
    stiffness, drags = ([float(x @ (part @ x)) for x in motions] for part in (pull, damping))
    by_drag = bool(np.argmin(largest_safe_steps(solver, stiffness, drags)))
    energy = (drags if by_drag else stiffness)[int(by_drag)]
    vector = motions[int(by_drag)] / math.sqrt(energy) if energy > 0.0 else np.zeros(3 * n)
    return element_motions(blocks, n, solver, limit, vector, by_drag)


def _strongest(matrix: Any, islands: NDArray[np.intp]) -> Array:
    """Eigenvector of the largest eigenvalue, in one island: others that are alike move for themselves."""
    size = matrix.shape[0]
    if not matrix.count_nonzero():
        return np.zeros(size)
    if size <= SMALL:
        vector = np.linalg.eigh(matrix.toarray())[1][:, -1]
    else:
        vector = _symmetric_modes(matrix, 1, "LA", VECTOR)[1][:, 0]
    mine = islands == np.bincount(islands, vector * vector).argmax()
    vector = np.where(mine, vector, 0.0)
    return np.asarray(vector / np.linalg.norm(vector))


def _symmetric_part(matrix: Any) -> Any:
    return 0.5 * (matrix + matrix.T)


def _modes(system: ParticleSystem, matrix: Any) -> Modes:
    sizes = np.bincount(system.islands).astype(float)
    if sizes.max(initial=0.0) <= DENSE and (sizes**3).sum() <= WORK * DENSE**3:
        found = [_of_blocks(blocks, system.order) for blocks in _blocks(matrix, system.islands)]
    else:
        found = [_extreme(matrix, system.order)]
    values, stiffness, damping, growth = zip(*found, strict=True) if found else ([], [], [], [])
    return Modes(_joined(values), _joined(stiffness), _joined(damping), max(growth, default=0.0))


def _joined(parts: Sequence[Complex]) -> Complex:
    return np.concatenate([np.zeros(0, complex), *(part.ravel() for part in parts)])


def _blocks(matrix: Any, islands: NDArray[np.intp]) -> Iterator[Array]:
    """The part of each island that is different from the others, those of equal size at once: shape (k, size, size)."""
    entries = matrix.tocoo()
    row, column = entries.coords
    sizes = np.bincount(islands)
    order = np.argsort(islands, kind="stable")
    place = np.empty(len(islands), np.intp)  # of each entry within its island
    place[order] = np.arange(len(islands)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    for size in np.unique(sizes):
        number = np.cumsum(sizes == size) - 1
        mine = sizes[islands[row]] == size
        blocks = np.zeros((int((sizes == size).sum()), size, size))
        blocks[number[islands[row[mine]]], place[row[mine]], place[column[mine]]] = entries.data[mine]
        yield np.stack(list({block.tobytes(): block for block in blocks}.values()))


def _of_blocks(blocks: Array, order: int) -> Modes:
    """All modes."""
    n = blocks.shape[-1] // 2
    pull, damping = -blocks[:, n:, :n], -blocks[:, n:, n:]
    if order == 2 and _is_symmetric(pull) and not damping.any():
        return _undamped(np.linalg.eigvalsh(pull))
    values, vectors = np.linalg.eig(blocks)
    growth = float(values.real.max(initial=0.0))
    return _first_order(values, growth) if order == 1 else _damped(values, vectors[:, :n], damping, growth)


def _extreme(matrix: Any, order: int) -> Modes:
    """The modes that limit steps, by ARPACK's iterations from a fixed vector: the same answer each time."""
    from scipy.sparse.linalg import ArpackNoConvergence, eigs

    n = matrix.shape[0] // 2
    pull, damping = -matrix[n:, :n], -matrix[n:, n:]
    if order == 2 and _is_symmetric(pull) and _is_symmetric(damping):
        return _stiffest(pull, damping)
    found: list[tuple[Any, Any]] = []
    for which in ("LM", "LI", "SR"):
        try:
            found.append(eigs(matrix, WANTED, v0=np.cos(np.arange(2 * n)), which=which, **ITERATION))
        except ArpackNoConvergence as error:  # where all motions are of one kind, another kind is not found
            found.append((error.eigenvalues, error.eigenvectors))
    values = np.concatenate([each for each, _ in found]).astype(complex)
    if not len(values):
        raise InvalidInput(NOT_FOUND)
    vectors = np.concatenate([each for _, each in found], axis=1)
    growth = float(values.real.max(initial=0.0))
    return _first_order(values, growth) if order == 1 else _damped(values, vectors[:n], damping, growth)


def _stiffest(pull: Any, damping: Any) -> Modes:
    """The motions of largest stiffness and of largest damping: modes where they share them, else close to some."""
    least, _ = _symmetric_modes(pull, 1, "SA", 0.1)
    growth = math.sqrt(max(-float(least[0]), 0.0))
    matrices = [m for m in (pull, damping) if m.count_nonzero()]
    x = np.concatenate([_symmetric_modes(m, WANTED, "LA", ACCURACY)[1] for m in matrices], axis=1)
    k, d = ((x * (m @ x)).sum(axis=0).astype(complex) for m in (pull, damping))
    root = np.sqrt(0.25 * d * d - k)
    values = np.asarray(np.concatenate([root, -root]) - 0.5 * np.tile(d, 2), np.complex128)
    return Modes(values, np.tile(k, 2), np.tile(d, 2), growth)


def _symmetric_modes(matrix: Any, count: int, which: Literal["LA", "SA"], tolerance: float) -> tuple[Array, Array]:
    """Some eigenvalues and eigenvectors of a symmetric matrix, from a fixed start."""
    from scipy.sparse.linalg import ArpackNoConvergence, eigsh

    try:
        values, vectors = eigsh(matrix, k=count, which=which, v0=np.cos(np.arange(matrix.shape[0])), tol=tolerance)
    except ArpackNoConvergence:
        raise InvalidInput(NOT_FOUND) from None
    return values, vectors


def _is_symmetric(matrix: Any) -> bool:
    other = matrix.T if matrix.ndim == 2 else matrix.swapaxes(-1, -2)
    return bool(abs(matrix - other).max() <= ACCURACY * abs(matrix).max())


def _undamped(squares: Array) -> Modes:
    """From the eigenvalues of a symmetric stiffness."""
    roots = np.sqrt(-squares.astype(complex))
    twice = np.concatenate([squares, squares]).astype(complex)
    return Modes(np.concatenate([roots, -roots]), twice, np.zeros_like(twice), float(roots.real.max(initial=0.0)))


def _first_order(values: Complex, growth: float) -> Modes:
    """x' = values x: what v of a drag does."""
    return Modes(values, np.zeros_like(values), -values, growth)


def _damped(values: Complex, x: Complex, damping: Any, growth: float) -> Modes:
    """Modes of eigenvectors of which `x` are the upper halves, shape (..., n, k).

    The oscillator with the mean damping of the motion has its eigenvalue: from (l^2 + l D + K) x = 0 follows
    l^2 + l d + k = 0 with d = x* D x / x* x, and k like it.
    """
    weight = (np.abs(x) ** 2).sum(axis=-2)
    size = np.abs(values)
    moves = (weight > 0.0) & (size > STANDING * size.max(axis=-1, initial=0.0, keepdims=True))
    drag = np.where(moves, (np.conj(x) * (damping @ x)).sum(axis=-2) / np.where(moves, weight, 1.0), 0.0)
    drag = _rounded(drag, ACCURACY * size)
    pull = _rounded(np.where(moves, -values * (values + drag), 0.0), ACCURACY * size**2)
    alone = moves & ((-drag - values).real > ACCURACY * size)  # its partner grows, and hides what this one does
    return Modes(values, np.where(alone, 0.0, pull), np.where(alone, -values, drag), growth)


def _rounded(numbers: Complex, error: Array) -> Complex:
    """Parts smaller than an error are none."""
    real, imaginary = np.real(numbers), np.imag(numbers)
    return np.asarray(
        np.where(np.abs(real) > error, real, 0.0) + 1j * np.where(np.abs(imaginary) > error, imaginary, 0.0)
    )
