"""How contestants are set up: every peer in its best mode, and pointmass as a user writes it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from benchmarks.track import Array, Contestant

if TYPE_CHECKING:
    import pointmass as pm


class Ours(Contestant):
    """pointmass by its public API.

    Attributes
    ----------
    sim : to be made by the constructor.
    steps : of a frame.
    """

    name = "pointmass"
    sim: pm.Simulation
    steps: int

    def frame(self) -> None:
        self.sim.step(self.steps)

    def result(self) -> Array:
        return self.sim.system.particles.x

    def note(self) -> str:
        missing = self.sim.engine.missing()
        return f"not compiled, because there is no kernel for {', '.join(missing)}" if missing else ""


def start_taichi(ti: Any) -> None:
    """On all threads, with fast mathematics."""
    threads = int(os.environ.get("OMP_NUM_THREADS", "0")) or os.cpu_count()
    ti.init(arch=ti.cpu, default_fp=ti.f32, fast_math=True, cpu_max_num_threads=threads, log_level=ti.ERROR)


def start_warp(wp: Any) -> None:
    """Quietly, with fast mathematics and no code for derivatives."""
    wp.config.quiet = True
    wp.config.enable_backward = False
    wp.init()
    wp.set_module_options({"fast_math": True, "enable_backward": False})
