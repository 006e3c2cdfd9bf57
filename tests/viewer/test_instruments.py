from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.cache import Cache
from pointmass.colors import palette
from pointmass.errors import InvalidInput
from pointmass.frame import Points, Segments, Triangles
from pointmass.scenes import SCENES
from pointmass.viewer.inputs import Hold, Solve
from pointmass.viewer.instruments import Instruments
from pointmass.viewer.live import Live
from pointmass.viewer.messages import Dismiss, Inspect, Lens, Plot, Vectors
from pointmass.viewer.playback import Playback
from pointmass.viewer.residual import residual
from pointmass.viewer.subject import Subject


class Looked:
    """A scene with its instruments."""

    def __init__(self, name, **settings):
        self.live = Live(Subject.of_shipped(SCENES[name](**settings)))
        self.instruments = Instruments(self.live)
        self.frames = [self.live.start()]
        self.shown, self.readings = self.instruments.look(self.frames[0], fresh=True)

    @property
    def system(self):
        return self.live.sim.system

    def go(self, frames=1):
        for _ in range(frames):
            self.frames.append(self.live.advance(1.0))
            self.shown, self.readings = self.instruments.look(self.frames[-1], fresh=True)

    def take(self, message, row=-1):
        assert self.instruments.take(message, self.frames[-1], row)
        self.shown, self.readings = self.instruments.look(self.frames[-1], fresh=False)

    def column(self, plot, name):
        rows = self.readings.tracks[0].since(None)
        number = [(c.plot, c.name) for c in rows.columns].index((plot, name))
        return rows.data[:, 0], rows.data[:, number + 1]

    def drawn(self, kind):
        return next(d for d in self.shown.drawables if isinstance(d, kind) and d.name != "plane 0")


def test_what_is_plotted_is_what_frames_say():
    it = Looked("pendulum")
    it.go(5)
    for plot, name, quantity in [
        ("energy", "total", "energy"),
        ("energy", "kinetic", "kinetic"),
        ("energy", "potential", "potential"),
        ("momentum", "y", "momentum_y"),
        ("largest stretch", "stretch", "stretch"),
    ]:
        time, values = it.column(plot, name)
        np.testing.assert_array_equal(time, [f.time for f in it.frames])
        np.testing.assert_array_equal(values, [f.quantities[quantity] for f in it.frames])
    time, step = it.column("step size", "mean")
    np.testing.assert_allclose(step[1:], it.live.sim.dt)


def test_the_energy_of_each_force_is_plotted_by_its_name():
    it = Looked("pendulum")
    it.go(5)
    p, system = it.system.particles, it.system
    time, gravity = it.column("energy", "gravity")
    assert gravity[-1] == pytest.approx(9.81 * float(np.sum(p.m * p.x[:, 1])), rel=1e-9)
    springs = next(f for f in system.forces if isinstance(f, pm.Springs))
    stretched = springs.values(p, p.x) - springs.rests(p, system.t)
    k_s = np.broadcast_to(springs.parameters["k_s"].components[0].value, stretched.shape)
    assert it.column("energy", "springs")[1][-1] == pytest.approx(float(0.5 * np.sum(k_s * stretched**2)), rel=1e-6)
    total = it.column("energy", "potential")[1]
    np.testing.assert_allclose((gravity + it.column("energy", "springs")[1])[1:], total[1:], rtol=1e-12)
    assert np.isnan(it.column("energy", "mouse spring")[1]).all()
    row = len(p) - 1
    it.live.apply(Hold(int(p.id[row]), tuple(p.x[row] + (0.1, 0, 0))))
    it.go()
    mouse = it.column("energy", "mouse spring")[1]
    assert len(mouse) == len(time) + 1  # nothing that was plotted is forgotten
    gap = np.subtract(it.live.target, p.x[row])
    k_m = system.forces[-1].parameters["k_s"].components[0].value
    assert mouse[-1] == pytest.approx(0.5 * k_m * gap @ gap)


def test_the_only_force_with_energy_is_no_line_of_its_own():
    it = Looked("bounce")
    it.go()
    assert it.frames[-1].quantities["potential_gravity"] == it.frames[-1].quantities["potential"] != 0
    assert np.isnan(it.column("energy", "gravity")[1]).all()


