"""Limits of strain (check K04 and what follows from the rule of Provot)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.sheet import sheet

H = 1e-3


def hanging(side: int, *constraints: pm.Constraint, compiled: bool = False, dtype: Any = np.float64) -> pm.Simulation:
    """A square metre of 0.15 kg that lies, held by two corners, with springs of 10 N/m."""
    grid = sheet(side, side, 1.0)
    particles = pm.Particles(grid.places((0, 0, 0), (1, 0, 0), (0, 0, 1)), m=0.15 / side**2, dtype=dtype)
    particles.pin([0, side - 1])
    steps = {"stretch": [(0, 1), (1, 0)], "shear": [(1, 1), (1, -1)], "bend": [(0, 2), (2, 0)]}
    springs = [
        pm.Springs(np.concatenate([grid.pairs(*way) for way in ways]), 10.0, family=name)
        for name, ways in steps.items()
    ]
    system = pm.ParticleSystem(particles, [pm.Gravity(), *springs])
    return pm.Simulation(system, "symplectic_euler", H, constraints=constraints, compiled=compiled)


def strains(sim: pm.Simulation) -> np.ndarray:
    """Of structural and shear springs."""
    p = sim.system.particles
    found = []
    for force in sim.system.forces[1:3]:
        ends = p.x[force.rows(p)].astype(np.float64)
        length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        found.append(length / force.parameters["rest"].components[0].value - 1)
    return np.concatenate(found)


def test_K04_no_spring_is_stretched_by_more_than_its_limit() -> None:
    """A tenth, but for what 20 sweeps leave; the same sheet without a limit is stretched by more than 30%."""
    limited = hanging(10, pm.StrainLimit(0.1, ("stretch", "shear"), sweeps=20))
    worst = 0.0
    for _ in range(300):
        limited.step(10)
        worst = max(worst, strains(limited).max())
    assert 0.09 < worst <= 0.105
    free, most = hanging(10), 0.0
    for _ in range(60):
        free.step(10)
        most = max(most, strains(free).max())
    assert most > 0.3


def test_no_energy_comes_from_a_limit() -> None:
    sim = hanging(8, pm.StrainLimit(0.05))
    before = sim.system.energy().total
    for _ in range(20):
        sim.step(50)
        assert sim.system.energy().total < before + 1e-9


def pulled_apart(**options: Any) -> pm.Simulation:
    """Two masses of 1 kg and 3 kg on a spring of 1 m, which fly apart."""
    p = pm.Particles([[0, 0, 0], [1, 0, 0]], [[-3, 1, 0], [2, 1, 0]], m=[1, 3])
    system = pm.ParticleSystem(p, [pm.Springs([(0, 1)], 1.0, rest=1.0)])
    return pm.Simulation(system, "symplectic_euler", 0.1, constraints=[pm.StrainLimit(**options)], compiled=False)


def test_both_ends_move_by_their_weights_and_momentum_stays() -> None:
    sim = pulled_apart(limit=0.2)
    p = sim.system.particles
    momentum, middle = sim.system.momentum(), p.m @ p.x / 4
    sim.step()
    assert np.linalg.norm(p.x[1] - p.x[0]) == pytest.approx(1.2, rel=1e-12)
    np.testing.assert_allclose(sim.system.momentum(), momentum, atol=1e-12)
    np.testing.assert_allclose(p.m @ p.x / 4, middle + 0.1 * momentum / 4, atol=1e-12)
    np.testing.assert_allclose(p.v[1, 0] - p.v[0, 0], 0.2 / 0.1, rtol=1e-12)  # as they have come apart


def test_a_pinned_end_keeps_its_bits_and_the_other_goes_all_the_way() -> None:
    sim = pulled_apart(limit=0.0)
    p = sim.system.particles
    p.pin([0])
    held = p.x[0].tobytes()
    sim.step()
    assert p.x[0].tobytes() == held
    assert np.linalg.norm(p.x[1] - p.x[0]) == pytest.approx(1.0, rel=1e-12)


def test_a_limit_of_compression_lengthens() -> None:
    for compression, length in ((0.1, 0.9), (None, 0.5)):
        sim = pulled_apart(limit=0.2, compression=compression)
        sim.system.particles.v[:] = [[5, 0, 0], [0, 0, 0]]
        sim.step()
        x = sim.system.particles.x
        assert np.linalg.norm(x[1] - x[0]) == pytest.approx(length, rel=1e-12)


def test_it_follows_muscles_and_springs_that_go() -> None:
    p = pm.Particles([[0, 0, 0], [2, 0, 0], [5, 0, 0]])
    p.pin([0])
    system = pm.ParticleSystem(p, [pm.Springs([(0, 1), (1, 2)], 0.0, rest="1 - 0.5*t")])
    sim = pm.Simulation(system, dt=0.5, constraints=[pm.StrainLimit(0.0, sweeps=200)], compiled=False)
    sim.step()
    np.testing.assert_allclose(p.x[:, 0], [0, 0.75, 1.5], atol=1e-6)
    system.remove([2])
    p.v[:] = 0
    sim.step()
    np.testing.assert_allclose(p.x[:, 0], [0, 0.5], atol=1e-12)
    system.remove([1])
    sim.step()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_both_paths_have_the_same_bits(dtype: str) -> None:
    ends = []
    for compiled in (False, True):
        sim = hanging(6, pm.StrainLimit(0.02, "stretch"), compiled=compiled, dtype=dtype)
        sim.step(100)
        assert sim.system.particles.x.dtype == dtype
        ends.append(sim.system.particles.x)
    if dtype == "float64":
        assert ends[0].tobytes() == ends[1].tobytes()
    np.testing.assert_allclose(*ends, atol=1e-4)


def test_in_a_scene_file_and_back() -> None:
    limit = pm.StrainLimit(0.02, ["stretch", "shear"], compression=0.5, sweeps=7)
    scene = pm.Scene(bodies=[pm.cloth(3, 3)], constraints=[limit])
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.simulation().constraints[0].families == ("stretch", "shear")
    assert pm.Scene.from_toml(scene.to_toml(), {"constraints.0.families": "bend"}).constraints[0].families == ("bend",)


def without_springs() -> pm.Simulation:
    return pm.Simulation(pm.ParticleSystem(pm.Particles([[0, 0, 0]])), constraints=[pm.StrainLimit()])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.StrainLimit(-0.1), "limit = -0.1 is not allowed"),
        (lambda: pm.StrainLimit(0.1, compression=1.5), "compression = 1.5 is not allowed"),
        (lambda: pm.StrainLimit(0.1, sweeps=0), "sweeps = 0 is not allowed"),
        (lambda: pm.StrainLimit(0.1, families=3), "families = 3 is not allowed"),
        (lambda: hanging(3, pm.StrainLimit(0.1, "strech")), "unknown family of springs 'strech': did you mean"),
        (without_springs, "no springs that a constraint could be about"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make: Any, says: str) -> None:
    with pytest.raises(pm.InvalidInput, match=says):
        make()
