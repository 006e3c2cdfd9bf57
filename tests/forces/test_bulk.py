"""Tetrahedra of a solid: as soft as springs on volumes near rest, much stiffer squeezed, driven back inside out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pointmass as pm

CORNER = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)  # its volume is 1/6
REST = 1 / 6


def tension(force: Any, part: float) -> float:
    """How strongly a tetrahedron, squeezed along z to a part of its volume, pulls at its top, over dV/dz."""
    p = pm.Particles(CORNER * (1, 1, part))
    force.bind(p)
    f = np.zeros((4, 3))
    force.add_forces(p, 0.0, p.x, p.v, f)
    return float(-f[3, 2] * 6)  # dV/dz of the top is the area of the base over 3


def test_near_rest_it_is_a_spring_on_the_volume() -> None:
    h = 1e-5
    linear, bulk = (cls([(0, 1, 2, 3)], 6.0, 0.0, REST) for cls in (pm.Volumes, pm.Bulk))
    assert tension(bulk, 1.0) == 0.0
    assert (tension(bulk, 1 + h) - tension(bulk, 1 - h)) / (2 * h) == pytest.approx(1.0, rel=1e-8)
    assert tension(bulk, 1 + h) == pytest.approx(tension(linear, 1 + h), rel=3 * h)


def test_the_flatter_the_stiffer_down_to_a_fifth_and_smooth_everywhere() -> None:
    bulk = pm.Bulk([(0, 1, 2, 3)], 6.0, 0.0, REST)
    h = 1e-6

    def slope(part: float) -> float:
        return (tension(bulk, part + h) - tension(bulk, part - h)) / (2 * h)

    assert slope(0.5) == pytest.approx(12.25, rel=1e-6)
    for part in (0.2 + 2 * h, 0.2 - 2 * h, 0.0, -3.0):
        assert slope(part) == pytest.approx(469.0, rel=1e-4)
    assert tension(bulk, 0.0) == pytest.approx(-31.2 - 469 * 0.2)  # flat, it still pushes


def test_what_it_takes_to_make_one_flat() -> None:
    """18.5 k_s rest^2, as its docstring says; a spring on the volume takes 0.5."""
    bulk = pm.Bulk([(0, 1, 2, 3)], 6.0, 0.0, REST)
    p = pm.Particles(CORNER * (1, 1, 0))
    assert pm.ParticleSystem(p, [bulk]).energy().potential == pytest.approx(18.5 * 6 * REST**2)


def test_inside_out_it_turns_back() -> None:
    p = pm.Particles(CORNER * (1, 1, -0.5))
    bulk = pm.Bulk([(0, 1, 2, 3)], 6.0, 0.3, REST)
    pm.Simulation(pm.ParticleSystem(p, [bulk]), pm.ImplicitEuler(), 0.05, compiled=False).run(0.5)
    assert bulk.values(p, p.x)[0] > 0.8 * REST


def test_xpbd_has_the_law_in_short_steps() -> None:
    """A tetrahedron squeezed to 0.3 bursts as it does with a solver of high order."""
    ends = []
    for solver, dt in ((pm.RK4(), 1e-3), (pm.XPBD(), 2.5e-4)):
        p = pm.Particles(CORNER * (1, 1, 0.3))
        pm.Simulation(pm.ParticleSystem(p, [pm.Bulk([(0, 1, 2, 3)], 6.0, 0.0, REST)]), solver, dt, compiled=False).run(
            0.25
        )
        ends.append(p.x)
    moved = np.abs(ends[0] - CORNER * (1, 1, 0.3)).max()
    np.testing.assert_allclose(ends[1], ends[0], atol=0.02 * moved)


def test_the_lens_knows_how_stiff_a_squeezed_one_is() -> None:
    """Half of its volume makes it 12 times as stiff; a spring on the volume stays as it is."""
    fast = []
    for cls in (pm.Volumes, pm.Bulk):
        p = pm.Particles(CORNER * (1, 1, 0.5))
        system = pm.ParticleSystem(p, [cls([(0, 1, 2, 3)], 6.0, 0.0, REST)])
        fast.append(max(float(table.frequency.max()) for table in system.stability(pm.RK4()).elements))
    assert fast[1] > 2 * fast[0]


def test_a_rest_of_nothing_is_refused() -> None:
    with pytest.raises(pm.InvalidInput, match="rest = 0"):
        pm.Bulk([(0, 1, 2, 3)], rest=0.0)
