"""What every force in the registry must do, whatever its law. A new force needs an example here, and nothing else."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pointmass.collisions import Plane, Sphere
from pointmass.forces import FORCES, Vortex
from pointmass.laws.elements import ElementForce
from pointmass.laws.force import Blocks
from pointmass.laws.grid import Grid
from pointmass.laws.pairs import PairForce
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

sys.path.append(str(Path(__file__).parents[1]))
import naive

N = 6
TIME = 0.7
PAIRS = [(0, 1), (1, 2), (4, 2), (5, 0)]
JOINTS = [(0, 1, 2), (3, 2, 5)]
HINGES = [(0, 1, 2, 3), (4, 2, 5, 1)]
FOURS = [(0, 1, 2, 3), (5, 2, 4, 0)]
RNG = np.random.default_rng(42)
CELLS = RNG.standard_normal((2, 3, 4, 1, 3))
CELL_PLACE = {"origin": (-2.0, -3.0, 0.0), "spacing": 1.7, "times": (0.0, 1.0)}
WAVE = 0.25 * math.sin(2 * math.pi * TIME + 0.4)
CHANCE = [naive.hashed(i ^ naive.hashed(0)) // 256 / 2**24 for i in range(N)]
CHARGE, CIRCULATION = RNG.uniform(-1, 1, N), RNG.uniform(-2, 2, N)


@dataclass
class Example:
    """A force with the numbers that its parameters have at TIME, for the plain version."""

    arguments: dict[str, Any]
    numbers: Callable[[int], dict[str, Any]]
    law: Callable[..., Any]
    energy: Callable[..., Any] | None = None
    elements: list[tuple[int, ...]] | None = None
    pairs: bool = False
    crowd: bool = False  # a law of one among all others
    singular: bool = False  # not finite where particles meet, as its docstring says
    text: bool = True  # its arguments can stand in a scene file
    rough: bool = False  # the plain version tries many places, and not the nearest itself


def pulled(way: Callable[..., Any], strength: float, power: float, eps: float, **reach: float) -> dict[str, Any]:
    return {"way": way, "strength": strength, "power": power, "eps": eps, **reach}


def grid(outside: str) -> Grid:
    return Grid(CELLS, outside=outside, **CELL_PLACE)


def grid_value(outside: str) -> Callable[..., Any]:
    place = (CELL_PLACE["origin"], CELL_PLACE["spacing"], CELL_PLACE["times"])
    return lambda x, t: naive.interpolated(CELLS.tolist(), *place, outside, x, t)


def saw(x, v, m, t):
    return [x[0] if x[0] > 0 else -2 * x[1], abs(x[1]) ** 1.5 * math.exp(-t), math.log(2 + x[2] ** 2)]


EXAMPLES: dict[str, list[Example]] = {
    "gravity": [
        Example({}, lambda i: {"g": (0, -9.81, 0)}, naive.gravity, naive.gravity_energy),
        Example(
            {"g": ("sin(t)", "charge", 1.5)},
            lambda i: {"g": (math.sin(TIME), CHARGE[i], 1.5)},
            naive.gravity,
            naive.gravity_energy,
        ),
    ],
    "drag": [
        Example({"k": 0.3}, lambda i: {"k": 0.3}, naive.drag),
        Example({"k": "abs(charge) * t"}, lambda i: {"k": abs(CHARGE[i]) * TIME}, naive.drag),
        Example({"k": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]}, lambda i: {"k": (i + 1) / 10}, naive.drag),
    ],
    "quadratic_drag": [Example({"c": 0.4}, lambda i: {"c": 0.4}, naive.quadratic_drag)],
    "springs": [
        Example(
            {"pairs": PAIRS, "k_s": 3.0, "k_d": 0.7, "rest": [0.5, 1.0, 1.5, 0.0]},
            lambda e: {"k_s": 3.0, "k_d": 0.7, "rest": (0.5, 1.0, 1.5, 0.0)[e]},
            naive.spring,
            naive.spring_energy,
            elements=PAIRS,
        ),
        Example(
            {"pairs": PAIRS, "k_s": 5.0, "rest": "1 + 0.3*sin(4*t)"},
            lambda e: {"k_s": 5.0, "k_d": 0.0, "rest": 1 + 0.3 * math.sin(4 * TIME)},
            naive.spring,
            naive.spring_energy,
            elements=PAIRS,
        ),
    ],
    "muscles": [
        Example(
            {"pairs": PAIRS, "k_s": 3.0, "rest": 0.8, "offset": [0.1, 0.0, -0.2, 0.3], "amplitude": 0.25, "phase": 0.4},
            lambda e: {"k_s": 3.0, "k_d": 0.0, "rest": 0.8 * (1 + (0.1, 0.0, -0.2, 0.3)[e] + WAVE)},
            naive.spring,
            naive.spring_energy,
            elements=PAIRS,
        )
    ],
    "scales": [
        Example(
            {"links": PAIRS, "level": 0.2, "k_s": [3.0, 4.0, 5.0, 6.0], "damping": 0.3, "backward": 0.9, "creep": 0.1},
            lambda e: {
                **{"level": 0.2, "k_s": 3.0 + e, "damping": 0.3, "creep": 0.1},
                **{"forward": 0.1, "backward": 0.9, "sideways": 0.4},
            },
            naive.scales,
            elements=PAIRS,
        )
    ],
    "slender_drag": [
        Example(
            {"links": PAIRS, "along": 0.3, "across": "0.5 + t"},
            lambda e: {"along": 0.3, "across": 0.5 + TIME},
            naive.slender_drag,
            elements=PAIRS,
        )
    ],
    "angles": [
        Example(
            {"joints": JOINTS, "k_s": [2.0, 3.0], "k_d": 0.5, "rest": 0.4},
            lambda e: {"k_s": (2.0, 3.0)[e], "k_d": 0.5, "rest": 0.4},
            naive.angle,
            naive.angle_energy,
            elements=JOINTS,
        )
    ],
    "hinges": [
        Example(
            {"hinges": HINGES, "k_s": [2.0, 3.0], "k_d": 0.5, "rest": 0.4},
            lambda e: {"k_s": (2.0, 3.0)[e], "k_d": 0.5, "rest": 0.4},
            naive.hinge,
            naive.hinge_energy,
            elements=HINGES,
        )
    ],
    "volumes": [
        Example(
            {"tetrahedra": FOURS, "k_s": [2.0, 3.0], "k_d": 0.5, "rest": "0.1 - 0.3*t"},
            lambda e: {"k_s": (2.0, 3.0)[e], "k_d": 0.5, "rest": 0.1 - 0.3 * TIME},
            naive.volume,
            naive.volume_energy,
            elements=FOURS,
        )
    ],
    "bulk": [
        Example(
            {"tetrahedra": FOURS, "k_s": [2.0, 3.0], "k_d": 0.5, "rest": f"{rest} + 0.3*t"},
            lambda e, rest=rest: {"k_s": (2.0, 3.0)[e], "k_d": 0.5, "rest": rest + 0.3 * TIME},
            naive.bulk,
            naive.bulk_energy,
            elements=FOURS,
        )
        for rest in (0.1, 10.0)  # either side of a fifth of it
    ],
    "attractor": [
        Example(
            {"mu": 2.0, "center": (0.1, 0.2, -0.1)},
            lambda i: {"mu": 2.0, "center": (0.1, 0.2, -0.1), "eps": 0.0},
            naive.attractor,
            naive.attractor_energy,
            singular=True,
        ),
        Example(
            {"mu": "t", "center": lambda t: (t, t * t, 0.0), "eps": 0.3},
            lambda i: {"mu": TIME, "center": (TIME, TIME**2, 0.0), "eps": 0.3},
            naive.attractor,
            naive.attractor_energy,
            text=False,
        ),
    ],
    "plate_wind": [
        Example(
            {"triangles": JOINTS, "velocity": (3.0, "t", 1.0), "drag": [1.0, 1.5], "lift": "1 + t", "density": 1.3},
            lambda e: {"air": lambda x: (3, TIME, 1), "drag": (1, 1.5)[e], "lift": 1 + TIME, "density": 1.3},
            naive.plate_wind,
            elements=JOINTS,
        ),
        Example(
            {"triangles": JOINTS, "velocity": [Vortex(2.0, eps=0.1), (0, 1, 0)], "lift": 0.0},
            lambda e: {
                "air": lambda x: [
                    a + b
                    for a, b in zip(naive.vortex(x, 0, 0, 0, 2.0, (0, 0, 0), (0, 0, 1), 0.1), (0, 1, 0), strict=True)
                ],
                **{"drag": 1.2, "lift": 0.0, "density": 1.2},
            },
            naive.plate_wind,
            elements=JOINTS,
            text=False,
        ),
    ],
    "water": [
        Example(
            {"triangles": JOINTS, "drag": [2.0, 3.0], "velocity": (0.3, "t", -0.2)},
            lambda e: {"flow": lambda x: (0.3, TIME, -0.2), "drag": (2.0, 3.0)[e]},
            naive.water,
            elements=JOINTS,
        ),
        Example(
            {"triangles": JOINTS}, lambda e: {"flow": lambda x: (0, 0, 0), "drag": 1000.0}, naive.water, elements=JOINTS
        ),
    ],
    "fins": [
        Example(
            {
                "sections": FOURS,
                "angle": [1.0, 2.5],
                "area": 0.4,
                "drag": 3.0,
                "upright": 0.2,
                "velocity": (0.3, "t", 0.1),
            },
            lambda e: {
                "flow": lambda x: (0.3, TIME, 0.1),
                **{"angle": (1.0, 2.5)[e], "area": 0.4, "drag": 3.0, "upright": 0.2},
            },
            naive.fins,
            elements=FOURS,
        )
    ],
    "line_attractor": [
        Example(
            {"a": (0.1, 0.3, 0), "b": ("1 + t", 0, 0.5), "strength": 2.0, "power": 1.5, "eps": 0.2},
            lambda i: pulled(lambda x: [naive.to_line(x, (0.1, 0.3, 0), (1 + TIME, 0, 0.5))], 2.0, 1.5, 0.2),
            naive.pull,
            naive.pull_energy,
            rough=True,
        ),
        Example(
            {"strength": "charge", "reach": 1.2},
            lambda i: pulled(lambda x: [naive.to_line(x, (0, 0, 0), (0, 1, 0))], CHARGE[i], 1.0, 0.05, reach=1.2),
            naive.pull,
            rough=True,
        ),
    ],
    "ring_attractor": [
        Example(
            {"center": (0, "t", 0), "axis": (1, 2, 0), "radius": 0.8, "strength": -2.0, "power": 1.0, "eps": 0.3},
            lambda i: pulled(lambda x: [naive.to_ring(x, (0, TIME, 0), (1, 2, 0), 0.8)], -2.0, 1.0, 0.3),
            naive.pull,
            naive.pull_energy,
            rough=True,
        ),
        Example(
            {"radius": 0.0, "power": 2.0, "eps": 0.1},
            lambda i: pulled(lambda x: [x], 1.0, 2.0, 0.1),
            naive.pull,
            naive.pull_energy,
        ),
    ],
    "surface_attractor": [
        Example(
            {"around": [Sphere((0.2, 0, 0), 0.5), Plane(("0.1*t", -1, 0))], "power": -1.0, "strength": 3.0},
            lambda i: pulled(
                lambda x: [
                    naive.scale(1 - 0.5 / naive.norm(naive.sub(x, (0.2, 0, 0))), naive.sub(x, (0.2, 0, 0))),
                    (0, x[1] + 1, 0),
                ],
                3.0,
                -1.0,
                0.05,
            ),
            naive.pull,
            naive.pull_energy,
            text=False,
        ),
        Example(
            {"around": [Sphere(radius=1.0, inside=True)], "reach": "1 + t", "eps": 0.1},
            lambda i: pulled(lambda x: [naive.scale(1 - 1 / naive.norm(x), x)], 1.0, 0.0, 0.1, reach=1 + TIME),
            naive.pull,
            text=False,
        ),
    ],
    "cushion": [
        Example(
            {
                "around": [Sphere((0.2, 0, 0), 0.5), Plane(("0.1*t", -1, 0))],
                "k_s": 3.0,
                "thickness": "1 + 0.2*t",
                "damping": 0.7,
            },
            lambda i: {
                "solids": lambda x: [
                    (
                        naive.norm(naive.sub(x, (0.2, 0, 0))) - 0.5,
                        naive.scale(1 / naive.norm(naive.sub(x, (0.2, 0, 0))), naive.sub(x, (0.2, 0, 0))),
                    ),
                    (x[1] + 1, (0, 1, 0)),
                ],
                **{"k_s": 3.0, "thickness": 1 + 0.2 * TIME, "damping": 0.7},
            },
            naive.cushion,
            naive.cushion_energy,
            text=False,
        )
    ],
    "flocking": [
        Example(
            {"cutoff": 3.0, "field_of_view": 360.0, "separation": 2.0, "alignment": "1 + t"},
            lambda i: {
                **{"cutoff": 3.0, "near": 1.0, "separation": 2.0, "alignment": 1 + TIME, "cohesion": 1.0},
                "view": 360.0,
            },
            naive.flocking,
            crowd=True,
        ),
        Example(
            {"cutoff": 2.5, "separation_radius": 2.2, "separation": 9.0, "field_of_view": "200 + 10*t", "limit": 3.0},
            lambda i: {
                **{"cutoff": 2.5, "near": 2.2, "separation": 9.0, "alignment": 1.0, "cohesion": 1.0},
                **{"view": 200 + 10 * TIME, "limit": 3.0},
            },
            naive.flocking,
            crowd=True,
        ),
    ],
    "flee": [
        Example(
            {"by": [0, 3, 4], "strength": "1 + t", "cutoff": 4.0},
            lambda i: {"by": (0, 3, 4), "strength": 1 + TIME, "cutoff": 4.0, "view": 360.0},
            naive.flee,
            crowd=True,
        ),
        Example(
            {"by": [0, 1, 2, 3], "strength": -3.0, "cutoff": 3.0, "field_of_view": 190.0},
            lambda i: {"by": (0, 1, 2, 3), "strength": -3.0, "cutoff": 3.0, "view": 190.0},
            naive.flee,
            crowd=True,
        ),
    ],
    "seek": [
        Example(
            {"target": (0.1, "2*t", 0), "speed": 2.0, "rate": "1 + t", "arrival": 1.5},
            lambda i: {
                **{"target": (0.1, 2 * TIME, 0), "speed": 2.0, "rate": 1 + TIME, "arrival": 1.5, "limit": math.inf}
            },
            naive.seek,
        ),
        Example(
            {"speed": "abs(charge)", "arrival": 0.1, "limit": 0.8},
            lambda i: {
                **{"target": (0, 0, 0), "speed": abs(CHARGE[i]), "rate": 1.0, "arrival": 0.1, "limit": 0.8},
            },
            naive.seek,
        ),
    ],
    "avoid": [
        Example(
            {
                "around": [Sphere((0.2, 0, 0), 0.5), Plane(("0.1*t", -1, 0)), Sphere(radius=3.0, inside=True)],
                "strength": 3.0,
                "distance": "0.5 + t",
                "horizon": 0.4,
            },
            lambda i: {
                "solids": lambda x: [
                    (
                        naive.norm(naive.sub(x, (0.2, 0, 0))) - 0.5,
                        naive.scale(1 / naive.norm(naive.sub(x, (0.2, 0, 0))), naive.sub(x, (0.2, 0, 0))),
                    ),
                    (x[1] + 1, (0, 1, 0)),
                    (3 - naive.norm(x), naive.scale(-1 / naive.norm(x), x)),
                ],
                **{"strength": 3.0, "distance": 0.5 + TIME, "horizon": 0.4},
            },
            naive.avoid,
            text=False,
        )
    ],
    "cruise": [
        Example(
            {"speed": "1 + t", "rate": 0.7},
            lambda i: {"speed": 1 + TIME, "rate": 0.7, "limit": math.inf},
            naive.cruise,
        ),
        Example({"speed": 3.0, "limit": 1.5}, lambda i: {"speed": 3.0, "rate": 1.0, "limit": 1.5}, naive.cruise),
    ],
    "harmonic": [
        Example(
            {"k_s": 4.0, "center": ("cos(t)", 0, 1), "k_d": 0.2},
            lambda i: {"k_s": 4.0, "center": (math.cos(TIME), 0, 1), "k_d": 0.2},
            naive.harmonic,
            naive.harmonic_energy,
        )
    ],
    "gravitation": [
        Example(
            {"G": 0.7},
            lambda i: {"G": 0.7, "eps": 0.0},
            naive.gravitation,
            naive.gravitation_energy,
            pairs=True,
            singular=True,
        ),
        Example(
            {"G": "1 + t", "eps": 0.2},
            lambda i: {"G": 1 + TIME, "eps": 0.2},
            naive.gravitation,
            naive.gravitation_energy,
            pairs=True,
        ),
    ],
    "lennard_jones": [
        Example(
            {"epsilon": "1 + t", "sigma": 0.8},
            lambda i: {"epsilon": 1 + TIME, "sigma": 0.8, "cutoff": 2.0, "box": None},
            naive.lennard_jones,
            naive.lennard_jones_energy,
            pairs=True,
            singular=True,
        ),
        Example(
            {"sigma": "0.5 + 0.1*t", "cutoff": 1.2, "box": (2.5, 2.6, 3.0)},
            lambda i: {"epsilon": 1.0, "sigma": 0.5 + 0.1 * TIME, "cutoff": 1.2, "box": (2.5, 2.6, 3.0)},
            naive.lennard_jones,
            naive.lennard_jones_energy,
            pairs=True,
            singular=True,
        ),
    ],
    "soft_sphere": [
        Example(
            {"k_s": "10*t", "k_d": 0.4, "radius": "0.8 + 0.2*charge"},
            lambda i: {"k_s": 10 * TIME, "k_d": 0.4, "radius": 0.8 + 0.2 * CHARGE[i], "onset": 0.0, "box": None},
            naive.soft_sphere,
            naive.soft_sphere_energy,
            pairs=True,
        ),
        Example(
            {"k_d": 0.4, "radius": 0.9, "onset": 0.5},
            lambda i: {"k_s": 1000.0, "k_d": 0.4, "radius": 0.9, "onset": 0.5, "box": None},
            naive.soft_sphere,
            naive.soft_sphere_energy,
            pairs=True,
        ),
        Example(
            {"radius": 0.7, "box": (2.9, 2.8, 3.0)},
            lambda i: {"k_s": 1000.0, "k_d": 0.0, "radius": 0.7, "onset": 0.0, "box": (2.9, 2.8, 3.0)},
            naive.soft_sphere,
            naive.soft_sphere_energy,
            pairs=True,
        ),
    ],
    "vortex": [
        Example(
            {"circulation": 2.0, "axis": (1, 2, 2), "center": ("t", 0, 0), "eps": 0.1},
            lambda i: {"circulation": 2.0, "axis": (1, 2, 2), "center": (TIME, 0, 0), "eps": 0.1},
            naive.vortex,
        ),
        Example(
            {"circulation": "sin(t)", "eps": 0.0},
            lambda i: {"circulation": math.sin(TIME), "axis": (0, 0, 1), "center": (0, 0, 0), "eps": 0.0},
            naive.vortex,
        ),
    ],
    "point_vortices": [
        Example({"eps": 0.1}, lambda i: {"circulation": CIRCULATION[i], "eps": 0.1}, naive.point_vortices, pairs=True),
        Example(
            {"circulation": "circulation * t"},
            lambda i: {"circulation": CIRCULATION[i] * TIME, "eps": 0.0},
            naive.point_vortices,
            pairs=True,
        ),
    ],
    "vortex_line": [
        Example(
            {"a": ("t", -0.5, 0), "b": (1, 1, 0.5), "circulation": 2.0, "eps": 0.3},
            lambda i: {"a": (TIME, -0.5, 0), "b": (1, 1, 0.5), "circulation": 2.0, "eps": 0.3},
            naive.vortex_line,
        )
    ],
    "vortex_ring": [
        Example(
            {"center": (0, "t", 0), "axis": (1, 2, 0), "radius": 0.8, "circulation": 2.0, "eps": 0.3},
            lambda i: {"center": (0, TIME, 0), "axis": (1, 2, 0), "radius": 0.8, "circulation": 2.0, "eps": 0.3},
            naive.vortex_ring,
        )
    ],
    "gust": [
        Example(
            {"velocity": (3, 0.5, -1), "intensity": "0.2 + t", "length": 2.0, "lifetime": 0.8, "seed": 4},
            lambda i: {
                "function": lambda x, v, m, t: naive.gust(x, t, (3, 0.5, -1), 0.2 + TIME, 2.0, 0.8, 4),
            },
            naive.formula,
        )
    ],
    "flutter": [
        Example(
            {"strength": (0.5, "t", 2), "lifetime": 0.3, "seed": 5},
            lambda i: {
                "function": lambda x, v, m, t: naive.flutter(t, CHANCE[i], (0.5, TIME, 2), 0.3, 5),
            },
            naive.formula,
        )
    ],
    "diffusion": [
        Example(
            {"coefficient": "0.2 + t", "interval": 0.1, "seed": 6},
            lambda i: {
                "function": lambda x, v, m, t: [
                    math.sqrt(2 * (0.2 + t) / 0.1) * naive.draw(CHANCE[i], 7, 6, axis) for axis in range(3)
                ],
            },
            naive.formula,
        )
    ],
    "buoyancy": [
        Example(
            {"temperature": "300 + 100*charge", "ambient": 290.0, "density": 0.1, "up": (0, 2, 1)},
            lambda i: {
                "temperature": 300 + 100 * CHARGE[i],
                "ambient": 290.0,
                "beta": 9.81 / 293,
                "density": 0.1,
                "alpha": 9.81 / 1.2,
                "up": (0, 2, 1),
            },
            naive.buoyancy,
        )
    ],
    "curl_noise": [
        Example(
            {"length": 2.0, "speed": "1 + t", "rate": 0.4, "octaves": 2, "gain": 0.7, "seed": 9},
            lambda i: {"psi": naive.stream(2.0, 1 + TIME, 0.4, 2, 0.7, 9)},
            naive.curl,
        ),
        Example(
            {"length": 1.5, "rate": 0.0, "octaves": 1, "around": [Sphere((0.2, 0, 0), 0.5), Plane(("0.1*t", -1, 0))]},
            lambda i: {
                "psi": naive.stream(1.5, 1.0, None, 1, 0.5, 0),
                "solids": [
                    (
                        1.5,
                        lambda x, t: naive.dot(*2 * [naive.sub(x, (0.2, 0, 0))]) ** 0.5 - 0.5,
                        lambda x, t: naive.scale(
                            naive.dot(*2 * [naive.sub(x, (0.2, 0, 0))]) ** -0.5, naive.sub(x, (0.2, 0, 0))
                        ),
                    ),
                    (1.5, lambda x, t: x[1] + 1, lambda x, t: (0, 1, 0)),
                ],
            },
            naive.curl,
            text=False,
        ),
    ],
    "wind": [
        Example({"k": 0.3}, lambda i: {"k": 0.3, "air": lambda x, t: [3.0, 0.0, 0.0]}, naive.wind),
        Example(
            {"velocity": Vortex("1 + t", center=("t", 0, 0), eps=0.2), "k": "abs(charge)"},
            lambda i: {
                "k": abs(CHARGE[i]),
                "air": lambda x, t: naive.vortex(x, None, 1, t, 1 + t, (t, 0, 0), (0, 0, 1), 0.2),
            },
            naive.wind,
            text=False,
        ),
    ],
    "field": [
        Example(
            {"force": ("-k*x + charge*vy", "sin(t)*y", "m"), "constants": {"k": 2.0}},
            lambda i: {"function": lambda x, v, m, t: [-2 * x[0] + CHARGE[i] * v[1], math.sin(t) * x[1], m]},
            naive.formula,
        ),
        Example(
            {"force": ("x if x > 0 else -2*y", "abs(y)**1.5*exp(-t)", "log(2 + z**2)")},
            lambda i: {"function": saw},
            naive.formula,
        ),
        Example(
            {"potential": "0.5*k*(x**2 + y*z) + m*9.81*y", "constants": {"k": "1 + t"}},
            lambda i: {
                "function": lambda x, v, m, t: [
                    -(1 + t) * x[0],
                    -0.5 * (1 + t) * x[2] - 9.81 * m,
                    -0.5 * (1 + t) * x[1],
                ],
                "energy": lambda x, v, m, t: 0.5 * (1 + t) * (x[0] ** 2 + x[1] * x[2]) + m * 9.81 * x[1],
            },
            lambda x, v, m, t, function, energy: naive.formula(x, v, m, t, function),
            naive.formula_energy,
        ),
        Example(
            {"grid": grid("clamp"), "scale": "1 + t"},
            lambda i: {"function": lambda x, v, m, t: naive.scale(1 + t, grid_value("clamp")(x, t))},
            naive.formula,
            text=False,
        ),
    ],
    "flow": [
        Example(
            {"velocity": ("-W*y", "W*x", "charge"), "constants": {"W": 2.0}},
            lambda i: {"function": lambda x, v, m, t: [-2 * x[1], 2 * x[0], CHARGE[i]]},
            naive.formula,
        ),
        *(
            Example(
                {"grid": grid(outside)},
                lambda i, o=outside: {"function": lambda x, v, m, t: grid_value(o)(x, t)},
                naive.formula,
                text=False,
            )
            for outside in ("zero", "wrap")
        ),
    ],
    "magnetic": [
        Example({"B": (0.1, "t", 2.0)}, lambda i: {"B": (0.1, TIME, 2.0), "q": CHARGE[i]}, naive.magnetic),
    ],
}
CASES = [pytest.param(n, e, id=f"{n}-{k}") for n, examples in EXAMPLES.items() for k, e in enumerate(examples)]
every = pytest.mark.parametrize(("name", "example"), CASES)


def particles(dtype: Any = np.float64) -> Particles:
    rng = np.random.default_rng(7)
    x, v, m = rng.standard_normal((N, 3)), rng.standard_normal((N, 3)), rng.uniform(0.5, 2, N)
    return Particles(x, v, m, charge=CHARGE, circulation=CIRCULATION, dtype=dtype)


def make(name: str, example: Example, **more: Any) -> Any:
    return FORCES[name](**example.arguments, **more)


def evaluate(force: Any, p: Particles, x: Any = None, v: Any = None, t: float = TIME) -> Any:
    force.bind(p)
    f = np.zeros_like(p.x)
    force.add_forces(p, t, p.x if x is None else x, p.v if v is None else v, f)
    return f


def expected(example: Example, p: Particles) -> Any:
    state = SimpleNamespace(x=p.x.tolist(), v=p.v.tolist(), m=p.m.tolist(), t=TIME)
    if example.elements is not None:
        return np.array(naive.over_elements(example.law, example.elements, state, example.numbers))
    loop = naive.over_pairs if example.pairs else naive.over_crowd if example.crowd else naive.over_particles
    return np.array(loop(example.law, state, example.numbers))


def expected_energy(example: Example, p: Particles) -> float:
    x, v, m = p.x.tolist(), p.v.tolist(), p.m.tolist()
    numbers, law = example.numbers, example.energy
    if example.elements is not None:
        return sum(law([x[i] for i in nodes], **numbers(e)) for e, nodes in enumerate(example.elements))
    if example.pairs:
        return sum(law(x[i], m[i], numbers(i), x[j], m[j], numbers(j)) for i in range(N) for j in range(i))
    return sum(law(x[i], v[i], m[i], TIME, **numbers(i)) for i in range(N))


def test_every_force_of_the_registry_has_an_example():
    assert set(EXAMPLES) == set(FORCES)
    assert all(FORCES[name](**examples[0].arguments).name == name for name, examples in EXAMPLES.items())


@every
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_equals_the_plain_version(name, example, dtype, tolerance):
    p = particles(dtype)
    f = evaluate(make(name, example), p)
    want = expected(example, p)
    assert f.dtype == dtype
    np.testing.assert_allclose(f, want, rtol=0, atol=(1e-3 if example.rough else tolerance) * np.abs(want).max())


@every
def test_energy_equals_the_plain_version(name, example):
    p = particles()
    force = make(name, example)
    force.bind(p)
    energy = force.energy(p, TIME, p.x, p.v)
    if example.energy is None:
        assert energy is None
    else:
        assert energy == pytest.approx(expected_energy(example, p), rel=1e-6 if example.rough else 1e-12)


@every
def test_force_is_minus_the_gradient_of_its_energy(name, example):
    if example.energy is None:
        pytest.skip("it has no energy")
    p = particles()
    p.v[:] = 0
    force = make(name, example)
    f = evaluate(force, p)
    h = 1e-5
    slope = np.zeros_like(p.x)
    for i, axis in np.ndindex(*p.x.shape):
        up, down = p.x.copy(), p.x.copy()
        up[i, axis] += h
        down[i, axis] -= h
        slope[i, axis] = (force.energy(p, TIME, up, p.v) - force.energy(p, TIME, down, p.v)) / (2 * h)
    np.testing.assert_allclose(f, -slope, atol=1e-6 * max(1.0, np.abs(f).max()), rtol=0)


@every
def test_F04_jacobian_equals_finite_differences(name, example):
    p = particles()
    force = make(name, example)
    force.bind(p)
    blocks = Blocks()
    force.add_jacobian(p, TIME, p.x, p.v, blocks)
    h = 1e-6
    for exact, which in zip(blocks.matrices(N), "xv", strict=True):
        slope = np.zeros((3 * N, 3 * N))
        for column in range(3 * N):
            state = {"x": [p.x.copy(), p.x.copy()], "v": [p.v.copy(), p.v.copy()]}
            state[which][0].ravel()[column] += h
            state[which][1].ravel()[column] -= h
            up, down = (evaluate(force, p, state["x"][k], state["v"][k]) for k in (0, 1))
            slope[:, column] = (up - down).ravel() / (2 * h)
        np.testing.assert_allclose(exact.toarray(), slope, rtol=0, atol=1e-6 * max(1.0, np.abs(slope).max()))


@every
def test_adds_and_leaves_the_state_alone(name, example):
    p = particles()
    force = make(name, example)
    x, v, m = p.x.copy(), p.v.copy(), p.m.copy()
    alone = evaluate(force, p)
    f = np.full_like(p.x, 7.0)
    force.add_forces(p, TIME, p.x, p.v, f)
    np.testing.assert_allclose(f - 7.0, alone, rtol=0, atol=1e-13 * max(7.0, np.abs(alone).max()))
    assert (p.x == x).all()
    assert (p.v == v).all()
    assert (p.m == m).all()


@every
def test_the_same_bits_twice(name, example):
    p = particles()
    force, again = make(name, example), make(name, example)
    assert (evaluate(force, p) == evaluate(force, p)).all()
    assert (evaluate(force, p) == evaluate(again, p)).all()


@every
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_no_operation_leaves_the_precision(name, example, dtype):
    force = make(name, example)
    force.bind(particles(dtype))
    inputs = [np.linspace(0.1, 0.9, 5).astype(dtype) + k / 7 for k, _ in enumerate(force.traced.inputs)]
    inputs = [i.astype(dtype) for i in inputs]
    for output in force.traced.columns(*inputs):
        assert isinstance(output, float) or output.dtype == dtype


@every
def test_finite_where_particles_meet(name, example):
    p = particles()
    p.x[:] = 0.1, 0.2, -0.1
    p.v[:] = 0
    f = evaluate(make(name, example), p)
    assert np.isfinite(f).all() != example.singular
    if example.singular:
        assert "singular" in FORCES[name].__doc__


@every
def test_action_and_reaction(name, example):
    if not FORCES[name].internal:
        pytest.skip("it acts from outside")
    p = particles()
    f = evaluate(make(name, example), p)
    size = np.abs(f).sum()
    assert np.abs(f.sum(axis=0)).max() < 1e-12 * size
    if "box" not in example.arguments:  # a periodic box has no rotation to conserve
        assert np.abs(np.cross(p.x, f).sum(axis=0)).max() < 1e-12 * size


@every
def test_selections(name, example):
    p = particles()
    p.tag("some", [0, 2])
    if issubclass(FORCES[name], ElementForce):
        pytest.skip("its elements are its selection")
    forces = [evaluate(make(name, example, on=on), p) for on in ([0, 2], slice(0, 4, 2), p.groups["some"], "some")]
    assert all((f == forces[0]).all() for f in forces)
    assert (forces[0][[1, 3, 4, 5]] == 0).all()
    if not issubclass(FORCES[name], PairForce):
        np.testing.assert_array_equal(forces[0][[0, 2]], evaluate(make(name, example), p)[[0, 2]])
    assert (evaluate(make(name, example, on=[]), p) == 0).all()


@every
def test_switched_off(name, example):
    force = make(name, example)
    system = ParticleSystem(particles(), [force])
    on = system.deriv_eval(TIME)
    force.enabled = False
    off = system.deriv_eval(TIME)
    assert not (on == off).all()
    assert (off == (np.concatenate([system.particles.v.ravel(), np.zeros(3 * N)]) if force.order == 2 else 0)).all()
    assert ParticleSystem(particles(), [make(name, example, enabled=False)]).energy().potential == 0


@every
def test_clocks_of_their_own(name, example):
    p = particles()
    force = make(name, example)
    common = evaluate(force, p)
    own = np.zeros_like(p.x)
    force.add_forces(p, np.full(N, TIME), p.x, p.v, own)
    np.testing.assert_allclose(own, common, rtol=0, atol=1e-15 * np.abs(common).max())


@every
def test_without_particles_and_after_their_birth(name, example):
    if any(isinstance(a, list) for a in example.arguments.values()):
        pytest.skip("it names particles")
    empty = Particles(np.zeros((0, 3)), charge=0.0, circulation=0.0)
    system = ParticleSystem(empty, [make(name, example)])
    assert system.deriv_eval(TIME).shape == (0,)
    p = particles()
    system.add(p.x, p.v, m=p.m, charge=CHARGE, circulation=CIRCULATION)
    f = np.zeros((N, 3))
    system.forces[0].add_forces(system.particles, TIME, p.x, p.v, f)
    np.testing.assert_array_equal(f, evaluate(make(name, example), p))


def writable(value: Any) -> bool:
    if isinstance(value, dict):
        return all(isinstance(k, str) and writable(v) for k, v in value.items())
    if isinstance(value, (list, tuple)):
        return all(writable(v) for v in value)
    return isinstance(value, (bool, int, float, str))


@every
def test_made_again_from_its_arguments(name, example):
    p = particles()
    force = make(name, example)
    again = type(force)(**force.arguments)
    assert (evaluate(force, p) == evaluate(again, p)).all()
    assert writable(force.arguments) == example.text
