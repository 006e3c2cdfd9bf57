"""The number of threads changes no bit."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from functools import partial

import pytest

from pointmass.engine.threads import spread

PROGRAM = """
import hashlib, sys
import numpy as np
import pointmass as pm

def chains(n, length, rng):
    first = np.arange(n) * length
    ends = np.concatenate([np.stack([first + k, first + k + 1], axis=1) for k in range(length - 1)])
    return pm.Springs(ends, 50.0, 0.1, rest=0.5)

rng = np.random.default_rng(1)
hash = hashlib.sha256()
for n, dtype, solvers in (
    (5000, "float64", (pm.SymplecticEuler(), pm.DormandPrince())),
    (3000, "float32", (pm.SymplecticEuler(),)),
):
    for solver in solvers:
        particles = pm.Particles(rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3)), dtype=dtype)
        forces = [pm.Gravity(), pm.QuadraticDrag(0.1), chains(n // 10, 5, rng)]
        sim = pm.Simulation(pm.ParticleSystem(particles, forces), solver, 1 / 60, compiled=True)
        sim.step(10)
        hash.update(particles.x.tobytes() + particles.v.tobytes() + particles.age.tobytes())
for force in (pm.Gravitation(1.0, eps=0.1), pm.SoftSphere()):
    particles = pm.Particles(rng.uniform(-1, 1, (1100, 3)), dtype="float32", radius=0.05)
    sim = pm.Simulation(pm.ParticleSystem(particles, [force]), "leapfrog", 1e-3, compiled=True)
    sim.step(10)
    hash.update(particles.x.tobytes() + particles.v.tobytes())

side = 70
grid = np.arange(side * side).reshape(side, side)
pairs = np.concatenate([np.c_[grid[:, :-1].ravel(), grid[:, 1:].ravel()], np.c_[grid[:-1].ravel(), grid[1:].ravel()]])
x = np.stack([grid % side, 0 * grid, grid // side], axis=-1).reshape(-1, 3) / side
particles = pm.Particles(x, m=1e-3)
particles.pin([0, side - 1])
system = pm.ParticleSystem(particles, [pm.Gravity(), pm.Springs(pairs, 5.0, rest=0.95 / side)])
sim = pm.Simulation(system, pm.ImplicitEuler(newton="one", cg_tolerance=1e-3), 1 / 60, compiled=True)
sim.step(3)
hash.update(particles.x.tobytes())

rain = pm.BoxEmitter((0, 0.5, 0), name="rain", sides=(9, 0, 9), rate=9000, speed=4, direction=(0, -1, 0), lifetime=1)
splash = pm.PointEmitter(of="rain", on="impact", count=3, speed=2, cone=60, lifetime=1)
system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity()], [pm.Plane(restitution=0.3)])
sim = pm.Simulation(system, "leapfrog", 1 / 60, emitters=[rain, splash], compiled=True)
sim.step(24)
assert len(system.particles) > 9000
hash.update(system.particles.id.tobytes() + system.particles.x.tobytes())
print(hash.hexdigest())
"""

LARGE = """
import hashlib
import numpy as np
import pointmass as pm

rng = np.random.default_rng(1)
n = 5000
x = rng.uniform(-1, 1, (n, 3))
ring = np.stack([np.arange(n), np.roll(np.arange(n), 1)], axis=1)
chords = rng.integers(0, n, (2 * n, 2))
chords = chords[chords[:, 0] != chords[:, 1]]
hash = hashlib.sha256()
for dtype in ("float64", "float32"):
    particles = pm.Particles(x, m=rng.uniform(0.5, 2, n), dtype=dtype)
    forces = [
        pm.Springs(ring, 5.0, 0.1, rest=rng.uniform(0.1, 0.5, n)),
        pm.Attractor(2.0, eps=0.3),
        pm.Springs(chords, 2.0, 0.1, rest=0.3),
        pm.Angles(np.stack([np.roll(np.arange(n), k) for k in (0, 1, 2)], axis=1)[: n // 2], 0.1, 0.01, rest=0.5),
        pm.QuadraticDrag(0.1),
    ]
    sim = pm.Simulation(pm.ParticleSystem(particles, forces), pm.RK4(), 1 / 240, compiled=True)
    sim.step(10)
    assert np.isfinite(particles.x).all()
    hash.update(particles.x.tobytes() + particles.v.tobytes())
print(hash.hexdigest())
"""


def digest(program: str, threads: int) -> str:
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize("program", [PROGRAM, LARGE], ids=["many islands", "a large one"])
def test_one_two_three_and_seven_threads_give_the_same_bits(program: str) -> None:
    assert len({digest(program, threads) for threads in (1, 2, 3, 7)}) == 1


@pytest.mark.parametrize(("asked", "answer"), [("1", "1"), ("none", "POINTMASS_THREADS = none is not allowed")])
def test_the_environment_says_how_many_threads_there_are(asked: str, answer: str) -> None:
    program = """
import pointmass as pm
sim = pm.Simulation(pm.ParticleSystem(pm.Particles((0, 1, 0)), pm.Gravity()), "leapfrog", 0.01, compiled=True)
sim.step()
import numba
print(numba.get_num_threads())
"""
    environment = {**os.environ, "POINTMASS_THREADS": asked}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert answer in done.stdout + done.stderr


def test_every_item_is_worked_on_once() -> None:
    for count, grain in ((0, 1), (1, 1), (7, 2), (1000, 1), (1000, 300)):
        seen = [0] * count

        def work(lo: int, hi: int, seen: list[int] = seen) -> None:
            time.sleep(0.001)
            for k in range(lo, hi):
                seen[k] += 1

        spread(work, count, grain)
        assert seen == [1] * count


def test_what_goes_wrong_in_a_thread_comes_out() -> None:
    def work(lo: int, hi: int) -> None:
        raise ValueError(f"{lo} to {hi}")

    with pytest.raises(ValueError, match="0 to"):
        spread(work, 1000, 1)

    def missing(lo: int, hi: int) -> None:
        raise IndexError(f"{lo} to {hi}")

    with pytest.raises(IndexError, match="0 to"):
        spread(missing, 1000, 1)


def test_work_that_spreads_work_comes_to_an_end() -> None:
    seen = [0] * 64

    def outer(lo: int, hi: int) -> None:
        for row in range(lo, hi):
            spread(partial(inner, 8 * row), 8, 1)

    def inner(begin: int, lo: int, hi: int) -> None:
        time.sleep(0.001)
        for k in range(begin + lo, begin + hi):
            seen[k] += 1

    spread(outer, 8, 1)
    assert seen == [1] * 64
