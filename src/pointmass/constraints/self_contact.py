"""Cloth that does not pass through itself, or through other cloth."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.hair import STRAND
from pointmass.constraints.constraint import Constraint, Step
from pointmass.constraints.families import names_of
from pointmass.errors import InvalidInput, number, unknown
from pointmass.laws.elements import ElementForce
from pointmass.particles import Array, Particles
from pointmass.self_contact.crossings import crossings
from pointmass.self_contact.pairs import Mesh, Rows
from pointmass.self_contact.resolution import Obstacles, Resolution
from pointmass.system import ParticleSystem

Surfaces = str | Sequence[str]

THIN = 0.25  # of the shortest edge: the thickness by default
THICKEST = 0.5  # of it; beyond that a sheet pushes at itself where it only bends
NEAR = 2.0  # thicknesses from a collider within which it is heeded


class SelfContact(Constraint):
    """Cloth does not pass through itself or through other cloth: it lies on it, and rubs against it.

    Surfaces are kept `thickness` apart. After each step it is found where they meet on the straight ways of their
    corners, points with triangles and edges with edges, however fast they are; and these ways are changed by impulses
    that stop them from nearing, and by Coulomb friction. The change of the ways, over dt, is added to the velocities.
    So no triangle passes through another at the end of a step, or in a frame between. Pinned particles stay where they
    are, or go where they are led: those that are led through a cloth cross it, which is said once.

    Parameters
    ----------
    on : names of surfaces, or of bodies or groups whose triangles are meant; None = all surfaces.
    thickness : distance between surfaces that lie on each other [m], a quarter of the shortest edge by default. It must
        be at most half of that edge.
    friction : Coulomb's mu of cloth on cloth, at least 0.
    hair : whether the strands of hair do not pass through each other, or through the surfaces, either.

    Raises
    ------
    InvalidInput
        There are no surfaces; one passes through itself at the start; a thickness that is too large.

    Notes
    -----
    Bridson, Fedkiw and Anderson, Robust Treatment of Collisions, Contact and Friction for Cloth Animation, SIGGRAPH
    2002; collisions are found as there, by the cubic of Provot 1997. They are parted together, as in the inelastic
    zones of Harmon et al. 2008, but by impulses that only push (Gauss-Seidel sweeps over all in a fixed order); and
    zones move as one, without turning, where that does not help. Where surfaces are nearer than their thickness they
    part by a tenth of what is lacking in each step, and not faster than in 1/24 s.

    The thickness goes with the mesh, not with the cloth: finer meshes can be thinner. What is near is looked for again
    when something has moved by a thickness relative to the rest, which takes most of the time. Springs do not take part
    when ways are changed, so long steps strain those of a stiff cloth where it meets something. Impacts have no
    restitution. Put it after `StrainLimit`, which knows nothing of contact, and before `Tear`. The two sides of a fresh
    tear touch, and are judged once they are apart.

    Examples
    --------
    >>> pm.Simulation(system, dt=1 / 240, constraints=[pm.SelfContact(friction=0.3)])
    """

    def __init__(
        self,
        on: Surfaces | None = None,
        thickness: float | None = None,
        friction: float = 0.3,
        *,
        hair: bool = False,
    ) -> None:
        self.on = names_of("on", on, "the name of a surface")
        self.thickness = None if thickness is None else number("thickness", thickness, above=0, unit="m")
        self.friction = number("friction", friction, at_least=0)
        self.hair = bool(hair)
        self._strands: list[ElementForce] = []
        self._version = -1
        self._parts: tuple[Rows, Rows] = np.zeros((0, 3), np.intp), np.zeros((0, 2), np.intp)
        self._resolution: Resolution | None = None
        self._warned = False

    def bind(self, system: ParticleSystem) -> None:
        p = system.particles
        links = (f for f in system.forces if isinstance(f, ElementForce) and f.family == STRAND)
        self._strands = list(links) if self.hair else []
        for name in self.on or ():
            if name not in p.surfaces and name not in p.groups:
                raise unknown("surface or body", name, [*p.surfaces, *p.groups])
        self._version = -1
        mesh = self._read(p).mesh
        if not len(mesh.edges):
            what = "surfaces" if self.on is None else f"triangles of {', '.join(self.on)}"
            raise InvalidInput(
                f"SelfContact finds no {what}: it needs a cloth, or particles covered by Particles.cover"
            )
        through = crossings(p.x, mesh)
        if len(through):
            edge, triangle = p.id[mesh.edges[through[0, 0]]], p.id[mesh.triangles[through[0, 1]]]
            raise InvalidInput(
                f"a surface passes through itself at the start, at {len(through)} places: the edge of particles "
                f"{edge.tolist()} passes through the triangle {triangle.tolist()}; move them apart"
            )

    def forget(self) -> None:
        if self._resolution is not None:
            self._resolution.forget()

    def enforce(self, system: ParticleSystem, step: Step) -> None:
        p = system.particles
        resolution = self._read(p)
        x1 = p.x.astype(np.float64)
        x0 = step.begun(p)[0].astype(np.float64)
        given = x1.copy()
        w = p.w.astype(np.float64)
        if resolution.resolve(x0, x1, w, step.dt, self._obstacles(system, step.t1)):
            moved = (x1 != given).any(axis=1) & (w > 0)
            p.x[moved] = x1[moved]
            p.v[moved] += ((x1[moved] - given[moved]) / step.dt).astype(p.dtype)
        if resolution.lost and not self._warned:
            self._warned = True
            warnings.warn(
                f"pins lead a surface through itself at t = {step.t1:.4g} s, so it passes through itself from there on",
                stacklevel=2,
            )

    # ------------------------------------------------------------------------------------------------ inside

    def _read(self, p: Particles) -> Resolution:
        """What keeps the present particles apart."""
        if self._resolution is not None and self._version == p.version:
            return self._resolution
        self._version = p.version
        parts = self._triangles(p), np.concatenate([np.zeros((0, 2), np.intp), *(f.rows(p) for f in self._strands)])
        if self._resolution is None or not all(map(np.array_equal, parts, self._parts)):
            self._parts, mesh = parts, Mesh.of(*parts)
            self._resolution = Resolution(mesh, self._thick(p, mesh), self.friction)
        return self._resolution

    def _triangles(self, p: Particles) -> Rows:
        corners = {name: p.corners(name) for name in p.surfaces}
        every = np.concatenate([np.zeros((0, 3), np.intp), *corners.values()])
        if self.on is None:
            return every
        inside = np.zeros(len(every), bool)
        first = 0
        for surface, rows in corners.items():
            inside[first : first + len(rows)] |= surface in self.on
            first += len(rows)
        for name in self.on:
            if name in p.groups and name not in p.surfaces:
                inside |= p.groups[name][every].all(axis=1)
        return every[inside]

    def _thick(self, p: Particles, mesh: Mesh) -> float:
        """The thickness [m]; what it is at the start stays."""
        if self._resolution is not None:
            return self._resolution.thickness
        ends = p.x[mesh.edges].astype(np.float64)
        shortest = float(np.sqrt(np.square(ends[:, 0] - ends[:, 1]).sum(axis=1)).min(initial=np.inf))
        if shortest == 0:
            raise InvalidInput("a triangle has two corners at one place: SelfContact needs edges of some length")
        if self.thickness is None:
            return THIN * shortest if np.isfinite(shortest) else 1.0
        if self.thickness > THICKEST * shortest:
            raise InvalidInput(
                f"thickness = {self.thickness} is not allowed: it must be at most {THICKEST * shortest:.3g} [m], half "
                "of the shortest edge; use longer edges or a thinner cloth"
            )
        return self.thickness

    def _obstacles(self, system: ParticleSystem, t: float) -> Obstacles | None:
        colliders = [c for c in system.colliders if c.response != "kill"]
        radius = system.particles.radius

        def near(rows: Rows, x: Array) -> list[tuple[NDArray[np.intp], Array, Array]]:
            found = []
            for collider in colliders:
                outside = collider.distance(x[rows], t) - radius[rows]
                close = outside < NEAR * self._thickness
                some = rows[close]
                found.append((some, collider.normal(x[some], t), np.maximum(outside[close], 0.0)))
            return found

        return near if colliders else None

    @property
    def _thickness(self) -> float:
        assert self._resolution is not None
        return self._resolution.thickness
