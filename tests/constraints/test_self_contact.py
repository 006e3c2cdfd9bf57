"""Self-contact in a run: friction by its closed form, cloth that folds, names and wrong values, threads and paths."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from tests import crossing

G = 9.81
SOLVERS = [pm.SymplecticEuler(), pm.XPBD(4), pm.ImplicitEuler()]


def incline(angle: float, mu: float, solver: Any, dt: float = 1 / 240) -> tuple[pm.Simulation, np.ndarray]:
    """A small cloth that lies on a large pinned one at an angle, and the direction down the slope."""
    c, s = math.cos(angle), math.sin(angle)
    down, normal = np.array((c, -s, 0)), np.array((s, c, 0))
    table = pm.cloth(2, 2, 40.0, right=(0, 0, 1), down=down, center=8 * down, pinned="corners")
    center = 0.025 * normal + 0.013 * down + np.array((0, 0, 0.021))
    patch = pm.cloth(4, 4, 0.3, right=(0, 0, 1), down=down, center=center, stretch=20, shear=4, bend=0)
    p, forces = pm.bodies.body.join([table, patch], ["table", "patch"], np.float64)
    system = pm.ParticleSystem(p, [pm.Gravity((0, -G, 0)), *forces])
    contact = pm.SelfContact(thickness=0.025, friction=mu)
    return pm.Simulation(system, solver, dt, constraints=[contact], compiled=False), down


def slid(sim: pm.Simulation, down: np.ndarray) -> tuple[float, float]:
    """How far the middle of the patch is down the slope, and how fast."""
    p = sim.system.particles
    patch = p.groups["patch"]
    return tuple(float((column[patch] @ down).mean()) for column in (p.x, p.v))  # type: ignore[return-value]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.name)
def test_a_patch_slides_down_a_slope_above_the_angle_of_friction(solver: Any) -> None:
    """It starts at rest at its thickness, and has a = g (sin - mu cos); x = a t^2 / 2 of these methods is a t h/2 more.

    A step ends its sweeps when no row has moved by 1e-5 thicknesses, which is 2.5e-7 m; one step of free fall down the
    slope is g sin h^2 = 8e-5 m, so each step is right to 0.3%, and there is some slack in the springs.
    """
    angle, mu, t = math.radians(30), 0.3, 0.4
    sim, down = incline(angle, mu, solver)
    start, _ = slid(sim, down)
    sim.run(t)
    far, fast = slid(sim, down)
    a = G * (math.sin(angle) - mu * math.cos(angle))
    assert fast == pytest.approx(a * t, rel=0.01)
    assert far - start == pytest.approx(a * t * (t + sim.dt) / 2, rel=0.01)
    sheet = sim.system.particles.x[4:]
    above = sheet @ (math.sin(angle), math.cos(angle), 0)
    assert above == pytest.approx(np.full(16, 0.025), abs=1e-4)  # all of it lies on the slope


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.name)
def test_it_stays_below_that_angle(solver: Any) -> None:
    angle, mu = math.radians(30), 0.65  # tan 30 = 0.577
    sim, down = incline(angle, mu, solver)
    start, _ = slid(sim, down)
    sim.run(0.4)
    far, fast = slid(sim, down)
    assert abs(fast) < 1e-3  # free it would have 1.96 m/s
    assert abs(far - start) < 1e-4


def folding(
    rows: int, solver: Any, dt: float, compiled: bool = False, dtype: Any = np.float64, **more: Any
) -> pm.Simulation:
    """A sheet that is dropped on its edge, so that it folds over itself."""
    sheet = pm.cloth(rows, rows, 0.6, center=(0, 0.32, 0), down=(0.05, -1, 0.15), material="silk", stretch=20, shear=5)
    floor = pm.Plane(restitution=0.0, friction=0.5)
    p, forces = pm.bodies.body.join([sheet], ["cloth"], dtype)
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Drag(1e-5), *forces], colliders=[floor])
    return pm.Simulation(system, solver, dt, constraints=[pm.SelfContact(**more)], compiled=compiled)


def check_run(sim: pm.Simulation, seconds: float, fps: float = 60.0) -> None:
    """No triangle passes through another in any frame."""
    triangles = sim.system.particles.corners("cloth")
    for frame in sim.frames(round(seconds * fps), fps):
        assert not crossing.crossings(frame.positions, triangles), f"in frame {frame.number}"


@pytest.mark.parametrize(
    ("solver", "dt"),
    [(pm.SymplecticEuler(), 1 / 960), (pm.XPBD(2), 1 / 240), (pm.ImplicitEuler(), 1 / 240)],
    ids=lambda s: getattr(s, "name", ""),
)
def test_a_sheet_that_folds_over_itself_never_passes_through(solver: Any, dt: float) -> None:
    sim = folding(10 if isinstance(solver, pm.ImplicitEuler) else 20, solver, dt)
    check_run(sim, 0.6)
    assert sim.system.particles.x[:, 1].max() < 0.3  # it has come down: half of its height, at most


def test_it_does_not_in_single_precision_either() -> None:
    sim = folding(12, pm.XPBD(2), 1 / 240, dtype=np.float32)
    assert sim.system.particles.x.dtype == np.float32
    check_run(sim, 0.6)
    assert sim.system.particles.x[:, 1].max() < 0.3


@pytest.mark.parametrize("hair", [False, True])
def test_a_cloth_falls_on_strands_and_does_not_pass_through_them(hair: bool) -> None:
    """Strands clamped at the left bear a cloth, and no link passes its faces in any frame; only where hair counts."""
    z = np.linspace(-0.1, 0.1, 4)
    curves = np.stack(np.broadcast_arrays(np.linspace(-0.25, 0.25, 9), 0.0, z[:, None]), axis=2)
    strands = pm.hair(curves=curves, bend=1e-2, stretch=20.0, density=1e6)
    sheet = pm.cloth(8, 8, 0.3, down=(0.05, 0.03, 1), center=(0.01, 0.05, 0.003), stretch=20, shear=5)
    p, forces = pm.bodies.body.join([strands, sheet], ["strands", "cloth"], np.float64)
    system = pm.ParticleSystem(p, [pm.Gravity(), *forces])
    contact = pm.SelfContact(thickness=0.005, hair=hair)
    sim = pm.Simulation(system, pm.XPBD(4), 1 / 240, constraints=[contact], compiled=False)
    links = next(f.ids for f in forces if isinstance(f, pm.Springs) and f.family == "strand")
    triangles = p.corners("cloth")
    through = 0
    for frame in sim.frames(18):
        edges = np.concatenate([links, crossing.edges_of(triangles)])
        through += len(crossing.crossings(frame.positions, triangles, edges))
    assert (through > 0) == (not hair)
    assert (p.x[p.groups["cloth"], 1].mean() > -0.1) == hair  # free it would be at -0.34 m


def test_a_sheet_that_tears_under_another_is_passed_by_nothing() -> None:
    """A sheet between two pinned edges is ripped by a heavy one that is thrown on it; triangles stay apart."""
    lower = pm.cloth(9, 9, 0.6, down=(0, 0, 1), stretch=200, shear=50, pinned=["left edge", "right edge"])
    upper = pm.cloth(6, 6, 0.25, down=(0.2, 0.05, 1), center=(0.01, 0.04, 0.02), density=3.0, stretch=300, shear=60,
                     velocity=(0.0, -4.0, 0.0))  # fmt: skip
    p, forces = pm.bodies.body.join([lower, upper], ["lower", "upper"], np.float64)
    tear = pm.Tear(0.15, "stretch", on="lower")
    system = pm.ParticleSystem(p, [pm.Gravity(), *forces])
    sim = pm.Simulation(system, dt=1 / 1920, constraints=[pm.SelfContact(thickness=0.01), tear], compiled=False)
    for frame in sim.frames(24, 120):
        triangles = np.concatenate([p.corners(name) for name in p.surfaces])
        assert not crossing.crossings(frame.positions, triangles), f"in frame {frame.number}"
    assert tear.breaks > 5


def test_without_it_the_same_sheet_does() -> None:
    sim = folding(20, pm.XPBD(2), 1 / 240)
    free = pm.Simulation(sim.system, sim.solver, sim.dt, compiled=False)
    frames = list(free.frames(42))
    assert len(crossing.crossings(frames[-1].positions, free.system.particles.corners("cloth"))) > 10


@pytest.mark.full
@pytest.mark.parametrize(
    ("solver", "dt"),
    [(pm.SymplecticEuler(), 1 / 1920), (pm.XPBD(2), 1 / 240), (pm.ImplicitEuler(), 1 / 240)],
    ids=lambda s: getattr(s, "name", ""),
)
def test_a_large_sheet_that_folds_over_itself_never_passes_through(solver: Any, dt: float) -> None:
    check_run(folding(40, solver, dt, compiled=True), 2.0)


def test_two_cloths_fall_on_pinned_ends_of_a_third() -> None:
    """Nothing passes through anything, pins keep their bits, and the third bears the weight."""
    table = pm.cloth(9, 9, 0.6, down=(0, 0, 1), pinned="edges")
    first = pm.cloth(8, 8, 0.4, down=(0.3, 0.05, 1), center=(0, 0.06, 0))
    second = pm.cloth(7, 7, 0.4, down=(-0.5, 0, 1), center=(0.1, 0.12, 0.05))
    p, forces = pm.bodies.body.join([table, first, second], ["table", "first", "second"], np.float64)
    system = pm.ParticleSystem(p, [pm.Gravity(), *forces])
    sim = pm.Simulation(system, pm.XPBD(2), 1 / 240, constraints=[pm.SelfContact()], compiled=False)
    pins = p.x[p.pinned].tobytes()
    triangles = np.concatenate([p.corners(name) for name in p.surfaces])
    for frame in sim.frames(40):
        assert not crossing.crossings(frame.positions, triangles)
    assert p.x[p.pinned].tobytes() == pins
    assert p.x[p.groups["second"], 1].mean() > -0.15  # free it would be at -1.9 m


PROGRAM = """
import sys, hashlib
sys.path.insert(0, {root!r})
import pointmass as pm
from pointmass.self_contact import resolution, pairs
resolution.GRAIN = pairs.GRAIN = 8
from tests.constraints.test_self_contact import folding
sim = folding(12, pm.XPBD(2), 1 / 240)
sim.run(0.5)
p = sim.system.particles
print(hashlib.sha256(p.x.tobytes() + p.v.tobytes()).hexdigest())
"""


def test_the_same_bits_on_any_number_of_threads() -> None:
    root = str(Path(__file__).resolve().parents[2])
    found = set()
    for threads in (1, 2, 3):
        more = {"NUMBA_NUM_THREADS": str(threads), "POINTMASS_ENGINE": "reference"}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM.format(root=root)],
            env=os.environ | more,
            check=True,
            capture_output=True,
            text=True,
        )
        found.add(done.stdout)
    assert len(found) == 1


def sheets(*centers: float, **more: Any) -> pm.ParticleSystem:
    """Sheets that lie above each other, named one, two, ..."""
    made = [pm.cloth(3, 3, 0.4, down=(0, 0, 1), center=(0.01 * k, y, 0.02 * k)) for k, y in enumerate(centers)]
    p, forces = pm.bodies.body.join(made, ["one", "two", "three"][: len(made)], np.float64)
    return pm.ParticleSystem(p, [pm.Gravity((0, 0, 0)), *forces], **more)


def thrown(system: pm.ParticleSystem, **more: Any) -> np.ndarray:
    """Mean heights of the sheets after the last one was thrown down at the others."""
    p = system.particles
    last = list(p.surfaces)[-1]
    p.v[p.groups[last], 1] = -5.0
    pm.Simulation(system, "symplectic_euler", 1 / 400, constraints=[pm.SelfContact(**more)], compiled=False).run(0.1)
    return np.array([p.x[p.groups[name], 1].mean() for name in p.surfaces])


def test_only_surfaces_that_are_named_touch() -> None:
    assert (np.diff(thrown(sheets(0.0, 0.1))) > 0).all()
    assert (np.diff(thrown(sheets(0.0, 0.1), on=["one", "two"])) > 0).all()
    assert (np.diff(thrown(sheets(0.0, 0.1), on="two")) < 0).all()  # it passes through the other one
    heights = thrown(sheets(0.0, 0.1, 0.2), on=["one", "three"])
    assert heights[2] > heights[0]
    assert heights[2] < 0.1  # the second sheet was passed


def test_groups_name_the_triangles_between_their_particles() -> None:
    system = sheets(0.0, 0.1)
    system.particles.tag("all of it", np.arange(18))
    assert (np.diff(thrown(system, on="all of it")) > 0).all()


def test_momentum_stays_and_nobody_is_pushed_into_a_collider() -> None:
    system = sheets(0.02, 0.1)
    momentum = system.momentum() - (0, 5 * system.particles.m[9:].sum(), 0)
    thrown(system)
    assert system.momentum() == pytest.approx(momentum, abs=1e-12)
    radius = float(system.particles.radius[0])
    system = sheets(radius + 0.02, 0.2, colliders=[pm.Plane(restitution=0.0)])
    heights = thrown(system)
    assert (system.particles.x[:, 1] > radius - 1e-9).all()
    assert heights[1] > heights[0]


def test_particles_may_go_while_it_runs() -> None:
    for constraints in ([pm.SelfContact()], []):
        system = sheets(0.0, 0.1)
        p = system.particles
        sim = pm.Simulation(system, "symplectic_euler", 1 / 400, constraints=constraints, compiled=False)
        p.x[13, 1] += 0.05  # or they would be flat, and pass at once
        p.v[9:, 1] = -5.0
        sim.step(2)
        system.remove([0, 10])
        triangles = np.concatenate([p.corners(name) for name in p.surfaces])
        through = 0
        for _ in range(40):
            sim.step()
            through += len(crossing.crossings(p.x, triangles))
        assert (through > 0) == (not constraints)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: pm.SelfContact(thickness=0.0), "thickness = 0"),
        (lambda: pm.SelfContact(friction=-1), "friction = -1"),
        (lambda: pm.SelfContact(on=3), "on = 3 is not allowed: it must be the name of a surface"),
        (lambda: thrown(sheets(0.0, 0.1), on="tow"), "unknown surface or body 'tow': did you mean 'two'"),
        (lambda: thrown(sheets(0.0, 0.1), thickness=0.11), "must be at most 0.1 .m., half of the shortest edge"),
        (lambda: bound(pm.chain(3)), "SelfContact finds no surfaces: it needs a cloth"),
        (lambda: thrown(crossed()), "a surface passes through itself at the start, at"),
    ],
)
def test_one_sentence_about_what_is_wrong(make: Any, sentence: str) -> None:
    with pytest.raises(pm.PointmassError, match=sentence):
        make()


def bound(body: pm.Body) -> pm.Simulation:
    system = pm.ParticleSystem(body.particles, body.forces)
    return pm.Simulation(system, constraints=[pm.SelfContact()], compiled=False)


def crossed() -> pm.ParticleSystem:
    system = sheets(0.0, 0.1)
    system.particles.x[13, 1] = -0.1  # the middle of the upper one is below the lower one
    return system


def test_pins_that_are_led_through_a_cloth_are_said_once() -> None:
    system = sheets(0.0, 0.1)
    system.particles.pin(slice(None))
    motion = pm.RigidMotion("two", shift=(0, "-t", 0))
    sim = pm.Simulation(system, dt=1 / 100, motions=[motion], constraints=[pm.SelfContact()], compiled=False)
    with pytest.warns(UserWarning, match="pins lead a surface through itself at t = 0.1") as said:
        sim.run(0.15)
    assert len(said) == 1


def test_both_paths_have_the_same_bits() -> None:
    """The same code serves both; what they hand to it is the same to the bit for springs under this solver."""
    results = []
    for compiled in (False, True):
        sim = folding(8, pm.SymplecticEuler(), 1 / 480, compiled=compiled)
        sim.run(0.4)
        results.append(sim.system.particles.x.tobytes())
    assert results[0] == results[1]