def test_steps_and_iterations_are_those_of_the_solver():
    subject = Subject.of_shipped(
        SCENES["springs"](side=3), lambda scene: scene.changed(solver=pm.ImplicitEuler(), dt=1 / 60)
    )
    it = Looked.__new__(Looked)
    it.live = Live(subject)
    it.instruments, it.frames = Instruments(it.live), []
    it.frames.append(it.live.start())
    it.instruments.look(it.frames[0], fresh=True)
    before = it.live.sim.engine.stats
    it.go()
    after = it.live.sim.engine.stats
    steps = after.steps - before.steps
    for name, field in [("Newton", "iterations"), ("conjugate gradients", "cg_iterations")]:
        count = getattr(after, field) - getattr(before, field)
        assert it.column("iterations in a step", name)[1][-1] == count / steps
    assert after.iterations > before.iterations
    assert it.column("step size", "mean")[1][-1] == pytest.approx(1 / 60)


def test_an_expression_is_plotted_until_it_is_taken_away():
    it = Looked("pendulum")
    it.go(2)
    it.take(Plot(text="mean(y)", on=True))
    it.go(3)
    time, values = it.column("mean(y)", "mean(y)")
    np.testing.assert_array_equal(time, [f.time for f in it.frames[-3:]])
    np.testing.assert_allclose(values, [f.positions[:, 1].mean() for f in it.frames[-3:]])
    with pytest.raises(InvalidInput, match="gather"):
        it.take(Plot(text="y", on=True))
    assert it.instruments.message.expressions == ["mean(y)"]
    it.take(Plot(text="mean(y)", on=False))
    assert it.instruments.message.expressions == []
    for k in range(8):
        it.take(Plot(text=f"mean(y) + {k}", on=True))
    with pytest.raises(InvalidInput, match="8 expressions"):
        it.take(Plot(text="mean(x)", on=True))


def test_pages_get_the_rows_that_they_have_not():
    it = Looked("pendulum")
    it.go(3)
    track = it.readings.tracks[0]
    first = track.since(None)
    assert len(first.data) == 4
    it.go(2)
    second = track.since(first.mark)
    np.testing.assert_array_equal(second.data[:, 0], [f.time for f in it.frames[-2:]])
    assert len(track.since(second.mark).data) == 0
    it.frames = [it.live.start()]  # time goes back: it begins anew
    it.instruments.look(it.frames[0], fresh=True)
    third = track.since(second.mark)
    assert third.generation != second.generation
    assert third.data[:, 0].tolist() == [0.0]


def test_a_picked_particle_has_its_numbers_and_its_springs():
    it = Looked("springs", side=3)
    it.go(2)
    row = 13
    it.take(Inspect(sequence=1, row=row), row)
    it.go(2)
    frame, picked, p = it.frames[-1], it.readings.inspected, it.system.particles
    it.system.deriv_eval(frame.time, np.concatenate([frame.positions.ravel(), frame.velocities.ravel()]))
    assert picked.row == row
    assert picked.id == str(p.id[row])
    assert picked.mass == p.m[row]
    assert picked.position == tuple(frame.positions[row])
    assert picked.velocity == tuple(frame.velocities[row])
    np.testing.assert_allclose(picked.force, p.f[row], rtol=1e-9)
    joined = [
        pair for f in it.system.forces if getattr(f, "nodes", 0) == 2 for pair in f.ids.tolist() if p.id[row] in pair
    ]
    assert picked.springs == len(joined) > 3
    lines = next(d for d in it.shown.drawables if d.name == "springs of the picked particle")
    np.testing.assert_array_equal(p.id[lines.pairs], joined)
    track = it.readings.tracks[1].since(None)
    wanted = [[f.time, *f.positions[row], *f.velocities[row]] for f in it.frames[-2:]]
    np.testing.assert_array_equal(track.data, wanted)
    it.take(Dismiss())
    assert it.readings.inspected is None


def test_a_picked_particle_may_die():
    it = Looked("springs", side=3)
    it.take(Inspect(sequence=1, row=5), 5)
    assert it.readings.inspected.row == 5
    it.system.remove([5])
    it.go()
    assert it.readings.inspected.row == -1
    assert it.readings.inspected.id == "5"


