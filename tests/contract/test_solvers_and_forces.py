"""Every solver under every family of forces, against a solution that is far more exact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.solvers import SOLVERS

FIXED = {"bs32": {"adaptive": False}, "dopri5": {"adaptive": False}}
END, DT = 0.5, 1 / 128


@pm.unary_force
def swirl(x: Any, v: Any, m: Any, t: Any, strength: Any = 0.7) -> Any:
    """A law of a user's own, of x, v and t."""
    return -strength * x[1] - 0.1 * v[0], strength * x[0] * pm.cos(t), 0.2 * pm.sin(3 * t)


@pm.spring_force
def rubber(x1: Any, v1: Any, x2: Any, v2: Any, t: Any, k: Any = 3.0) -> Any:
    """A law of a user's own between two particles."""
    d = pm.sub(x1, x2)
    return pm.scale(-k * pm.dot(d, d), d)


def cloud() -> pm.Particles:
    rng = np.random.default_rng(7)
    particles = pm.Particles(rng.uniform(-1, 1, (5, 3)), rng.uniform(-1, 1, (5, 3)), rng.uniform(0.5, 2, 5), charge=1.5)
    particles.pin([4])
    return particles


SECOND_ORDER = {
    "unary": lambda: [pm.Gravity(), pm.Drag("0.3*charge"), pm.Magnetic((0.1, 0.2, 1.0)), pm.Harmonic(2.0)],
    "field": lambda: [pm.Field(("-k*x", "sin(t)*y", "-z**3"), constants={"k": 2.0})],
    "elements": lambda: [pm.Springs([(0, 1), (1, 2), (2, 4)], 20.0, 0.5), pm.Angles([(0, 1, 2)], 2.0, 0.1, rest=0.5)],
    "pairs": lambda: [pm.Gravitation(G=0.5, eps=0.4)],
    "own laws": lambda: [swirl(strength=1.1), rubber(pairs=[(0, 1), (3, 4)])],
    "numpy": lambda: [pm.array_force(lambda x, v, m, t: -x * np.reshape(m, (-1, 1)) - 0.1 * v)],
}
FIRST_ORDER = {
    "flow": lambda: [pm.Flow(("-y", "x + 0.2*sin(t)", "0"))],
    "vortices": lambda: [pm.Vortex(2.0, eps=0.3), pm.PointVortices(1.0, eps=0.3)],
}


def exact(system: pm.ParticleSystem) -> np.ndarray:
    solution = solve_ivp(system.deriv_eval, (0, END), system.get_state(), rtol=1e-11, atol=1e-12, method="DOP853")
    return solution.y[:, -1]


def error_of(solver: str, forces: Any, dt: float) -> float:
    system = pm.ParticleSystem(cloud(), forces())
    sim = pm.Simulation(system, SOLVERS[solver](**FIXED.get(solver, {})), dt)
    reference = exact(system)
    sim.step(round(END / dt))
    return float(np.linalg.norm(system.get_state() - reference))


@pytest.mark.parametrize("family", SECOND_ORDER)
@pytest.mark.parametrize("solver", SOLVERS)
def test_solver_under_force_family(solver: str, family: str) -> None:
    """Two steps a factor 2 apart: the error falls at least as 2^(order - 0.5), or is at round-off."""
    coarse, fine = (error_of(solver, SECOND_ORDER[family], dt) for dt in (2 * DT, DT))
    order = SOLVERS[solver].order
    assert fine < 0.3 * DT**order * 60**order + 1e-9
    assert fine < max(coarse / 2 ** (order - 0.5), 1e-9)


@pytest.mark.parametrize("family", FIRST_ORDER)
@pytest.mark.parametrize("solver", SOLVERS)
def test_solver_under_flow(solver: str, family: str) -> None:
    if solver in ("symplectic_euler", "leapfrog", "yoshida4", "xpbd"):
        with pytest.raises(InvalidInput, match=solver):
            error_of(solver, FIRST_ORDER[family], DT)
        return
    coarse, fine = (error_of(solver, FIRST_ORDER[family], dt) for dt in (2 * DT, DT))
    assert fine < max(coarse / 2 ** (SOLVERS[solver].order - 0.5), 1e-9)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_dtype_is_kept(solver: str, dtype: str) -> None:
    particles = pm.Particles([[0, 0, 0], [1, 0, 0]], dtype=dtype)
    system = pm.ParticleSystem(particles, [pm.Gravity(), pm.Springs([(0, 1)], 10.0, 0.1)], [pm.Plane((0, -0.1, 0))])
    sim = pm.Simulation(system, SOLVERS[solver](), 1 / 60)
    sim.step(30)
    assert system.particles.x.dtype == system.particles.v.dtype == np.dtype(dtype)
    assert system.deriv_eval(0.0, system.get_state()).dtype == np.dtype(dtype)
    assert np.isfinite(system.particles.x).all()
