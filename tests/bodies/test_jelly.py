"""Jelly: the moduli of a strained block, masses, names of parts, its surface, sag, sway and a step that is safe."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.look import Look
from pointmass.meshes import triangle_mesh
from pointmass.scenes.base import stiffest
from pointmass.solvers.stability import largest_safe_step

CELL = np.array((0.1, 0.11, 0.09))
G = 9.81


def energy_of(body: pm.Body, x: np.ndarray) -> float:
    body.particles.x = x
    return pm.ParticleSystem(body.particles, body.forces).energy().potential


@pytest.mark.parametrize("counts", [(2, 2, 2), (4, 5, 3), (3, 3, 3)])  # cells of several forms
@pytest.mark.parametrize("poisson", [0.25, 0.4])
@pytest.mark.parametrize(
    "strain",
    [np.diag([1, 0, 0]), np.diag([0, 1, -0.4]), [[0, 0, 1], [0, 0, 0], [1, 0, 0]], [[1, 2, 5], [2, 3, -4], [5, -4, 6]]],
)
def test_energy_of_a_strain_is_that_of_an_isotropic_solid(counts, poisson: float, strain) -> None:
    """V (lambda (tr e)^2 / 2 + mu e:e), whatever the cells; strains beyond the first order are 1e-5 of them."""
    e = 1e-6 * np.array(strain, float)
    size = CELL * np.subtract(counts, 1)
    body = pm.jelly(counts, size, stiffness=2e4, poisson=poisson)
    x = body.particles.x.copy()
    mu = 2e4 / (2 * (1 + poisson))
    lame = 2 * mu * poisson / (1 - 2 * poisson)
    wanted = np.prod(size) * (0.5 * lame * np.trace(e) ** 2 + mu * (e * e).sum())
    assert energy_of(body, x + x @ e) == pytest.approx(wanted, rel=1e-5 * np.abs(strain).max() + 1e-6)


def test_damping_of_a_strain_rate_is_that_of_kelvin_and_voigt() -> None:
    """The power that is lost is viscosity / E times twice the energy of as large a strain."""
    body = pm.jelly((3, 4, 3), CELL * (2, 3, 2), stiffness=2e4, viscosity=70.0, poisson=0.4)
    p = body.particles
    rate = 1e-4 * np.array([[1, 0.3, 0.5], [0.3, 0.2, -0.4], [0.5, -0.4, 0.7]])
    p.v = p.x @ rate
    system = pm.ParticleSystem(p, body.forces)
    system.deriv_eval()
    lost = -(p.f * p.v).sum()
    p.v = 0 * p.v
    wanted = 2 * 70.0 / 2e4 * energy_of(body, p.x + p.x @ rate)
    assert lost == pytest.approx(wanted, rel=1e-3)


def test_masses_have_their_part_of_the_cells() -> None:
    m = pm.jelly((3, 4, 5), CELL * (2, 3, 4), density=500.0).particles.m.reshape(3, 4, 5)
    cell = 500.0 * np.prod(CELL)
    assert m.sum() == pytest.approx(2 * 3 * 4 * cell, rel=1e-13)
    np.testing.assert_allclose([m[1, 1, 1], m[0, 1, 1], m[0, 0, 1], m[0, 0, 0]], cell * 0.5 ** np.arange(4), rtol=1e-13)


def test_parts_by_name() -> None:
    p = pm.jelly((3, 4, 5), (2, 3, 4), pinned=["bottom corners", "top"]).particles
    low, high = p.x.min(axis=0), p.x.max(axis=0)
    for name, axis, end in (
        *(("left", 0, low), ("right", 0, high), ("bottom", 1, low), ("top", 1, high)),
        *(("back", 2, low), ("front", 2, high)),
    ):
        np.testing.assert_array_equal(p.select(name), np.flatnonzero(p.x[:, axis] == end[axis]))
    corners = np.flatnonzero(((p.x == low) | (p.x == high)).all(axis=1))
    np.testing.assert_array_equal(p.select("corners"), corners)
    np.testing.assert_array_equal(p.select("bottom corners"), corners[p.x[corners, 1] == low[1]])
    np.testing.assert_array_equal(p.select("surface"), np.flatnonzero(((p.x == low) | (p.x == high)).any(axis=1)))
    held = np.union1d(p.select("top"), p.select("bottom corners"))
    np.testing.assert_array_equal(np.flatnonzero(p.pinned), held)


def test_its_surface_is_closed_faces_outwards_and_hides_what_is_inside() -> None:
    body = pm.jelly((3, 4, 5), CELL * (2, 3, 4), tilt=25.0)
    mesh = triangle_mesh(body.particles.x, body.triangles)
    assert mesh.closed
    a, b, c = np.moveaxis(body.particles.x[body.triangles], 1, 0)
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(24 * np.prod(CELL), rel=1e-12)
    uv = body.particles.surfaces["jelly"].uv
    assert uv.min() == 0
    assert uv.max() == 1
    one, two = np.moveaxis(uv[:, 1:] - uv[:, :1], 1, 0)
    assert 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() == pytest.approx(6)  # all of each face
    other = pm.jelly((3, 3, 3), center=(1, 0, 0))
    scene = pm.Scene(bodies=[body, other], names=["a", "b"], look=Look(color="red"))
    (frame,) = scene.simulation().frames(1)
    assert [d.name for d in frame.drawables] == ["a", "b"]


def test_the_inside_of_a_surface_is_checked_and_kept() -> None:
    p = pm.Particles(np.eye(4, 3))
    with pytest.raises(pm.InvalidInput, match="inside of surface 'skin' must be ids of particles"):
        p.cover("skin", [[0, 1, 2]], inside=[7])
    p.cover("skin", [[0, 1, 2]], inside=[3])
    p.remove([3])
    assert p.surfaces["skin"].inside.tolist() == []


def test_its_tetrahedra_fill_it_and_wind_to_the_right() -> None:
    body = pm.jelly((3, 4, 4), CELL * (2, 3, 3), tilt=25.0)
    volumes = body.forces[-1].values(body.particles, body.particles.x)
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(18 * np.prod(CELL), rel=1e-12)


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.ImplicitEuler(tolerance=1e-3)], ids=lambda s: s.name)
def test_dropped_hard_it_does_not_turn_inside_out(solver: pm.Solver) -> None:
    """On a corner, at 4 m/s: springs on volumes would leave one flat."""
    body = pm.jelly((3, 3, 3), (0.2, 0.2, 0.2), tilt=30.0, velocity=(0, -4, 0), stiffness=2e4, viscosity=50.0)
    p, bulk = body.particles, body.forces[-1]
    p.x[:, 1] -= p.x[:, 1].min()
    system = pm.ParticleSystem(p, [pm.Gravity(), *body.forces], colliders=[pm.Plane(restitution=0.0, friction=0.5)])
    sim = pm.Simulation(system, solver, 1 / 60 if solver.implicit else 1 / 1200, compiled=False)
    rest = bulk.rests(p, 0.0)
    assert min((bulk.values(p, p.x) / rest).min() for _ in sim.frames(20, 60.0)) > 0.15


def sag(counts: tuple[int, int, int], size: tuple[float, float, float], poisson: float) -> float:
    """How far the bottom of a block hangs below where it was, under its weight [m]; it is held at the top."""
    body = pm.jelly(counts, size, stiffness=3e4, poisson=poisson, viscosity=3000.0, pinned="top")
    p = body.particles
    start = p.x[p.select("bottom"), 1].mean()
    pm.Simulation(pm.ParticleSystem(p, [pm.Gravity(), *body.forces]), pm.ImplicitEuler(), 0.5, compiled=False).step(7)
    assert np.abs(p.v).max() < 1e-5
    return float(start - p.x[p.select("bottom"), 1].mean())


@pytest.mark.parametrize("poisson", [0.25, 0.35])
def test_sag_does_not_depend_on_the_cells(poisson: float) -> None:
    """A cube whose top cannot become narrower sags by less than a column does, rho g L^2 / (2 E)."""
    few, many = (sag((n, n, n), (0.3, 0.3, 0.3), poisson) for n in (4, 8))
    assert few == pytest.approx(many, rel=0.05)
    assert 0.6 < many / (1000 * G * 0.3**2 / (2 * 3e4)) < 1.0


def test_a_column_sags_as_in_the_book() -> None:
    """By rho g L^2 / (2 E); its held end, a tenth of its length, is at most a third stiffer, and bears most."""
    drop = sag((3, 11, 3), (0.04, 0.2, 0.04), 0.25)
    assert drop == pytest.approx(1000 * G * 0.2**2 / (2 * 3e4), rel=0.05)


def test_the_bound_on_its_step_holds() -> None:
    """The step of the scene is below what the lens allows, at rest and squashed to three quarters of its height."""
    body = pm.jelly((4, 4, 4), poisson=0.45, viscosity=20.0)
    bound = largest_safe_step(pm.SymplecticEuler(), *(np.array([b]) for b in stiffest(body)))
    system = pm.ParticleSystem(body.particles, body.forces)
    exact = system.stability(pm.SymplecticEuler()).largest_safe_dt
    assert 0.4 * exact < bound < exact
    body.particles.x *= (0.75**-0.5, 0.75, 0.75**-0.5)
    assert bound < system.stability(pm.SymplecticEuler()).largest_safe_dt


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: pm.jelly((1, 3, 3)), "at least 2"),
        (lambda: pm.jelly((3, 3, 9)), r"counts = \(3, 3, 9\) is not allowed: its cells of 0.15 x 0.15 x 0.0375 m must"),
        (lambda: pm.jelly(size=(0.1, 0, 0.1)), "each side must be greater than 0"),
        (lambda: pm.jelly(stiffness=0), "stiffness = 0"),
        (lambda: pm.jelly(poisson=0.2), "poisson = 0.2"),
        (lambda: pm.jelly(poisson=0.5), "poisson = 0.5"),
        (lambda: pm.jelly(viscosity=-1), "viscosity = -1"),
        (lambda: pm.jelly(density=0), "density = 0"),
        (lambda: pm.jelly(pinned="botom"), "unknown value of pinned 'botom': did you mean 'bottom'"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(build, sentence: str) -> None:
    with pytest.raises(pm.InvalidInput, match=sentence):
        build()