@pytest.mark.parametrize("name", ["speed", "force", "age"])
def test_particles_have_the_colours_of_their_numbers(name):
    it = Looked("springs", side=3)
    it.go(3)
    before = {d.name: d.version for d in it.shown.drawables}
    it.take(Lens(name=name))
    frame, p = it.frames[-1], it.system.particles
    it.system.deriv_eval(frame.time, np.concatenate([frame.positions.ravel(), frame.velocities.ravel()]))
    vectors = {"speed": frame.velocities, "force": p.f}.get(name)
    value = p.age if vectors is None else np.linalg.norm(vectors, axis=1)
    legend, points = it.readings.legend, it.drawn(Points)
    assert legend.high == pytest.approx(np.percentile(value, 98))
    np.testing.assert_allclose(points.color, palette("viridis", value / legend.high), atol=1e-6)
    assert points.version not in before.values()
    it.take(Lens(name=""))
    assert it.readings.legend is None
    assert {d.name: d.version for d in it.shown.drawables} == before


def test_springs_have_the_colours_of_their_stretch():
    it = Looked("springs", side=3)
    it.go(5)
    it.take(Lens(name="stretch"))
    frame, lines = it.frames[-1], it.drawn(Segments)
    rests = np.concatenate([f.rests(it.system.particles, 0.0) for f in it.system.forces if hasattr(f, "rests")])
    length = np.linalg.norm(np.diff(frame.positions[lines.pairs], axis=1)[:, 0], axis=1)
    value = np.abs(length - rests) / rests
    assert value.max() == pytest.approx(it.system.stretch())
    np.testing.assert_allclose(lines.color, palette("viridis", value / it.readings.legend.high), atol=1e-6)


def test_a_cloth_under_the_lens_of_springs_is_its_springs():
    it = Looked("cloth", particles=8)
    it.go()
    it.take(Lens(name="speed"))
    assert it.drawn(Triangles).color.shape == (64, 4)
    it.take(Lens(name="stretch"))
    assert not [d for d in it.shown.drawables if isinstance(d, Triangles) and d.vertices is None]
    assert len(it.drawn(Segments).pairs) == sum(len(f.ids) for f in it.system.forces if getattr(f, "nodes", 0) == 2)


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.RK4()])
def test_the_limit_is_that_of_the_stability_lens(solver):
    subject = Subject.of_shipped(SCENES["springs"](side=3), lambda scene: scene.changed(solver=solver))
    live = Live(subject)
    instruments = Instruments(live)
    frame = live.start()
    instruments.take(Lens(name="limit"), frame, -1)
    shown, readings = instruments.look(frame, fresh=True)
    lines = next(d for d in shown.drawables if isinstance(d, Segments))
    tables = [t for t in live.sim.system.stability(solver).elements if t.ids.shape[1] == 2]
    exact = np.concatenate([t.share_together(live.sim.dt) for t in tables])
    found = np.concatenate(
        [t.share_together(live.sim.dt) for t in instruments._lens._limits._known[0].tables if t.ids.shape[1] == 2]
    )
    factor = found / exact  # the bound: the same springs are nearest, and none is shown as safer than it is
    assert factor.min() == pytest.approx(factor.max())
    assert 1.0 - 1e-9 <= factor.min() < 2.0
    np.testing.assert_allclose(lines.color, palette("viridis", found / 1.2), atol=1e-6)
    assert (readings.legend.high, readings.legend.mark) == (1.2, 1.0)


def sheet(solver):
    """A cloth under a solver, after a frame."""
    it = Looked.__new__(Looked)
    subject = Subject.of_shipped(SCENES["cloth"](particles=8), lambda scene: scene.changed(solver=solver, dt=1 / 60))
    it.live = Live(subject)
    it.instruments = Instruments(it.live)
    it.frames = [it.live.start()]
    it.shown, it.readings = it.instruments.look(it.frames[0], fresh=True)
    it.go()
    return it


@pytest.mark.parametrize("newton", ["one", "full"])
def test_the_residual_is_what_the_next_step_leaves(newton):
    it = sheet(pm.ImplicitEuler(newton=newton))
    it.take(Lens(name="residual"))
    found, p = residual(it.live.sim), it.system.particles
    assert it.readings.legend.high == pytest.approx(np.percentile(found, 98))
    v, h = p.v.copy(), it.live.sim.dt
    it.live.sim.step()
    acceleration = it.system.deriv_eval()[p.v.size :].reshape(-1, 3)
    gap = np.where(p.pinned[:, None], 0, p.v - v - h * acceleration)
    wanted = np.linalg.norm(gap, axis=1) / (np.abs(v).max() + np.abs(p.v - v).max())
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-15)
    if newton == "full":
        assert found.max() < math.sqrt(3) * 1e-10  # the solver's tolerance, for each of three components
    else:
        assert found.max() > 1e-4  # a single step is left with what is not linear


