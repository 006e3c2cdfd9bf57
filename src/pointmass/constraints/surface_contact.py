"""Triangles of surfaces and links of chains stay out of the colliders, not only their corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pointmass.constraints.constraint import Constraint, Step
from pointmass.constraints.families import names_of
from pointmass.engine.reference import surfaces_of
from pointmass.engine.surfaces import SurfaceKernel
from pointmass.errors import InvalidInput, number, unknown, whole_number
from pointmass.forces.springs import Springs
from pointmass.system import ParticleSystem

Rows = NDArray[np.intp]


class SurfaceContact(Constraint):
    """Keeps the faces and edges of cloth, and the links of hair and chains, out of every collider.

    Particles collide by themselves; between them a corner of a box, or the top of a ball, may come through. Here the
    deepest point of each triangle is looked for (Macklin et al., Local Optimization for Robust Signed Distance Field
    Collision, 2020) and pushed to the surface, its corners by their weights in that point and by their inverse masses,
    one triangle after the other, in rounds. The velocity there loses what goes into the surface and gets the collider's
    restitution; friction holds both, up to mu times what was pushed.

    Parameters
    ----------
    on : names of surfaces of the particles ("cloth") and families of springs ("strand", "chain") whose links are edges;
        None = all surfaces.
    thickness : how far from a collider they stay [m], at least 0. Above 0 a sharp corner is round to them, and they
        slide over it more smoothly. Let it be no more than the particles' radius, or it is these that are lifted.
    rounds : most passes over all that is near; fewer if nothing is left to be pushed.

    Raises
    ------
    InvalidInput
        A surface or family that does not exist, nothing to keep out, or no collider.

    Notes
    -----
    On convex colliders (ball, block, capsule, cylinder, polygon, a convex mesh) the deepest point is found to 1e-4 of
    the longest edge of its triangle. On other meshes, height fields and grids of distances, triangles are divided until
    they are as small as those of the mesh or the cells of the grid, at most into 64; what is smaller may come through.
    Planes and the insides of balls, boxes and capsules need none of this: there particles are enough.

    It looks at the end of each step: a plate that is thinner than what a cloth moves in one step may end up within it.
    What is left after the last round goes on in the next step. Pushing gives no speed, but it strains springs: what an
    impact strains in a long step may bring energy back, the less the shorter the steps. Where solvers make long steps,
    particles without a radius and a thickness in its place rest more quietly, as one thing holds them and not two.

    Examples
    --------
    >>> sim = pm.Simulation(system, constraints=[pm.SurfaceContact()])
    >>> pm.SurfaceContact("strand", thickness=5e-4)
    """

    def __init__(self, on: str | Sequence[str] | None = None, *, thickness: float = 1e-3, rounds: int = 8) -> None:
        self.on = names_of("on", on, "the name of a surface or of a family of springs")
        self.thickness = number("thickness", thickness, at_least=0, unit="m")
        self.rounds = whole_number("rounds", rounds, at_least=1)
        self._kernel: SurfaceKernel | None = None
        self._elements: tuple[int, Rows] = -1, np.zeros((0, 3), np.intp)

    def bind(self, system: ParticleSystem) -> None:
        names = list(system.particles.surfaces)
        known = [*names, *(f.family for f in _chains(system))]
        for name in self.on or []:
            if name not in known:
                raise unknown("surface of particles or family of springs", name, known)
        if not (names if self.on is None else self.on):
            raise InvalidInput(
                "a SurfaceContact needs triangles or links, but no surface covers the particles: name a family of "
                "springs as `on`, or leave it out"
            )
        if not system.colliders:
            raise InvalidInput("a SurfaceContact needs something to stay out of: add a collider, or leave it out")
        self._kernel = None
        self._elements = -1, self._elements[1]

    def enforce(self, system: ParticleSystem, step: Step) -> None:
        p = system.particles
        elements = self._rows(system)
        if not len(elements):
            return
        self._fitting(system).keep_out(
            p.x, p.v, step.begun(p), p.w, p.radius, elements, self.thickness, (step.t0, step.t1), self.rounds
        )

    def _fitting(self, system: ParticleSystem) -> SurfaceKernel:
        """The kernel for the colliders that there are now."""
        surfaces, kernel = surfaces_of(system), self._kernel
        if kernel is None or [id(s) for s in kernel.surfaces] != [id(s) for s in surfaces]:
            kernel = self._kernel = SurfaceKernel(surfaces, str(system.particles.dtype))
        return kernel

    def _rows(self, system: ParticleSystem) -> Rows:
        """Rows of the corners of all triangles, shape (k, 3); of a link (a, b, a)."""
        p = system.particles
        if self._elements[0] != p.version:
            wanted = list(p.surfaces) if self.on is None else self.on
            parts: list[Rows] = [p.corners(name) for name in p.surfaces if name in wanted]
            parts += [f.rows(p)[:, [0, 1, 0]] for f in _chains(system) if f.family in wanted]
            self._elements = p.version, np.concatenate([np.zeros((0, 3), np.intp), *parts])
        return self._elements[1]


def _chains(system: ParticleSystem) -> list[Springs]:
    return [f for f in system.forces if isinstance(f, Springs)]
