"""Tearing: what breaks, what stays joined, and what is conserved."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.constraints.surgery import cut, star
from pointmass.meshes import TriangleMesh

DT = 1 / 4000


def system_of(body: pm.Body, *forces: Any) -> pm.ParticleSystem:
    return pm.ParticleSystem(body.particles, [*forces, *body.forces])


def vertex(row: int, col: int, cols: int = 5) -> int:
    return row * cols + col


def families(system: pm.ParticleSystem) -> dict[str, pm.Springs]:
    return {f.family: f for f in system.forces if isinstance(f, pm.Springs)}


def stiffness(force: pm.Springs) -> np.ndarray:
    return np.asarray(force.parameters["k_s"].components[0].value)


def pairs(force: pm.Springs) -> set[tuple[int, int]]:
    return {tuple(sorted(pair)) for pair in force.ids.tolist()}


def pieces(system: pm.ParticleSystem) -> int:
    return int(system.island_of_particle.max()) + 1


def sound(system: pm.ParticleSystem) -> None:
    """Every vertex of a surface has one fan, and every spring of a cloth is borne by triangles."""
    p = system.particles
    triangles = p.surfaces["cloth"].triangles
    sides = Counter(tuple(sorted(s)) for t in triangles.tolist() for s in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])))
    assert max(sides.values()) <= 2
    for each in np.unique(triangles).tolist():
        assert not star(p, each).fans().any() or p.pinned[p.rows(each)]
    springs = families(system)
    assert pairs(springs["stretch"]) <= set(sides)
    if "shear" in springs:
        near = {each: set(star(p, each).neighbours.tolist()) for each in np.unique(triangles).tolist()}
        for a, b in pairs(springs["shear"]) - set(sides):
            assert near[a] & near[b], "a diagonal that spans nothing"
        for a, b in pairs(springs["bend"]):
            assert near[a] & near[b], "a spring over two steps that spans nothing"


# ------------------------------------------------------------------------------------------------------- one cut


def test_a_cut_through_the_middle_opens_a_slit() -> None:
    """Across the vertical: the rows above and below come apart at one vertex and stay joined at its neighbours."""
    system = system_of(pm.cloth(5, 5, 1.0))
    p, middle = system.particles, vertex(2, 2)
    mass, k = p.m[middle], stiffness(families(system)["stretch"]).sum()
    found = cut(system, middle, np.array([0.0, 1.0, 0.0]))
    assert found.tolist() == [middle, 25]
    np.testing.assert_allclose(p.m[[middle, 25]], mass / 2, rtol=1e-12)
    assert (p.x[25] == p.x[middle]).all()
    springs = families(system)
    both = [f"{min(end, other)}-{max(end, other)}" for end in (middle, 25) for other in (vertex(2, 1), vertex(2, 3))]
    along = {
        f"{min(a, b)}-{max(a, b)}": s
        for (a, b), s in zip(springs["stretch"].ids.tolist(), stiffness(springs["stretch"]), strict=True)
    }
    assert {along[name] for name in both} == {along["0-1"]}  # half of an inner spring, as at the edge of the cloth
    assert stiffness(springs["stretch"]).sum() == pytest.approx(k, rel=1e-12)
    up, down = (vertex(1, 2), vertex(3, 2)) if p.x[vertex(1, 2), 1] > 0 else (vertex(3, 2), vertex(1, 2))
    ends = {other: end for end in (middle, 25) for other in star(p, end).neighbours.tolist()}
    assert ends[up] != ends[down]
    assert (min(up, down), max(up, down)) not in pairs(springs["bend"])  # it went across the slit
    assert (vertex(2, 1), vertex(2, 3)) in pairs(springs["bend"])  # it goes along it
    assert pieces(system) == 1
    sound(system)


def test_a_cut_along_a_diagonal_leaves_no_diagonal_across() -> None:
    """The edges from the middle up to the left and down to the right are cut, and what crossed them is gone."""
    system = system_of(pm.cloth(5, 5, 1.0))
    shear = families(system)["shear"]
    before = pairs(shear)
    cut(system, vertex(2, 2), np.array([1.0, 1.0, 0.0]))
    sound(system)
    crossing = {(vertex(1, 2), vertex(2, 1)), (vertex(2, 3), vertex(3, 2))}
    assert crossing <= before
    assert not crossing & pairs(shear)
    assert pairs(shear) - before == {(vertex(1, 1), 25), (vertex(3, 3), 25), (vertex(1, 3), 25)}


def test_cuts_from_border_to_border_make_two_pieces_of_the_same_mass() -> None:
    system = system_of(pm.cloth(5, 5, 1.0))
    p = system.particles
    whole = p.m.sum()
    for col in range(5):
        cut(system, vertex(2, col), np.array([0.0, 1.0, 0.0]))
    assert pieces(system) == 2
    assert len(p) == 30
    np.testing.assert_allclose(p.m.sum(), whole, rtol=1e-14)
    np.testing.assert_allclose(np.bincount(system.island_of_particle, p.m), whole / 2, rtol=0.02)
    assert len(p.surfaces["cloth"].triangles) == 32
    sound(system)
    halves = system_of(pm.cloth(3, 5, (1.0, 0.5)))  # each half has the springs of a cloth that was cut so
    for family, force in families(system).items():
        assert len(force.ids) == 2 * len(families(halves)[family].ids)


def test_nothing_happens_where_all_is_on_one_side() -> None:
    system = system_of(pm.cloth(3, 3, 1.0))
    for direction in ((1.0, 1.0, 0.0), (-1.0, -1.0, 0.0)):
        assert not len(cut(system, 2, np.array(direction)))  # a corner of one cell
    assert len(system.particles) == 9


def test_hinges_and_plates_follow_their_triangles() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    faces = pm.cloth(5, 5).particles.surfaces["cloth"].triangles
    mesh = TriangleMesh(np.stack([x.ravel(), -y.ravel(), 0 * x.ravel()], axis=1), faces)
    body = pm.cloth_from_mesh(mesh)
    listed = pm.PlateWind(faces.copy(), (1, 0, 5))
    system = system_of(body, pm.PlateWind("cloth", (1, 0, 5)), listed)
    hinges = next(f for f in system.forces if isinstance(f, pm.Hinges))
    p, before = system.particles, len(hinges.ids)
    wind = p.m @ system.deriv_eval().reshape(2, -1, 3)[1]
    cut(system, vertex(2, 2), np.array([0.0, 1.0, 0.0]))
    assert before - len(hinges.ids) == 2  # those of the two edges along which triangles came apart
    triangles = {tuple(sorted(t)) for t in p.surfaces["cloth"].triangles.tolist()}
    for a, b, c, d in hinges.ids.tolist():
        assert tuple(sorted((a, b, c))) in triangles
        assert tuple(sorted((a, b, d))) in triangles
    assert {tuple(sorted(t)) for t in listed.ids.tolist()} == triangles
    np.testing.assert_allclose(p.m @ system.deriv_eval().reshape(2, -1, 3)[1], wind, rtol=1e-12)  # it has the same hold
    assert np.abs(wind).max() > 1


def test_a_cut_by_itself_changes_no_force_energy_or_momentum() -> None:
    """Where nothing spans it: stiffness and mass are shared out."""
    body = pm.cloth(5, 5, 1.0, bend=0.0)
    body.forces = [f for f in body.forces if f.family == "stretch"]
    system = system_of(body)
    rng = np.random.default_rng(3)
    p = system.particles
    p.x += rng.normal(0, 0.02, p.x.shape)
    p.v[:] = rng.normal(0, 1, p.x.shape)

    def state() -> list[Any]:
        e = system.energy()
        f = system.deriv_eval().reshape(2, -1, 3)[1] * p.m[:, None]
        merged = f[:25].copy()
        merged[vertex(2, 2)] += f[25:].sum(axis=0)
        return [e.kinetic, e.potential, system.momentum(), system.angular_momentum(), merged]

    before = state()
    cut(system, vertex(2, 2), np.array([0.0, 1.0, 0.1]))
    assert len(p) == 26
    for a, b in zip(before, state(), strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-12)


# ------------------------------------------------------------------------------------------------------- in a run


def pulled(side: int = 8, compiled: bool = False, dtype: str = "float64", **options: Any) -> pm.Simulation:
    """A sheet between two rows that move apart."""
    body = pm.cloth(side, side, 1.0, pinned=["top edge", "bottom edge"], damping_ratio=0.3)
    scene = pm.Scene(
        bodies=[body],
        dt=DT,
        dtype=dtype,
        motions=[pm.RigidMotion("bottom edge", shift=(0, "-0.8*t", 0))],
        constraints=[pm.Tear(**{"strain": 0.1, "families": "stretch", **options})],
    )
    return pm.Simulation(
        (made := scene.simulation()).system,
        dt=DT,
        motions=made.motions,
        constraints=made.constraints,
        compiled=compiled,
    )


def test_a_sheet_that_is_pulled_apart_rips_and_no_mass_is_lost() -> None:
    sim = pulled(spread=0.2)
    p = sim.system.particles
    whole, held = p.m.sum(), p.x[p.groups["top edge"]].tobytes()
    sim.run(0.06)
    assert sim.constraints[0].breaks == 0  # 5%, and strengths are between 8% and 12%
    while pieces(sim.system) == 1 and sim.t < 0.4:
        sim.run(0.01)
    assert pieces(sim.system) > 1
    assert 7 <= sim.constraints[0].breaks < 60
    np.testing.assert_allclose(p.m.sum(), whole, rtol=1e-13)
    assert p.x[p.groups["top edge"]].tobytes() == held
    assert p.groups["cloth"].all()
    sound(sim.system)
    energy = sim.system.energy().total
    assert np.isfinite(energy)


def test_a_free_sheet_keeps_its_momentum_while_it_tears() -> None:
    """It flies apart: half of it to the left, half to the right."""
    body = pm.cloth(6, 6, 1.0)
    system = system_of(body)
    p = system.particles
    p.v[:, 0], p.v[:, 1] = 20 * np.sign(p.x[:, 0]), 2.0
    momentum, turn, whole = system.momentum(), system.angular_momentum(), p.m.sum()
    tear = pm.Tear(0.15)
    sim = pm.Simulation(system, dt=1e-4, constraints=[tear], compiled=False)
    sim.run(0.05)
    assert tear.breaks >= 6
    np.testing.assert_allclose(system.momentum(), momentum, atol=1e-12)
    np.testing.assert_allclose(system.angular_momentum(), turn, atol=1e-3 * whole)  # a step of order 1
    np.testing.assert_allclose(p.m.sum(), whole, rtol=1e-13)


def test_no_more_break_in_a_step_than_may() -> None:
    for most in (1, 3):
        sim = pulled(side=5, most=most)
        tear, counts = sim.constraints[0], [0]
        while tear.breaks == 0:
            sim.step()
        for _ in range(40):
            counts.append(tear.breaks)
            sim.step()
        assert 0 < np.diff(counts).max() <= most


def test_springs_off_surfaces_break_and_are_gone() -> None:
    """The weakest link of a chain: of two halves, one falls."""
    chain = pm.chain(6, 1.0, direction=(0, -1, 0), mass=0.6, k_s=200.0, damping_ratio=0.5)
    system = system_of(chain, pm.Gravity())
    sim = pm.Simulation(system, dt=1e-3, constraints=[pm.Tear(0.026)], compiled=False)
    springs, before = next(iter(families(system).values())), system.momentum()
    assert not before.any()
    sim.run(1.0)
    assert len(springs.ids) < 6
    assert len(system.particles) == 7
    assert system.particles.x[-1, 1] < -3
    version = system.particles.version
    sim.step()
    assert system.particles.version == version


def test_strengths_are_spread_by_the_seed_and_a_group_can_be_chosen() -> None:
    ends = []
    for seed in (1, 1, 2):
        sim = pulled(spread=0.3, seed=seed)
        sim.run(0.2)
        ends.append(sim.system.particles.x.tobytes())
    assert ends[0] == ends[1] != ends[2]
    sim = pulled(side=5, on="left edge")
    sim.run(0.3)
    p = sim.system.particles
    assert len(p) > 25
    assert p.groups["left edge"][25:].all()


def test_both_paths_tear_alike() -> None:
    ends = []
    for compiled in (False, True):
        sim = pulled(compiled=compiled, spread=0.2)
        sim.run(0.2)
        p = sim.system.particles
        assert sim.constraints[0].breaks > 5
        assert not sim.engine.lasting  # no kernel for each shape of a piece
        ends.append((p.id.tobytes(), p.x.tobytes(), p.surfaces["cloth"].triangles.tobytes()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("solver", ["implicit_euler", "bdf2", "leapfrog", "xpbd", "bogacki_shampine"])
def test_every_kind_of_solver_goes_on_with_what_is_torn(solver: str) -> None:
    made = pulled(side=5, spread=0.2)
    dt = DT if solver in ("leapfrog", "bogacki_shampine") else 1 / 480
    sim = pm.Simulation(
        made.system, solver, dt, motions=made.motions, constraints=[pm.Tear(0.1, "stretch")], compiled=False
    )
    whole = made.system.particles.m.sum()
    sim.run(0.25)
    assert sim.constraints[0].breaks >= 2
    np.testing.assert_allclose(made.system.particles.m.sum(), whole, rtol=1e-13)
    assert np.abs(made.system.particles.x).max() < 2


def test_who_comes_off_is_as_old_as_the_other_and_dies_with_it() -> None:
    """While others are born in the same steps."""
    body = pm.cloth(5, 5, 1.0, pinned=["top edge", "bottom edge"], damping_ratio=0.3)
    body.particles.lifetime = 0.3
    scene = pulled(side=5)
    made = pm.ParticleSystem(body.particles, body.forces)
    emitter = pm.Nozzle(rate=900, position=(5, 0, 0), speed=1.0, lifetime=10.0)
    sim = pm.Simulation(
        made, dt=DT, motions=scene.motions, emitters=[emitter], constraints=[pm.Tear(0.1, "stretch")], compiled=False
    )
    sim.run(0.28)
    p = made.particles
    old = p.id < 2**40
    assert old.sum() > 25
    assert (p.age[old] == p.age[0]).all()
    assert (~old).sum() == pytest.approx(252, abs=2)
    sim.run(0.03)
    assert (p.id >= 2**40).all()


def test_single_precision_tears_too() -> None:
    sim = pulled(side=5, dtype="float32", spread=0.2)
    sim.run(0.25)
    assert sim.constraints[0].breaks >= 2
    assert sim.system.particles.x.dtype == np.float32
    sound(sim.system)


class Refuses(pm.Constraint):
    """Holds until somebody has come off."""

    def bind(self, system: pm.ParticleSystem) -> None:
        self.count = len(system.particles)

    def enforce(self, system: pm.ParticleSystem, step: Any) -> None:
        if len(system.particles) > self.count:
            raise pm.Diverged("no room for more")


@pytest.mark.parametrize("compiled", [False, True])
def test_a_constraint_that_fails_after_a_tear_is_told_of(compiled: bool) -> None:
    made = pulled(side=5)
    sim = pm.Simulation(
        made.system, dt=DT, motions=made.motions, constraints=[made.constraints[0], Refuses()], compiled=compiled
    )
    with pytest.raises(pm.Diverged, match="no room for more"):
        sim.run(0.3)
    assert len(made.system.particles) == 25


def test_frames_and_caches_follow_a_surface_that_changes(tmp_path: Any) -> None:
    body = pm.cloth(6, 6, 1.0, pinned=["top edge", "bottom edge"], damping_ratio=0.3)
    scene = pm.Scene(
        bodies=[body],
        dt=DT,
        motions=[pm.RigidMotion("bottom edge", shift=(0, "-2*t", 0))],
        constraints=[pm.Tear(0.1, "stretch", spread=0.2)],
    )
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    sim = scene.simulation()
    frames = list(sim.frames(10, 59.0))  # between steps
    counts = [len(f.positions) for f in frames]
    assert counts[0] == 36 < counts[-1]
    for frame in frames:
        cloth = next(d for d in frame.drawables if d.name == "cloth")
        assert cloth.faces.max() == len(frame.positions) - 1
        assert len(cloth.faces) == 50
        assert np.isfinite(frame.positions).all()
    stored = pm.record(again.simulation(), tmp_path / "torn.zarr", frames=10, fps=59.0)
    for frame, read in zip(frames, stored, strict=True):
        assert frame.positions.tobytes() == read.positions.tobytes()
        for name in ("cloth",):
            mine, its = (next(d for d in f.drawables if d.name == name) for f in (frame, read))
            np.testing.assert_array_equal(mine.faces, its.faces)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.Tear(0), "strain = 0 is not allowed"),
        (lambda: pm.Tear(spread=1.5), "spread = 1.5 is not allowed"),
        (lambda: pm.Tear(most=0), "most = 0 is not allowed"),
        (lambda: pm.Tear(on=[1, 2]), "it must be the name of a body or group"),
        (lambda: pulled(families="bend"), "has no spring that could break"),
        (lambda: pulled(families="seam"), "unknown family of springs 'seam'"),
        (lambda: pulled(on="collar"), "unknown group of particles 'collar'"),
        (
            lambda: pm.Simulation(
                system_of(pm.cloth(3, 3), pm.Gravity(np.tile([0, -1, 0], (9, 1)))), constraints=[pm.Tear()]
            ),
            "has a number for each particle",
        ),
        (
            lambda: pm.Simulation(system_of(pm.cloth(3, 3), pm.Springs([(0, 8)], "1 + t")), constraints=[pm.Tear()]),
            "must not be a function of t|not allowed to be a function of t",
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make: Any, says: str) -> None:
    with pytest.raises(pm.InvalidInput, match=says):
        make()
