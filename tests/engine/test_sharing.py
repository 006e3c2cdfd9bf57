"""Functions that two kernels have in common are compiled once, and those that only look alike are not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pointmass.engine import store

TEXT = """
SCALE = {scale}


@njit(**FLAGS)
def scaled_by(a):
    run = SCALE * a  # its own, and not the kernel
    return run


@njit(**FLAGS)
def again(a):
    run = scaled_by(a)
    return run + {more}


@njit(**ENTRY)
def run(x):
    for i in range(len(x)):
        x[i] = again(x[i])
"""


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("POINTMASS_CACHE", str(tmp_path))


def kernel(scale: float, more: float) -> object:
    module = store.load(f"{scale} a + {more}", TEXT.format(scale=scale, more=more), "float64")
    x = np.arange(3.0)
    module.run(x)
    assert x.tolist() == [scale * a + more for a in range(3)]
    return module


def test_what_depends_on_the_same_text_is_shared() -> None:
    one, other, third = kernel(2.0, 1.0), kernel(2.0, 3.0), kernel(4.0, 1.0)
    assert one.scaled_by is other.scaled_by
    assert one.again is not other.again
    assert one.scaled_by is not third.scaled_by
    assert one.again is not third.again
    assert len(one.scaled_by.overloads) == 1


PROGRAM = """
import sys
import numpy as np
import pointmass as pm

for law in sys.argv[1:]:
    particles = pm.Particles(np.random.default_rng(1).uniform(-1, 1, (1100, 3)))
    forces = [pm.SoftSphere(), *([pm.Drag(0.1)] if law == "drag" else [])]
    sim = pm.Simulation(pm.ParticleSystem(particles, forces), "leapfrog", 1e-3, compiled=True)
    sim.step(2)
"""


def test_a_process_may_load_a_kernel_without_the_one_that_it_was_compiled_after() -> None:
    for laws in (["none", "drag"], ["drag"]):
        done = subprocess.run([sys.executable, "-c", PROGRAM, *laws], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
