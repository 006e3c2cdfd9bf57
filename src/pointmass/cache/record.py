"""Runs a simulation into a cache."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pointmass.cache.cache import Cache, attributes_of, check_target, sweep
from pointmass.cache.groups import Array
from pointmass.cache.provenance import Change, Making
from pointmass.engine.island import CHECKPOINT
from pointmass.errors import Diverged, InvalidInput, number, whole_number
from pointmass.frame import Camera, Frame
from pointmass.lock import locked

if TYPE_CHECKING:
    from pointmass.scene import Scene
    from pointmass.simulation import Simulation

APART = 8  # frames between two checkpoints, at least: they take as much room as one or two


@dataclass(frozen=True)
class Plan:
    """What a run has to do where there is a cache already.

    Attributes
    ----------
    cache : that is there; None = none that can be gone on with.
    kept : how many of its frames stay.
    state : from which the run goes on; None = from the start.
    changes : what has changed since.
    known : whether the cache says what it follows from.
    """

    cache: Cache | None = None
    kept: int = 0
    state: dict[str, Array] | None = None
    changes: list[Change] = field(default_factory=list)
    known: bool = True

    @property
    def same(self) -> bool:
        """Whether the frames that are there are those that the run will have."""
        return self.cache is not None and self.known and not self.changes


def plan(path: str | Path, sim: Simulation, scene: Scene | None, fps: float) -> Plan:
    """What a run into a cache has to do, by what is there already.

    Parameters
    ----------
    path, sim, scene, fps : as for `record`.
    """
    path = Path(path)
    try:
        cache = Cache.open(path)
    except InvalidInput:
        return Plan()
    new, old = Making.of(scene, sim, fps), Making.read(cache.attributes)
    if new is None or old is None:
        return Plan(cache, known=False)
    same = old.hash == new.hash
    state = cache.state() if same else cache.state(before=old.untouched_until(new) - sim.dt)
    if state is not None and not sim.fits(state):  # an edit that changes more than it seems
        state = None
    if same:
        return Plan(cache, len(cache), state)
    return Plan(cache, 0 if state is None else int(state["steps"][1]), state, old.changes(new))


def record(
    sim: Simulation,
    path: str | Path,
    frames: int = 240,
    fps: float = 60.0,
    *,
    scene: Scene | None = None,
    camera: Camera | None = None,
    overwrite: bool = False,
    resume: bool = False,
    checkpoints: bool = True,
    planned: Callable[[Plan], None] | None = None,
    progress: Callable[[int], None] | None = None,
    about: dict[str, Any] | None = None,
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
    resume : whether frames of a cache that is there already stay, as far as they follow from the same scene: then `sim`
        is fresh from it, and goes on from a checkpoint with the bits that it would have had. Frames that an edit of the
        scene can affect are made anew, see `plan`.
    checkpoints : whether states are kept from which a run can go on; each takes about as much room as two frames.
    planned : called with what is to be done, before anything is, if the run is to `resume`; what it raises ends it.
    progress : called with the number of frames written so far, after each.
    about : what else the cache should know, as it can stand in JSON.

    Raises
    ------
    InvalidInput
        The place cannot be written, another process is writing there, or the simulation refuses its input; then nothing
        is written.
    Diverged
        The frames before it are in the cache, as after a KeyboardInterrupt.

    Examples
    --------
    >>> cache = pm.record(sim, "swing.zarr", frames=240, fps=60)
    """
    path = Path(path)
    frames, fps = whole_number("frames", frames, at_least=1), number("fps", fps, above=0, unit="1/s")
    if resume and (sim.steps or sim.frames_seen):
        raise InvalidInput(f"resume = True is not allowed for a simulation after {sim.steps} steps: give a fresh one")
    check_target(path, overwrite or resume)
    with locked(path, "the cache"):
        sweep(path)
        writer = _Writer(sim, path, fps, scene, camera, overwrite or resume, progress, about or {})
        if resume:
            found = plan(path, sim, scene, fps)
            if planned is not None:
                planned(found)
            if writer.goes_on(found, frames):
                return writer.flush()
        if checkpoints:
            writer.keep_states()
        try:
            for frame in sim.frames(frames - sim.frames_seen if resume else frames, fps):
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
        about: dict[str, Any],
    ) -> None:
        self._more = about
        self._sim, self._path, self._fps, self._scene = sim, path, fps, scene
        self._camera, self._overwrite, self._progress = camera, overwrite, progress
        self._cache: Cache | None = None
        self._waiting: list[Frame] = []
        self._there = 0  # frames that need not be written again
        self._making = Making.of(scene, sim, fps)
        self.writing = False

    def goes_on(self, found: Plan, frames: int) -> bool:
        """Go on with what is there, if any of it can stay; True if that is all."""
        cache = found.cache
        if cache is None or not found.kept:
            return False
        if found.state is not None:
            self._sim.put_state(found.state)
        self._warn(cache)
        attributes = self._attributes()
        if not found.same:
            cache.cut(found.kept, attributes)
        elif any(cache.attributes[name] != attributes[name] for name in ("camera", "name", "scene")):
            cache.describe(attributes)  # what changes no frame
        self._cache, self._there = cache, found.kept
        return found.kept >= frames

    def keep_states(self) -> None:
        """Write checkpoints while it runs."""
        sim = self._sim
        apart = CHECKPOINT * math.ceil(APART / (CHECKPOINT * sim.dt * self._fps))

        def keep() -> None:
            if sim.steps and sim.steps % apart == 0:
                self.flush().keep_state(sim.state())

        if not sim.restless and self._making is not None:
            sim.on_grid = keep

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
            frame = self._waiting[0]
            if frame.number >= self._there:
                self._cache.append(frame)
            del self._waiting[0]
            if self._progress is not None:
                self._progress(max(frame.number + 1, self._there) if self._there else len(self._cache))
        self.writing = False
        return self._cache

    def _warn(self, cache: Cache) -> None:
        """Say that other libraries may have other bits."""
        old, now = cache.attributes.get("versions", {}), self._attributes()["versions"]
        for library in ("numpy", "numba"):
            if old.get(library) != now[library]:
                warnings.warn(
                    f"the frames of {str(self._path)!r} were made with {library} {old.get(library)}, and the rest is"
                    f" with {now[library]}: bits may differ",
                    stacklevel=4,
                )

    def _about(self) -> dict[str, Any]:
        sim = self._sim
        dtype = str(sim.system.particles.dtype)
        return {"seed": sim.seed, "dt": sim.dt, "solver": sim.solver.name, "dtype": dtype, **self._more}

    def _attributes(self) -> dict[str, Any]:
        return attributes_of(self._path, self._scene, self._fps, self._camera, self._making, self._about())

    def _created(self) -> Cache:
        return Cache.create(
            self._path,
            self._scene,
            fps=self._fps,
            camera=self._camera,
            overwrite=self._overwrite,
            making=self._making,
            **self._about(),
        )
