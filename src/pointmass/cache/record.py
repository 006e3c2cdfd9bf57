"""Runs a simulation into a cache."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pointmass.cache.cache import Cache, check_target
from pointmass.errors import Diverged, number, whole_number
from pointmass.frame import Camera, Frame

if TYPE_CHECKING:
    from pointmass.scene import Scene
    from pointmass.simulation import Simulation


def record(
    sim: Simulation,
    path: str | Path,
    frames: int = 240,
    fps: float = 60.0,
    *,
    scene: Scene | None = None,
    camera: Camera | None = None,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Cache:
    """Run a simulation and write its frames to a cache, one by one.

    Parameters
    ----------
    sim : goes on from where it is.
    path : of the cache, a folder; by custom its name ends in .zarr.
    frames, fps : how many frames, and how many for a second of simulated time.
    scene : that the simulation was made from; stored with the frames.
    camera : for pictures; the scene's by default.
    overwrite : whether a cache that is there already goes. It stays until the run has begun without an error.
    progress : called with the number of frames written so far, after each.

    Raises
    ------
    InvalidInput
        The place cannot be written, or the simulation refuses its input; then nothing is written.
    Diverged
        The frames before it are in the cache, as after a KeyboardInterrupt.

    Examples
    --------
    >>> cache = pm.record(sim, "swing.zarr", frames=240, fps=60)
    """
    path = Path(path)
    frames, fps = whole_number("frames", frames, at_least=1), number("fps", fps, above=0, unit="1/s")
    check_target(path, overwrite)
    writer = _Writer(sim, path, fps, scene, camera, overwrite, progress)
    try:
        for frame in sim.frames(frames, fps):
            writer.add(frame, frames)
    except (Diverged, KeyboardInterrupt):
        if not writer.writing:  # what an interrupt finds half written stays as it is
            writer.flush()
        raise
    return writer.flush()


class _Writer:
    """Holds the first frame back until the second shows that the solver takes the system."""

    def __init__(
        self,
        sim: Simulation,
        path: Path,
        fps: float,
        scene: Scene | None,
        camera: Camera | None,
        overwrite: bool,
        progress: Callable[[int], None] | None,
    ) -> None:
        self._sim, self._path, self._fps, self._scene = sim, path, fps, scene
        self._camera, self._overwrite, self._progress = camera, overwrite, progress
        self._cache: Cache | None = None
        self._waiting: list[Frame] = []
        self.writing = False

    def add(self, frame: Frame, frames: int) -> None:
        self._waiting.append(frame)
        if self._cache is not None or len(self._waiting) >= min(2, frames):
            self.flush()

    def flush(self) -> Cache:
        """Write what is held back."""
        self.writing = True
        if self._cache is None:
            self._cache = self._created()
        while self._waiting:
            self._cache.append(self._waiting[0])
            del self._waiting[0]
            if self._progress is not None:
                self._progress(len(self._cache))
        self.writing = False
        return self._cache

    def _created(self) -> Cache:
        sim = self._sim
        return Cache.create(
            self._path,
            self._scene,
            fps=self._fps,
            camera=self._camera,
            overwrite=self._overwrite,
            seed=sim.seed,
            dt=sim.dt,
            solver=sim.solver.name,
            dtype=str(sim.system.particles.dtype),
        )
