"""Snow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies import scatter
from pointmass.collisions import HeightField, Mesh
from pointmass.emitters import BoxEmitter
from pointmass.forces import Flutter, Gravity, Gust, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.models import Model, fir, house, moved, of_file, together, turned
from pointmass.solvers import SymplecticEuler
from pointmass.tracing.noise import noise
from pointmass.zones import HalfSpaceZone

SIZE = (13.0, 8.0)  # of the ground, along x and z [m]
CELLS = (52, 32)  # of its height field
HILL = 3.2  # size of a hill [m]
DEPTH = 0.5  # of the ground below its lowest point [m]
AIR = 2.6  # thickness of the air above the top of all, in which flakes begin [m]
FLAKE = 1e-5  # mass of a flake [kg]
GRAVITY = 9.81  # [m/s^2]
FIRS = (  # where they stand along x and z [m], and how tall they are, relative to the tallest
    *((1.3, -0.6, 1.0), (2.5, -1.7, 0.8), (2.3, 0.7, 0.55), (-2.9, -1.8, 0.9)),
    *((-3.3, 0.3, 0.6), (0.2, -2.6, 0.75), (4.2, -2.6, 0.95), (-4.9, -2.7, 0.8)),
)
HOUSE = (-1.0, -0.9, 0.62)  # likewise
LOOKED_AT = 2000  # flakes of which the check asks how far from the surfaces they are
ROUNDING = 1e-3  # of the place of a flake that lies [m]
Rows = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Snow(ShippedScene):
    """Flakes flutter down in a gusty wind onto hills, firs and a house, stay lying where it is not too steep."""

    name = "snow"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "calm": {"wind": 0.05, "gusts": 0.2, "flutter": 0.15, "rate": 4000.0},
        "blizzard": {"wind": 4.0, "gusts": 0.5, "rate": 9000.0, "flutter": 0.8},
        "hail": {"fall": 6.0, "flutter": 0.02, "wind": 0.3, "size": 0.008, "friction": 0.5},
        "powder": {"friction": 0.5, "hills": 0.3, "wind": 0.2, "flutter": 0.2},
    }

    rate: float = knob(6000.0, "flakes that begin to fall in a second", unit="1/s", low=1, high=1e6)
    fall: float = knob(1.1, "speed at which a flake falls in still air", unit="m/s", low=0.05, high=100)
    size: float = knob(0.016, "mean radius at which a flake is drawn", unit="m", low=1e-4, high=1)
    flutter: float = knob(0.35, "of a flake, standard deviation of its own speed", unit="m/s", low=0, high=10)
    wind: float = knob(0.5, "mean of the wind, along x", unit="m/s", low=-50, high=50)
    gusts: float = knob(0.4, "standard deviation of the wind, relative to its mean", low=0, high=2)
    gust_length: float = knob(3.0, "size of a gust", unit="m", low=0.1, high=1000)
    hills: float = knob(0.2, "height of the hills, root mean square", unit="m", low=0, high=2)
    model: str = knob("", "file of a mesh that stands on the hills instead of the house and the firs")
    tall: float = knob(1.9, "height of the tallest fir, or of the mesh", unit="m", low=0.1, high=10)
    friction: float = knob(2.5, "of snow, which clings; where tan(angle) is greater, it slides off", low=0, high=10)
    seed: int = knob(1, "another one gives other flakes, gusts and hills", low=0, high=2**31)

    def ground(self) -> HeightField:
        """The hills."""
        x, z = np.meshgrid(
            *(np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(SIZE, CELLS, strict=True)), indexing="ij"
        )
        return HeightField(self._height(x, z), SIZE, depth=DEPTH, **self._surface)

    def standing(self) -> Mesh:
        """What stands on the hills: a house and firs, or the mesh of a file, with its middle at x = z = 0."""
        if self.model:
            return of_file("model", self.model, self.tall, float(self._height(0.0, 0.0)), **self._surface)
        return Mesh(self._village(), **self._surface)

    @property
    def _surface(self) -> dict[str, Any]:
        return {"restitution": 0.0, "friction": self.friction}

    def _height(self, x: Any, z: Any) -> NDArray[np.float64]:
        """Of the hills [m]."""
        return np.asarray(np.round(self.hills * noise(x / HILL, 0.0, z / HILL, seed=self.seed), 4))

    def _village(self) -> Model:
        """Each stands as deep in the ground as the hills are high."""
        root = 0.4 * self.tall
        models = [(turned(house(HOUSE[2] * self.tall, root), 0.5), HOUSE)]
        models += [(turned(fir(part * self.tall, root), 7 * x), (x, z, part)) for x, z, part in FIRS]
        return together(*(moved(m, (x, float(self._height(x, z)), z)) for m, (x, z, _) in models))

    def _top(self, ground: HeightField, standing: Mesh) -> float:
        """The highest point of all [m]."""
        tallest = float((standing.triangles.vertices + standing.at(0.0))[:, 1].max())
        return max(float(ground.heights.max()), tallest)

    def build(self) -> Scene:
        """At the start flakes are in the air above the top of all; from then on they come from there and from where
        the wind does."""
        ground, standing = self.ground(), self.standing()
        low = float(ground.heights.min())
        top = self._top(ground, standing)
        k = FLAKE * GRAVITY / self.fall
        gust = Gust((self.wind, 0.0, 0.15 * self.wind), self.gusts, self.gust_length, seed=self.seed)
        flutter = Flutter((self.flutter, 0.3 * self.flutter, self.flutter), 0.5, seed=self.seed)
        drift = self.wind * (top + AIR - low) / self.fall
        count = max(1, round(self.rate * AIR / self.fall))
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / math.ceil(GRAVITY / self.fall / 60),  # at most as long as the air needs to stop a flake
            frames=480,
            dtype="float32",
            seed=self.seed,
            solver=SymplecticEuler(),
            bodies=[
                scatter(count, (0.0, top + 0.5 * AIR + 0.01, 0.0), (SIZE[0], AIR, SIZE[1]), m=FLAKE, seed=self.seed)
            ],
            emitters=[
                BoxEmitter(
                    (-0.5 * drift, top + AIR, 0.0),
                    sides=(SIZE[0] + abs(drift), 0.0, SIZE[1]),
                    direction=(0.0, -1.0, 0.0),
                    rate=self.rate * (1 + abs(drift) / SIZE[0]),
                    speed=self.fall,
                    cone=0.0,
                    mass=FLAKE,
                )
            ],
            zones=[HalfSpaceZone((0.0, low - DEPTH, 0.0))],
            forces=[Gravity((0.0, -GRAVITY, 0.0)), Wind([gust, flutter], k)],
            colliders=[ground, standing],
            camera=Camera(position=(0.6, 1.7, 7.7), target=(0.0, 0.95, 0.0), fov=32.0),
            look=Look(particles="flakes", size=self.size, color="#eef4ff", shutter=1 / 90, collider_color="#3c4a63"),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is inside of the hills or of what stands there, who lies is on one of them and stays there but in
        strong gusts, who falls has the right speed."""
        last, before = frames[-1], frames[-2]
        ground, standing = self.ground(), self.standing()
        bottom = float(ground.heights.min()) - DEPTH
        lowest = float(last.positions[:, 1].min(initial=np.inf))
        expect(lowest > bottom - 1e-3, f"a flake is at {lowest:.3g} m, below the ground, which ends at {bottom:.3g} m")
        top = self._top(ground, standing)
        lies: NDArray[np.bool_] = ~np.asarray(last.velocities.any(axis=1))
        self._check_surfaces(last, _some(lies), _some(~lies & (last.positions[:, 1] < top)))
        drift = (abs(self.wind) + 2 * np.hypot(self.gusts * self.wind, self.flutter)) / self.fall
        if drift + 3 * self.hills < 0.8 * self.friction:
            _, now, then = np.intersect1d(last.ids, before.ids, return_indices=True)
            lay = ~before.velocities[then].any(axis=1)
            stays = (last.positions[now] == before.positions[then]).all(axis=1)[lay]
            expect(not len(stays) or stays.mean() > 0.9, f"{(~stays).sum()} of {len(stays)} flakes that lay have moved")
        high: NDArray[np.bool_] = last.positions[:, 1] > top
        if high.sum() > 100 and last.time > 0.5:
            fall = -float(last.velocities[high, 1].mean())
            off = 5 * (0.3 * self.flutter + abs(self.gusts * self.wind)) / 3 + 0.05 * self.fall
            expect(abs(fall - self.fall) < off, f"flakes fall at {fall:.3f} m/s, not at {self.fall} m/s")

    def _check_surfaces(self, frame: Frame, lie: Rows, fly: Rows) -> None:
        """Of some flakes: who lies touches the ground or what stands on it, and nobody is inside of one."""
        surfaces = (self.ground(), self.standing())
        gaps = np.array([s.distance(frame.positions[np.append(lie, fly)], frame.time) for s in surfaces])
        deepest = float(gaps.min(initial=0.0))
        expect(deepest > -ROUNDING, f"a flake sank {-deepest:.2g} m into the ground or into what stands on it")
        touches = gaps[:, : len(lie)] < ROUNDING
        loose = int((~touches.any(axis=0)).sum())
        expect(loose == 0, f"{loose} of {len(lie)} flakes lie in the air")
        if len(lie) > 500 and not self.model:
            counts = touches.sum(axis=1)
            expect(counts.min() > 0, f"of {len(lie)} flakes {counts[0]} lie on the ground and {counts[1]} on the mesh")


def _some(which: NDArray[np.bool_]) -> Rows:
    """Rows that a mask marks, at most `LOOKED_AT`, evenly chosen."""
    rows = np.flatnonzero(which)
    return rows[:: max(1, -(-len(rows) // LOOKED_AT))]
