"""The problems of the solver tests, each with a solution that does not come from this library."""

from __future__ import annotations

import numpy as np

from pointmass.solvers import SOLVERS, EmbeddedRungeKutta, FunctionSystem

# theta'' = -sin theta from (1, 0), and with drag 0.7 from (1, 0.3), at t = 2 (DOP853 at 1e-13)
PENDULUM_AT_2 = np.array([-0.30620095759, -0.90904710500])
DRAGGED_AT_2 = np.array([0.29725480513, -0.60335609260])


def fixed(name):
    """The solver of a name, taking the steps it is given."""
    solver = SOLVERS[name]
    return solver(adaptive=False) if issubclass(solver, EmbeddedRungeKutta) else solver()


def pendulum(drag=0.0):
    return FunctionSystem(
        lambda t, y: [y[1], -np.sin(y[0]) - drag * y[1]],
        2,
        order=2,
        jacobian=lambda t, y: np.array([[0.0, 1.0], [-np.cos(y[0]), -drag]]),
        velocity_dependent=drag != 0.0,
    )


def forced():
    """x'' = -x + cos 2t; from (1, 0) x = (4 cos t - cos 2t)/3."""
    return FunctionSystem(
        lambda t, y: [y[1], -y[0] + np.cos(2.0 * t)],
        2,
        order=2,
        jacobian=lambda t, y: np.array([[0.0, 1.0], [-1.0, 0.0]]),
        velocity_dependent=False,
    )


FORCED_AT_2 = np.array([(4.0 * np.cos(2.0) - np.cos(4.0)) / 3.0, (-4.0 * np.sin(2.0) + 2.0 * np.sin(4.0)) / 3.0])


def oscillator(omega=1.0, zeta=0.0):
    return oscillators([omega], [zeta])


def oscillators(omega, zeta):
    """One island each: x'' = -omega^2 x - 2 zeta omega x'."""
    omega, zeta = np.asarray(omega, float), np.asarray(zeta, float)
    k = len(omega)
    block = np.block([[np.zeros((k, k)), np.eye(k)], [-np.diag(omega**2), -np.diag(2.0 * zeta * omega)]])
    return FunctionSystem(
        lambda t, y: np.concatenate([y[k:], -(omega**2) * y[:k] - 2.0 * zeta * omega * y[k:]]),
        2 * k,
        order=2,
        jacobian=lambda t, y: block,
        velocity_dependent=bool(zeta.any()),
        islands=np.tile(np.arange(k), 2),
    )


def driven(phase):
    """Pendulums with drag and a force that depends on time, one island each; t may be an array."""
    phase = np.asarray(phase, float)
    k = len(phase)

    def slope(t, y):
        clock = np.broadcast_to(t, (2 * k,))[k:]
        return np.concatenate([y[k:], -np.sin(y[:k]) - 0.3 * y[k:] + np.cos(2.0 * clock + phase)])

    return FunctionSystem(slope, 2 * k, order=2, islands=np.tile(np.arange(k), 2))


def kepler():
    """GM = 1; from (0.5, 0, 0, sqrt 3) an orbit of eccentricity 0.5 and period 2 pi."""

    def slope(t, y):
        return np.concatenate([y[2:], -y[:2] / np.sum(y[:2] ** 2) ** 1.5])

    return FunctionSystem(slope, 4, order=2, velocity_dependent=False)


def run(system, solver, y, h, steps):
    """The states of a run with a constant step, shape (steps + 1, dim)."""
    memory = solver.start(system)
    states = [np.asarray(y, float)]
    for k in range(steps):
        step = solver.step(system, k * h, states[-1], h, memory)
        memory = step.memory
        states.append(step.y1)
    return np.array(states)


def energy(y, omega=1.0):
    return y[..., 1] ** 2 + omega**2 * y[..., 0] ** 2