@pytest.mark.parametrize(("links", "sweeps", "most"), [(1, 1, 1e-13), (5, 1, None), (5, 16, 1e-13)])
def test_sweeps_of_xpbd_leave_ever_less_of_backward_euler(links, sweeps, most):
    """On a line, where forces keep their directions, the limit is backward Euler: nothing is left of it."""

    def left(sweeps):
        pairs = [(k, k + 1) for k in range(links)]
        springs = pm.Springs(pairs, k_s=900.0, k_d=0.1, rest=1.0)
        body = pm.body_of(pm.Particles([(1.3 * k, 0, 0) for k in range(links + 1)]), [springs])
        return residual(pm.Scene(bodies=[body], dt=1 / 60, solver=pm.XPBD(sweeps)).simulation()).max()

    if most is None:
        assert left(sweeps) > 2 * left(2 * sweeps) > 0
    else:
        assert left(sweeps) < most


@pytest.mark.parametrize("solver", [pm.ImplicitEuler(), pm.BDF2(), pm.ImplicitMidpoint()])
def test_implicit_solvers_leave_no_more_than_their_tolerance(solver):
    """Also with a history, and with a stage within the step: it is the solver's own equation."""
    springs = pm.Springs([(0, 1), (1, 2)], k_s=900.0, k_d=0.1, rest=1.0)
    body = pm.body_of(pm.Particles([(0, 0, 0), (1.2, 0, 0), (1.2, 1.2, 0)]), [springs])
    sim = pm.Scene(bodies=[body], forces=[pm.Gravity()], dt=1 / 60, solver=solver).simulation()
    for _ in range(3):
        sim.step()
        assert residual(sim).max() < math.sqrt(3) * solver.tolerance


def test_who_touches_a_surface_has_no_residual():
    body = pm.body_of(pm.Particles([(0, 0.1, 0), (0, 5, 0)], radius=0.1))
    scene = pm.Scene(bodies=[body], forces=[pm.Gravity()], colliders=[pm.Plane()], dt=1 / 60, solver=pm.ImplicitEuler())
    np.testing.assert_array_equal(np.isnan(residual(scene.simulation())), [True, False])


def test_the_residual_is_there_where_a_solver_has_equations_to_solve():
    it = Looked("pendulum")
    assert "residual" not in [c.name for c in it.instruments.message.lenses]
    with pytest.raises(InvalidInput, match="unknown lens 'residual'"):
        it.take(Lens(name="residual"))
    it.live.apply(Solve("implicit_euler", 0.0))
    it.take(Lens(name="residual"))
    it.take(Plot(text="max(residual)", on=True))
    it.go()
    assert it.readings.legend.title == "residual"
    assert it.column("max(residual)", "max(residual)")[1][-1] == pytest.approx(residual(it.live.sim).max())
    it.live.apply(Solve("rk4", 0.0))
    it.instruments.heed()
    it.go()
    assert it.instruments.message.lens == ""
    assert it.readings.legend is None


@pytest.mark.parametrize("solver", [pm.ImplicitEuler(), pm.BDF2(), pm.XPBD()])
def test_the_residual_changes_no_bit_of_a_run(solver):
    plain, watched = sheet(solver), sheet(solver)
    watched.take(Lens(name="residual"))
    for it in (plain, watched):
        it.go(3)
    assert plain.system.get_state().tobytes() == watched.system.get_state().tobytes()
    assert plain.frames[-1].positions.tobytes() == watched.frames[-1].positions.tobytes()


def test_arrows_are_along_velocities_and_forces():
    it = Looked("springs", side=3)
    it.go(2)
    it.take(Vectors(name="velocity", on=True))
    it.take(Vectors(name="force", on=True))
    assert it.instruments.message.shown == ["velocity", "force"]
    frame, p = it.frames[-1], it.system.particles
    it.system.deriv_eval(frame.time, np.concatenate([frame.positions.ravel(), frame.velocities.ravel()]))
    for name, vectors in [("velocity", frame.velocities), ("force", p.f)]:
        arrows = next(d for d in it.shown.drawables if d.name == f"{name} arrows")
        factor = np.linalg.norm(arrows.vectors) / np.linalg.norm(vectors)
        np.testing.assert_allclose(arrows.vectors, factor * vectors, rtol=1e-5, atol=1e-7)
    it.take(Vectors(name="velocity", on=False))
    assert it.instruments.message.shown == ["force"]


