"""A school of fish in open water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass import random
from pointmass.bodies import fish
from pointmass.bodies.fish import NODES
from pointmass.controllers import FishBrain
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.fish import DRAG, SUBSTEPS
from pointmass.solvers import SymplecticEuler

LENGTH = 0.2  # of a fish [m]
BIG = 0.5  # of a predator
SETTLED = 6.0  # after which a school has its spacing [s]
SLOW = 0.45  # of a predator, which is longer, so that a chase is open


@dataclass(frozen=True, kw_only=True)
class School(ShippedScene):
    """A school of artificial fish: each keeps near its neighbours and out of their way."""

    name = "school"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "predator": {"fish": 120, "predators": 1},
        "loose": {"spacing": 1.6, "sight": 1.6},
        "few": {"fish": 24},
    }

    fish: int = knob(200, "how many", low=2, high=10000)
    predators: int = knob(0, "that hunt them", low=0, high=10)
    spacing: float = knob(1.0, "between neighbours, in lengths of a fish", low=0.6, high=3)
    sight: float = knob(1.0, "how far they see", unit="m", low=0.4, high=10)
    frequency: float = knob(2.5, "of the beat at full speed", unit="1/s", low=1, high=4)
    seed: int = knob(1, "another one gives another school", low=0, high=1000000)

    @property
    def side(self) -> float:
        """Edge of the space in which the school begins [m]."""
        return float(1.1 * self.spacing * LENGTH * max(self.fish, 8) ** (1 / 3))

    def build(self) -> Scene:
        """Fish at random that look about the same way, and predators farther away."""
        side, far = self.side, 1.2 * self.side + 1.0
        places, ways = _school(self.fish, side, self.seed)
        bodies = [fish(self.fish, places, ways, length=LENGTH, drag=DRAG * LENGTH, detail=1 if self.fish <= 400 else 0)]
        names, kinds, vigour = ["school"], ["prey"], [1.0]
        looks = {"school": Look(color="#dfe9ee", pattern="bands", pattern_color="#3c6f9c", pattern_count=2)}
        if self.predators:
            angle = 2 * np.pi * np.arange(self.predators) / self.predators
            around = np.stack([far * np.cos(angle), 0.1 * far * np.sin(3 * angle), far * np.sin(angle)], axis=1)
            bodies.append(fish(self.predators, around, -around * (1, 0, 1), length=BIG, drag=DRAG * BIG, detail=2))
            names, kinds, vigour = [*names, "hunters"], [*kinds, "predator"], [*vigour, SLOW]
            looks["hunters"] = Look(color="#c9c6bd", pattern="bands", pattern_color="#4a4f57", pattern_count=2)
        brain = FishBrain(
            names,
            kinds,
            schools="always",
            sight=self.sight,
            home=(0.0, 0.0, 0.0, 1.5 * side + 0.5),
            spacing=self.spacing,
            frequency=self.frequency,
            vigour=vigour,
        )
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / SUBSTEPS,
            frames=900,
            seed=self.seed,
            solver=SymplecticEuler(),
            bodies=bodies,
            names=names,
            controllers=[brain],
            camera=Camera(position=(0.4 * side, 0.5 * side, 2.6 * side), target=(0.2 * side, 0.0, 0.0), fov=38.0),
            look=Look(groups=looks),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Neighbours are about as far apart as they should be, and without predators nobody is lost."""
        last = frames[-1]
        x = last.positions[: NODES * self.fish].reshape(self.fish, NODES, 3)
        wide = float(np.ptp(x, axis=1).max())
        expect(wide < 1.5 * LENGTH, f"a fish of {LENGTH} m is {wide:.3g} m across")
        far = float(np.linalg.norm(x.mean(axis=(0, 1))))
        most = 3.0 * self.side + 2.0
        expect(far < most, f"the school is {far:.3g} m from where it began, and should stay within {most:.3g} m")
        if last.time < SETTLED or self.predators or self.fish < 8:
            return
        from scipy.sparse.csgraph import connected_components  # on first use: they take a while
        from scipy.spatial import cKDTree

        middle = x.mean(axis=1)
        tree = cKDTree(middle)
        near = float(np.median(np.asarray(tree.query(middle, k=2)[0])[:, 1])) / (self.spacing * LENGTH)
        expect(0.6 < near < 1.5, f"the nearest neighbour is {near:.2f} spacings away in the median, and not about 1")
        links = tree.sparse_distance_matrix(tree, min(self.sight, 4 * self.spacing * LENGTH))
        largest = int(np.bincount(connected_components(links)[1]).max())
        expect(largest > 0.9 * self.fish, f"only {largest} of {self.fish} fish are still together")


def _school(count: int, side: float, seed: int) -> tuple[Any, Any]:
    """Places in a flat box, one to a cell of a grid, and directions about x."""
    ids = np.arange(count)
    n = int(np.ceil(count ** (1 / 3)))
    cells = np.stack([ids % n, ids // n % n, ids // n**2], axis=1)
    stray = np.stack([random.uniform(seed, "school", ids, axis)[:, 0] for axis in "xyz"], axis=1) - 0.5
    way = 0.5 * random.direction(seed, "school", ids, "way") * (1.0, 0.3, 1.0) + (1.0, 0.0, 0.0)
    return side * ((cells + 0.5 + 0.4 * stray) / n - 0.5), way
