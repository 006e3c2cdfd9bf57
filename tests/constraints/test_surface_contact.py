"""Triangles and links against colliders: one contact in closed form, and sheets that fall over shapes."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.constraints import Step
from pointmass.forces import Springs
from tests import naive
from tests.shapes import TETRAHEDRON

H = 0.01
DULL = {"restitution": 0.0, "friction": 0.4}


def enforced(x, v, collider, triangles=((0, 1, 2),), pinned=(), dtype=np.float64, start=None, **more):
    """Particles after one step of H that began at `start` = x0, v0; by default they came with their v."""
    p = pm.Particles(x, v, dtype=dtype)
    p.cover("sheet", triangles)
    p.pin(list(pinned))
    system = pm.ParticleSystem(p, colliders=[collider])
    x0, v0 = (p.x - H * p.v, p.v.copy()) if start is None else start
    constraint = pm.SurfaceContact(**{"thickness": 0.0, **more})
    constraint.bind(system)
    constraint.enforce(system, Step(0.0, H, p.id, x0, v0))
    return p


def triangle_over_ball(depth, size=0.4):
    """An even triangle whose middle is so deep in a ball of radius 1."""
    angle = 2 * np.pi * np.arange(3) / 3
    return np.stack([size * np.cos(angle), np.full(3, 1 - depth), size * np.sin(angle)], axis=1)


def test_the_middle_is_lifted_to_the_surface_and_loses_its_speed():
    """Its weights are equal, so the triangle rises as it is; it came with 1 m/s, of which a half comes back."""
    ball = pm.Sphere(radius=1.0, restitution=0.5, friction=0.0)
    p = enforced(triangle_over_ball(0.01), (0.2, -1, 0), ball, thickness=0.005)
    np.testing.assert_allclose(p.x, triangle_over_ball(-0.005), atol=2e-4)  # the precision is 1e-4 of 0.7 m
    np.testing.assert_allclose(p.v, np.tile((0.2, 0.5, 0), (3, 1)), atol=0.02)


def test_who_is_held_keeps_its_bits_and_the_others_move_more():
    """With weights 1/3 and one corner held, the two others move by (1/3) / (2/9) = 3/2 of the depth."""
    ball = pm.Sphere(radius=1.0, **DULL)
    x = triangle_over_ball(0.01)
    p = enforced(x, (0, 0, 0), ball, pinned=[0], rounds=1)
    assert p.x[0].tobytes() == x[0].tobytes()
    assert not p.v[0].any()
    np.testing.assert_allclose(p.x[1:, 1] - x[1:, 1], 0.015, rtol=0.03)


@pytest.mark.parametrize(("friction", "share"), [(0.0, 0.0), (0.2, 0.4), (5.0, 1.0)])
def test_friction_takes_mu_times_what_is_pushed(friction, share):
    """It slid 0.5 cm while it went 1 cm deep, at 0.5 m/s and 1 m/s: Coulomb takes mu 1/0.5 of both, at most all."""
    ball = pm.Sphere(radius=1.0, restitution=0.0, friction=friction)
    x = triangle_over_ball(0.01)
    p = enforced(x, (0.5, -1, 0), ball, rounds=1)
    moved, speed = p.x.mean(axis=0)[0] - x.mean(axis=0)[0], p.v.mean(axis=0)[0]
    assert moved == pytest.approx(-0.005 * share, abs=3e-4)
    assert speed == pytest.approx(0.5 * (1 - share), abs=0.02)


def test_a_surface_that_moves_takes_along():
    """A ball that rises with 2 m/s and drifts with 1 m/s carries what it touches, if it is rough."""
    ball = pm.Sphere(("1*t", "2*t - 0.02", 0), radius=1.0, restitution=0.0, friction=5.0)
    x = triangle_over_ball(0.005)
    p = enforced(x, (0, 0, 0), ball)
    np.testing.assert_allclose(p.v, np.tile((1, 2, 0), (3, 1)), atol=0.03)
    np.testing.assert_allclose((p.x - x).mean(axis=0), (0.01, 0.005, 0), atol=1e-4)


@pytest.mark.parametrize("restitution", [0.0, 0.7, 1.0])
def test_no_impulse_brings_energy(restitution):
    """Corners of equal masses at any speeds: their kinetic energy never grows."""
    rng = np.random.default_rng(3)
    block = pm.Box(size=(1, 1, 1), restitution=restitution, friction=0.5)
    for _ in range(40):
        x = np.array([0.5, 0.5, 0.0]) + rng.normal(0, 0.2, (3, 3))
        if block.distance(x, 0.0).min() < 0:
            continue
        v = rng.normal(0, 1, (3, 3))
        p = enforced(x, v, block)
        assert (p.v**2).sum() <= (v**2).sum() + 1e-12


def test_a_link_of_a_chain_is_lifted():
    """Two ends on both sides of a ball."""
    p = pm.Particles([[-0.5, 0.95, 0], [0.5, 0.95, 0]], [0, -1, 0])
    springs = Springs([(0, 1)], 10.0, family="chain")
    system = pm.ParticleSystem(p, [springs], colliders=[pm.Sphere(radius=1.0, **DULL)])
    constraint = pm.SurfaceContact("chain", thickness=0.0)
    constraint.bind(system)
    constraint.enforce(system, Step(0.0, H, p.id, p.x - H * p.v, p.v.copy()))
    np.testing.assert_allclose(p.x[:, 1], 1.0, atol=2e-4)
    np.testing.assert_allclose(p.v, 0, atol=0.02)


def test_single_precision_does_the_same():
    ball = pm.Sphere(radius=1.0, **DULL)
    single, double = (enforced(triangle_over_ball(0.01), (0.5, -1, 0), ball, dtype=d) for d in (np.float32, np.float64))
    np.testing.assert_allclose(single.x, double.x, atol=3e-4)
    assert single.x.dtype == np.float32


def test_what_makes_no_sense_is_refused():
    p = pm.Particles([[0, 0, 0], [1, 0, 0]])
    ball = pm.Sphere()
    with pytest.raises(pm.InvalidInput, match="no surface covers"):
        pm.Simulation(pm.ParticleSystem(p, colliders=[ball]), constraints=[pm.SurfaceContact()])
    cloth = pm.cloth(3, 3)
    with pytest.raises(pm.InvalidInput, match="add a collider"):
        pm.Simulation(pm.ParticleSystem(cloth.particles, cloth.forces), constraints=[pm.SurfaceContact()])
    with pytest.raises(pm.InvalidInput, match="'cloht'"):
        pm.Simulation(pm.ParticleSystem(p, colliders=[ball]), constraints=[pm.SurfaceContact("cloht")])
    with pytest.raises(pm.InvalidInput, match="thickness"):
        pm.SurfaceContact(thickness=-1.0)
    with pytest.raises(pm.InvalidInput, match="rounds"):
        pm.SurfaceContact(rounds=0)


# ------------------------------------------------------------------------------------------------ whole runs

SHAPES = {
    "ball": lambda: pm.Sphere(radius=0.25, **DULL),
    "block": lambda: pm.Box(size=(0.5, 0.5, 0.5), **DULL),
    "capsule": lambda: pm.Capsule((-0.2, 0.1, 0), (0.2, 0.15, 0), radius=0.1, **DULL),
    "mesh": lambda: pm.Mesh(TETRAHEDRON, scale=0.35, **DULL),
}
SIDE = 9


def falling(collider, solver=None, dt=1e-3, thickness=2e-3, guarded=True, **more):
    """A coarse sheet without thickness above a shape, not straight above its middle."""
    body = pm.cloth(SIDE, SIDE, 1.0, center=(0.04, 0.37, 0.03), right=(0.8, 0, 0.6), down=(-0.6, 0, 0.8), radius=0.0)
    forces = [pm.Gravity(), pm.Drag(k=0.01), *body.forces]
    system = pm.ParticleSystem(body.particles, forces, colliders=[collider])
    constraints = [pm.SurfaceContact(thickness=thickness)] if guarded else []
    return pm.Simulation(system, solver=solver or pm.SymplecticEuler(), dt=dt, constraints=constraints, **more)


def depths(sim, collider, frames):
    """The least distance of any point of any triangle that is near, at each frame."""
    triangles = sim.system.particles.corners("cloth")
    found = []
    for frame in sim.frames(frames, fps=60):
        corners = frame.positions[triangles]
        near = collider.distance(corners.mean(axis=1), frame.time) < 1.5 / SIDE
        found.append(naive.deepest(collider, corners[near], frame.time, points=16) if near.any() else np.inf)
    return np.array(found)


@pytest.mark.parametrize("name", SHAPES)
def test_no_point_of_a_sheet_comes_into_a_shape(name):
    """Left is at most a tenth of a millimetre of the thickness, with cells of 12.5 cm."""
    collider = SHAPES[name]()
    assert depths(falling(collider), collider, 45).min() > 2e-3 - 1e-4


def test_without_it_a_corner_comes_through():
    collider = SHAPES["block"]()
    assert depths(falling(collider, guarded=False), collider, 45).min() < -5e-3


@pytest.mark.parametrize(("solver", "dt"), [(pm.XPBD(), 1 / 480), (pm.ImplicitEuler(), 1 / 240)])
def test_other_solvers_keep_out_too(solver, dt):
    collider = SHAPES["block"]()
    assert depths(falling(collider, solver, dt), collider, 45).min() > 2e-3 - 1e-4


def test_a_sheet_at_rest_on_corners_stays_and_gains_no_energy():
    """In two seconds nobody goes 0.2 mm, the last of a swing that dies away, and 0.01 mm between frames; the energy
    falls all the time, but for what the weight does over 0.01 mm."""
    collider = SHAPES["block"]()
    sim = falling(collider)
    frames = list(sim.frames(360, fps=60))
    energy = [f.quantities["energy"] for f in frames]
    assert np.diff(energy).max() < 1e-5 * 9.81 * sim.system.particles.m.sum() < 1e-4 * (energy[0] - energy[-1])
    x = np.array([f.positions for f in frames[-120:]])
    assert np.abs(x - x[-1]).max() < 2e-4
    assert np.abs(np.diff(x, axis=0)).max() < 1e-5


def test_both_paths_and_any_number_of_threads_agree():
    import numba

    collider = SHAPES["block"]()
    ends = []
    most = numba.get_num_threads()
    for threads, compiled in ((1, True), (most, True), (most, False)):
        numba.set_num_threads(threads)
        sim = falling(collider, compiled=compiled)
        sim.step(250)
        ends.append(sim.system.particles.x.copy())
    numba.set_num_threads(most)
    assert ends[0].tobytes() == ends[1].tobytes()
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-9)


def test_triangles_that_are_torn_off_do_not_count():
    """Without its corner a sheet goes on as it is."""
    sim = falling(SHAPES["ball"]())
    sim.step(10)
    sim.system.remove([0])
    sim.step(300)
    assert len(sim.system.particles.corners("cloth")) < 2 * (SIDE - 1) ** 2
    assert np.isfinite(sim.system.particles.x).all()