def test_contacts_are_where_particles_touch_with_what_they_press():
    m, g, radius = 2.0, 9.81, 0.1
    places = [(0, radius, 0), (1, 1, 0), (0, radius, -2 + radius)]  # on the floor, in the air, and in a corner
    body = pm.body_of(pm.Particles(places, m=m, radius=radius))
    walls = [pm.Plane(), pm.Plane((0, 0, -2), (0, 0, 1))]
    scene = pm.Scene(bodies=[body], forces=[pm.Gravity((0, -g, 0))], colliders=walls)
    live = Live(Subject.of_scene(scene))
    instruments, frame = Instruments(live), live.start()
    assert instruments.take(Vectors(name="contact", on=True), frame, -1)
    shown, _ = instruments.look(frame, fresh=True)
    arrows = next(d for d in shown.drawables if d.name == "contact arrows")
    np.testing.assert_allclose(arrows.vertices, [(0, 0, 0), (0, 0, -2 + radius), (0, radius, -2)], atol=1e-6)
    factor = arrows.vectors[0, 1] / (m * g)
    assert factor > 0
    np.testing.assert_allclose(arrows.vectors, factor * m * g * np.array([(0, 1, 0), (0, 1, 0), (0, 0, 0)]), atol=1e-6)
    dots = next(d for d in shown.drawables if d.name == "contacts")
    np.testing.assert_array_equal(dots.vertices, arrows.vertices)


def test_contacts_are_shown_where_there_are_surfaces():
    assert "contact" in [c.name for c in Looked("bounce", balls=3).instruments.message.vectors]
    assert "contact" not in [c.name for c in Looked("pendulum").instruments.message.vectors]


def test_instruments_change_no_bit_of_a_run():
    plain, watched = Looked("springs", side=3), Looked("springs", side=3)
    for message in (Lens(name="limit"), Vectors(name="force", on=True), Plot(text="max(force)", on=True)):
        watched.take(message)
    watched.take(Inspect(sequence=1, row=3), 3)
    plain.go(6)
    watched.go(6)
    assert plain.system.get_state().tobytes() == watched.system.get_state().tobytes()


def test_a_flow_has_no_forces():
    it = Looked("flow")
    assert [c.name for c in it.instruments.message.lenses] == ["speed", "age", "divergence", "curl"]
    assert "force" not in [c.name for c in it.instruments.message.vectors]
    for message in (Lens(name="force"), Vectors(name="force", on=True)):
        with pytest.raises(InvalidInput, match="unknown"):
            it.take(message)
    it.take(Lens(name="speed"))
    it.take(Inspect(sequence=1, row=2), 2)
    assert it.readings.inspected.force is None


@pytest.mark.parametrize("name", ["hair", "fireworks"])
def test_every_kind_of_look_is_seen_through_every_lens(name):
    it = Looked(name)
    it.go(1)
    for choice in it.instruments.message.lenses:
        it.take(Lens(name=choice.name))
        it.go()
        assert it.readings.legend.title == choice.title


def test_a_cache_is_looked_at_too(tmp_path):
    pm.record(SCENES["springs"](side=3).build().simulation(), tmp_path / "a.zarr", frames=3)
    playback = Playback(Cache.open(tmp_path / "a.zarr"))
    instruments = Instruments(playback)
    frame = playback.start()
    assert [c.name for c in instruments.message.lenses] == ["speed"]
    for message in (Lens(name="speed"), Plot(text="max(speed)", on=True)):
        assert instruments.take(message, frame, -1)
    assert instruments.take(Inspect(sequence=1, row=2), frame, 2)
    frame = playback.advance(1.0)
    _, readings = instruments.look(frame, fresh=True)
    assert readings.inspected.velocity == tuple(frame.velocities[2])
    assert readings.inspected.force is None
    speed = np.linalg.norm(frame.velocities, axis=1)
    assert readings.legend.high == pytest.approx(np.percentile(speed, 98))
    rows = readings.tracks[0].since(None)
    number = [c.name for c in rows.columns].index("max(speed)")
    assert rows.data[-1, number + 1] == pytest.approx(speed.max())
