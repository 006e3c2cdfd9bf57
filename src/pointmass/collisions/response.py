"""What an impact does to velocities."""

from __future__ import annotations

from typing import Any

import numpy as np

from pointmass.collisions.collider import Array, rows_dot


def respond(v: Array, normal: Array, surface: Array, restitution: float, friction: float) -> Array:
    """Velocity after an impact: V' = V_T - k_r V_N in the frame of the surface, with Coulomb friction on V_T.

    Friction takes at most mu (1 + k_r) |V_N| off the tangential speed and never turns it round (Bridson, Fedkiw &
    Anderson 2002). Rows that do not head into the surface (N . V >= 0) are left as they are.

    Parameters
    ----------
    v : velocities [m/s], shape (k, 3).
    normal : unit normals to the free side, shape (k, 3).
    surface : velocity of the surface [m/s], shape (3,) or (k, 3).
    """
    relative = v - surface
    toward = rows_dot(normal, relative)
    v_n = toward[:, None] * normal
    v_t = relative - v_n
    speed = np.sqrt(rows_dot(v_t, v_t))
    loss = np.minimum(friction * (1 + restitution) * np.abs(toward), speed)
    kept = 1 - loss / np.where(speed > 0, speed, 1)
    after = surface + (kept[:, None] * v_t - restitution * v_n)
    return np.where((toward < 0)[:, None], after, v).astype(v.dtype)


def respond_pair(
    x1: Array, v1: Array, m1: Any, x2: Array, v2: Array, m2: Any, restitution: float
) -> tuple[Array, Array]:
    """Velocities of two balls after they meet.

    The impulse along the line of centres is j = -(1 + e) v_rel . n / (1/m1 + 1/m2). Balls that part are left as they
    are. Arrays have shape (k, 3), masses are numbers or of shape (k,).
    """
    d = x1 - x2
    size = np.sqrt(rows_dot(d, d))[:, None]
    n = np.where(size > 0, d / np.where(size > 0, size, 1), np.array([0.0, 1.0, 0.0]))
    toward = np.minimum(rows_dot(v1 - v2, n), 0)
    impulse = (-(1 + restitution) * toward / (1 / m1 + 1 / m2))[:, None] * n
    return v1 + impulse / np.reshape(m1, (-1, 1)), v2 - impulse / np.reshape(m2, (-1, 1))
