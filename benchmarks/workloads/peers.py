"""How the peers are set up: every one in its best mode."""

from __future__ import annotations

import os
from typing import Any


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
