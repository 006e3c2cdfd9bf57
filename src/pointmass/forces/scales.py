"""The ground under a body that crawls: it bears, and scales slide forwards more easily than backwards or sideways."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.laws.elements import ElementForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Scales(ElementForce):
    """f = N (n - mu_s (u . s) s / U - mu_t u_t / U) on both ends of a link that points headwards: n is up, and N =
    k_s max(d, 0) max(1 - damping v . n, 0) bears an end that is d deep.

    u is the velocity along the ground, s the direction of the link on it, u_t the rest of u, U = sqrt(u^2 + creep^2).
    mu_s is `forward` where u . s >= 0, else `backward`, and mu_t is `sideways`: Coulomb's friction with a coefficient
    for each direction (Hu, Nirody, Scott & Shelley, The mechanics of slithering locomotion, PNAS 106, 2009). Below
    `creep` it is viscous, so nothing sticks for ever. Where `backward` is large, this is the ratchet of Miller (The
    Motion Dynamics of Snakes and Worms, SIGGRAPH 1988), who takes away all that slides backwards.

    Parameters
    ----------
    links : ids of the front and the back end, shape (e, 2).
    level : height of the ground, at right angles to `y` [m].
    k_s : of the ground, for each link at an end [N/m], at least 0.
    damping : share of N that is lost for each m/s upwards and added for each m/s downwards [s/m], at least 0.
    forward, backward, sideways : coefficients of friction, at least 0.
    creep : [m/s], above 0; explicit steps must be shorter than about 2 m creep / (mu N).

    Notes
    -----
    Hu et al. measured 0.11, 0.14 and 0.20 on cloth, of snakes that were asleep; those that are awake dig in more.
    """

    nodes = 2
    internal = False

    def __init__(
        self,
        links: ArrayLike,
        level: Scalar = 0.0,
        k_s: Scalar = 100.0,
        damping: Scalar = 1.0,
        forward: Scalar = 0.1,
        backward: Scalar = 0.4,
        sideways: Scalar = 0.4,
        creep: Scalar = 0.01,
        *,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("level", level, unit="m"),
            Parameter("k_s", k_s, unit="N/m", at_least=0),
            Parameter("damping", damping, unit="s/m", at_least=0),
            Parameter("forward", forward, at_least=0),
            Parameter("backward", backward, at_least=0),
            Parameter("sideways", sideways, at_least=0),
            Parameter("creep", creep, unit="m/s", above=0),
        ]
        super().__init__(links, parameters, enabled)

    def law(self, x1: Any, v1: Any, x2: Any, v2: Any, t: Any, *parameters: Any) -> Any:
        """Forces on the front and the back end [N]."""
        level, k_s, damping, forward, backward, sideways, creep = parameters
        along = fn.sub(x1, x2)
        size = fn.inverse(fn.sqrt(along[0] * along[0] + along[2] * along[2]))
        s_x, s_z = along[0] * size, along[2] * size
        forces = []
        for x, v in ((x1, v1), (x2, v2)):
            bears = k_s * fn.maximum(level - x[1], 0.0) * fn.maximum(1.0 - damping * v[1], 0.0)
            drag = bears * fn.inverse(fn.sqrt(v[0] * v[0] + v[2] * v[2] + creep * creep))
            ahead = v[0] * s_x + v[2] * s_z
            mu = fn.where(ahead >= 0.0, forward, backward) - sideways
            forces.append(
                (-drag * (sideways * v[0] + mu * ahead * s_x), bears, -drag * (sideways * v[2] + mu * ahead * s_z))
            )
        return forces
