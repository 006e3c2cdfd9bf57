"""Cloth against closed forms: a catenary, a hanging column, the sag between two edges (checks K02 to K05)."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.scenes.base import stiffest
from pointmass.scenes.sheets import steps
from pointmass.solvers.stability import largest_safe_step

G = 9.81


def settled(body: pm.Body, dt: float, steps: int, compiled: bool = False, **options: float) -> pm.Simulation:
    """A body at rest under gravity."""
    system = pm.ParticleSystem(body.particles, [pm.Gravity(), *body.forces])
    sim = pm.Simulation(system, pm.ImplicitEuler(**options), dt, compiled=compiled)
    sim.step(steps)
    assert np.abs(body.particles.v).max() < 1e-6
    return sim


@pytest.mark.parametrize(("links", "lowest"), [(20, 0.503447), (9, 0.495221)])
def test_K02_a_sheet_between_two_edges_hangs_as_a_catenary(links: int, lowest: float) -> None:
    """H tan(theta_i) = V_i for equal links of 1.5 times the span in all, both rows alike."""
    body = pm.cloth(
        *(2, links + 1, (1.5, 0.1)),
        down=(0, 0, 1),
        density=0.2,
        stretch=2e5,
        shear=0.0,
        bend=0.0,
        damping_ratio=0.3,
        pinned="side edges",
    )
    p, along = body.particles, np.tile(np.linspace(0, 1, links + 1), 2)
    p.x[:, 0], p.x[:, 1] = along, -2 * along * (1 - along)
    settled(body, 0.05, 150)
    rows = p.x.reshape(2, links + 1, 3)
    assert -rows[:, :, 1].min() == pytest.approx(lowest, rel=1e-4)
    np.testing.assert_allclose(rows[0, :, :2], rows[1, :, :2], atol=1e-9)
    np.testing.assert_allclose(rows[0, ::-1, 1], rows[0, :, 1], atol=1e-6)


def test_K03_stretch_of_a_hanging_chain() -> None:
    """m g n (n + 1) / (2 k) for n masses."""
    n, m, k = 12, 0.05, 400.0
    body = pm.chain(n, 1.0, direction=(0, -1, 0), mass=n * m, k_s=k, damping_ratio=0.5)
    settled(body, 0.1, 150)
    assert -body.particles.x[-1, 1] - 1 == pytest.approx(m * G * n * (n + 1) / (2 * k), rel=1e-6)


def test_K03_stretch_of_a_hanging_sheet() -> None:
    """Each row of springs bears what hangs below it; the lowest row is half as heavy. Every column is the same."""
    n, density, stretch = 8, 0.3, 60.0
    body = pm.cloth(
        *(n + 1, 4, (0.6, 1.0)), density=density, stretch=stretch, shear=0.0, bend=0.0, damping_ratio=0.5,
        pinned="top edge",
    )  # fmt: skip
    top = body.particles.x[0, 1]
    settled(body, 0.1, 150)
    drop = top - body.particles.x.reshape(n + 1, 4, 3)[-1, :, 1] - 1
    below = density / n * (np.arange(n) + 0.5)  # kg for each metre of width
    np.testing.assert_allclose(drop, (below * G / (stretch * n)).sum(), rtol=1e-6)


@pytest.mark.parametrize("cells", [20, 40, pytest.param(80, marks=pytest.mark.full)])
def test_K04_sag_of_a_sheet_does_not_depend_on_its_cells(cells: int) -> None:
    """Between two edges it sags by (3 w L^4 / (64 K))^(1/3), a flat parabola that is stretched by its tension / K."""
    body = pm.cloth(cells, cells, 1.0, down=(0, 0, 1), damping_ratio=0.3, pinned="side edges")
    settled(body, 0.05, 30, compiled=True, tolerance=1e-6, cg_tolerance=1e-4)
    sag = (3 * 0.15 * G / (64 * 800.0)) ** (1 / 3)
    assert -body.particles.x[:, 1].min() == pytest.approx(sag, rel=0.01)


@pytest.mark.parametrize("damping_ratio", [0.02, 0.15])  # the least and the most of a material
def test_an_explicit_step_of_a_crumpled_cloth_is_stable(damping_ratio: float) -> None:
    """The steps of the shipped scenes hold when all springs of a particle pull in one line."""
    body = pm.cloth(8, 8, 1.0, damping_ratio=damping_ratio, shear=100.0, bend=1e-4)
    body.particles.x += np.random.default_rng(4).normal(0, 0.05, (64, 3))
    system = pm.ParticleSystem(body.particles, body.forces)
    solver, dt = steps(body)
    assert dt < largest_safe_step(solver, *(np.array([b]) for b in stiffest(body)))
    sim = pm.Simulation(system, solver, dt, compiled=False)
    energies = [system.energy().total]
    for _ in range(5):
        sim.step(100)
        energies.append(system.energy().total)
    assert (np.diff(energies) < 0).all()
    assert energies[-1] < 0.01 * energies[0]


def test_K05_implicit_steps_of_a_sixtieth_hold_pins_to_the_bit() -> None:
    """Stiff springs, k h^2 / m of 100 and more, as the sheet begins to fall from its corners."""
    cells, frames = 12, 8
    body = pm.cloth(cells, cells, 1.0, down=(0, 0, 1), material="denim", pinned="top corners")
    p = body.particles
    held = p.x[p.pinned].tobytes()
    assert 2000 / 60**2 / p.m.max() > 100
    system = pm.ParticleSystem(p, [pm.Gravity(), *body.forces])
    sim = pm.Simulation(system, pm.ImplicitEuler(tolerance=1e-6, cg_tolerance=1e-4), 1 / 60)
    sim.step(frames)
    assert np.isfinite(p.x).all()
    assert p.x[p.pinned].tobytes() == held
    assert system.stretch() < 0.2
    assert p.x[:, 1].min() == pytest.approx(-0.5 * G * (frames / 60) ** 2, rel=0.35)


@pytest.mark.parametrize(
    ("cells", "frames", "held_by", "compiled"),
    [(14, 90, "top corners", False), pytest.param(128, 600, "top edge", True, marks=pytest.mark.full)],
)
def test_stiff_cloth_falls_and_hangs_in_implicit_steps_of_a_sixtieth(
    cells: int, frames: int, held_by: str, compiled: bool
) -> None:
    """Folded and compressed on the way; at rest no edge is stretched by a tenth.

    A single point bears half the weight by two springs of half a cell: 2 N by 2 x 900 N/m, a tenth of a fine cell and
    more. So the fine sheet hangs by its edge.
    """
    body = pm.cloth(cells, cells, 1.0, down=(0, 0, 1), material="denim", pinned=held_by)
    p = body.particles
    held = p.x[p.pinned].tobytes()
    system = pm.ParticleSystem(p, [pm.Gravity(), *body.forces])
    energy = system.energy().total
    sim = pm.Simulation(system, pm.ImplicitEuler(tolerance=1e-3), 1 / 60, compiled=compiled)
    for _ in range(10):
        sim.step(frames // 10)
        assert system.energy().total < energy
        energy = system.energy().total
    assert np.isfinite(system.get_state()).all()
    assert p.x[p.pinned].tobytes() == held
    assert p.x[:, 1].min() < -0.9
    assert _longest(body) < 0.1


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4()], ids=lambda s: s.name)
@pytest.mark.parametrize(
    ("cells", "frames", "compiled"), [(6, 30, False), pytest.param(128, 600, True, marks=pytest.mark.full)]
)
def test_stiff_cloth_falls_and_hangs_in_the_explicit_steps_that_are_recommended(
    solver: pm.Solver, cells: int, frames: int, compiled: bool
) -> None:
    """Found where it lies flat, the step holds while it folds; at rest no edge is stretched by a tenth."""
    body = pm.cloth(cells, cells, 1.0, down=(0, 0, 1), material="denim", pinned="top edge")
    p = body.particles
    held = p.x[p.pinned].tobytes()
    system = pm.ParticleSystem(p, [pm.Gravity(), *body.forces])
    most = system.energy().total + 0.01 * p.m.sum() * G
    steps = math.ceil(1 / 60 / (0.95 * system.stability(solver).largest_safe_dt))
    sim = pm.Simulation(system, solver, 1 / 60 / steps, compiled=compiled)
    for _ in range(10):
        sim.step(frames // 10 * steps)
        assert system.energy().total < most
    assert p.x[p.pinned].tobytes() == held
    if frames == 600:
        assert p.x[:, 1].min() < -0.4
        assert _longest(body) < 0.1


def _longest(body: pm.Body) -> float:
    """Largest relative stretch of a spring between neighbours."""
    p, worst = body.particles, 0.0
    for springs in body.forces:
        if springs.family != "bend":
            rest = springs.settings(p, 0.0, np.arange(len(springs.ids)))["rest"][0]
            worst = max(worst, float((springs.values(p, p.x) / rest).max()) - 1)
    return worst
