"""The printed functions of colliders against the reference path: the same bits, and nothing is clear that is not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.collisions.swept import Paths, first_hit
from pointmass.engine import store
from pointmass.engine.contact import ContactText
from pointmass.engine.reference import KILLED, ReferenceEngine, surfaces_of
from pointmass.solvers import SOLVERS
from tests import naive
from tests.shapes import SHEET, TETRAHEDRON

PLATE = [[-1, 0.3, -1], [-1, 0.3, 1], [0.4, 0, 1], [0.4, 0, -1]]
WORLDS = {
    "floor": lambda **k: [pm.Plane(normal=(0.1, 1, 0), **k)],
    "room": lambda **k: [pm.Box(size=(2, 2, 2), inside=True, **k)],
    "ball": lambda **k: [pm.Sphere(center=(0, -1, 0), radius=0.9, **k), pm.Plane((0, -1, 0), **k)],
    "bowl": lambda **k: [pm.Sphere(radius=1.1, inside=True, **k)],
    "block": lambda **k: [pm.Box(center=(0, -1, 0), size=(1.5, 1.8, 1.2), **k)],
    "plates": lambda **k: [pm.Polygon(PLATE, **k), pm.Polygon(PLATE[:3], shift=(0, "-0.5*t", 0.2), thickness=0.1, **k)],
    "wedge": lambda **k: [pm.Plane(normal=(s, 0.3, 0), **k) for s in (1, -1)],
    "press": lambda **k: [pm.Plane((0, "-1+t", 0), **k), pm.Plane((0, "1-t", "t"), (0, -1, 0.1), **k)],
    "paddle": lambda **k: [pm.Sphere(center=("sin(9*t)", 0, "0.2*t"), radius=0.5, **k), pm.Plane((0, -1, 0), **k)],
    "lift": lambda **k: [pm.Box(center=(0, "-1+0.3*sin(8*t)", 0), size=(1, 1.8, 1), **k)],
}
ROD = {"a": (-0.7, -0.4, 0.3), "b": (0.8, -0.1, -0.2)}
WORLDS["round"] = lambda **k: [
    pm.Capsule(**ROD, radius=0.4, **k),
    pm.Cylinder(**ROD, radius=0.5, shift=(0, "-0.6+0.2*sin(8*t)", 0), **k),
    pm.Capsule((0, -0.5, 0), (0, 0.5, 0.1), radius=1.5, inside=True, **k),
    pm.Cylinder((0, -1.2, 0), (0.1, 1.4, 0), radius=1.3, inside=True, **k),
    pm.Cylinder((0.8, 0.8, 0), (1, 1, 0.3), radius=0.2, **k),
]
HILLS = 0.3 * np.sin(np.arange(7))[:, None] * np.cos(np.arange(6))
WORLDS["meshes"] = lambda **k: [pm.Mesh(TETRAHEDRON, **k), pm.Mesh(SHEET, shift=(0, "1.2+0.2*sin(8*t)", 0), **k)]
WORLDS["hills"] = lambda **k: [pm.HeightField(HILLS, (2.5, 2.5), **k), pm.Plane((0, -1.2, 0), **k)]
PEBBLE = np.linalg.norm(np.indices((9, 9, 9)) - 4.0, axis=0) / 4 - 0.6
WORLDS["pebbles"] = lambda **k: [
    pm.DistanceGrid(PEBBLE, spacing=0.25, shift=("0.1*sin(8*t)", 0, 0), **k),
    pm.DistanceGrid(3.2 * PEBBLE, spacing=0.8, inside=True, **k),
    pm.HeightField(HILLS, (2.5, 2.5), shift=(0, -1.4, 0), **k),
]
WORLDS["pillars"] = lambda **k: [
    *(pm.Capsule((np.cos(a), -0.9, np.sin(a)), (np.cos(a), 0.6, np.sin(a)), radius=0.2, **k) for a in range(5)),
    pm.Capsule((0, -0.5, 0), (0.2, 0.5, 0), radius=0.2, shift=("0.3*sin(8*t)", 0, 0), **k),
    *(pm.Sphere((0.5 * a - 1, -1, 0.1 * a), radius=0.2, **k) for a in range(5)),
]
WORLDS["everything"] = lambda **k: [c for name in ("room", "ball", "paddle", "plates") for c in WORLDS[name](**k)]
FLOATS = st.floats(-1.4, 1.4)
POINTS = st.tuples(FLOATS, FLOATS, FLOATS)


@cache
def printed(text, dtype="float64"):
    return store.plain("contacts", text, dtype)


def compiled(text):
    """The functions, each to be called from Python."""
    return vars(store.load("contacts", text.replace("**FLAGS", "**ENTRY").replace("**APART", "**ENTRY"), "float64"))


class Filter:
    """Contacts of all particles, each on its own."""

    def __init__(self, engine):
        self.engine = engine

    def forces(self, t, x, v, m, f):
        e = self.engine
        for i in range(len(x)):
            now = t[i] if isinstance(t, np.ndarray) else t
            f[i] = e.do["bear"](e.table, e.scratch, i * e.text.record, now, *x[i], *v[i], m[i], *f[i])

    def projection(self, n):
        e = self.engine
        blocks = np.zeros((n, 9))
        for i in range(n):
            e.do["project"](e.table, e.scratch, i * e.text.record, blocks[i], np.zeros(18))
        return blocks.reshape(n, 3, 3)

    def drag(self, n):
        e = self.engine
        return np.array([e.do["drag_of"](e.scratch, i * e.text.record) for i in range(n)])


class ScalarEngine(ReferenceEngine):
    """The reference engine with its collisions made by the printed functions, particle by particle."""

    def __init__(self, system, solver, functions=None):
        super().__init__(system, solver)
        self.text = ContactText(surfaces_of(system), system.order, solver.implicit, "float64")
        self.do = functions(self.text.text) if functions else printed(self.text.text)
        self.table = self.text.table()
        self.scratch = np.zeros(len(system.particles) * self.text.record)

    def _prepare(self, clock, h, y):
        system, p, do = self.system, self.system.particles, self.do
        y = y.copy()
        x, v = system.split(y)
        t = clock[self._islands]
        system.filter = None
        system.clear_forces()
        system.calculate_forces(t, x, v)
        a = p.f * p.w[:, None] if system.order == 2 else p.f.copy()
        for i in range(len(p)):
            o = i * self.text.record
            self.scratch[o] = 0
            if (
                h[self._islands[i]] > 0
                and not p.pinned[i]
                and do["near"](self.table, self.scratch, o, t[i], *x[i], p.radius[i])
            ):
                braking = 0.0 if self._alone[i] else self.solver.braking * h[self._islands[i]]
                state = *x[i], *v[i], p.m[i], *a[i], p.radius[i]
                v[i] = do["find"](self.table, self.scratch, o, t[i], *state, braking)
        system.filter = Filter(self) if self.scratch[:: self.text.record].any() else None
        return y

    def _collide(self, step, h):
        system, p, do, islands = self.system, self.system.particles, self.do, self._islands
        clock, reset = np.full(len(h), np.nan), np.zeros(len(h), bool)
        length = h[islands]
        start = np.broadcast_to(step.t, system.dim)[: 3 * len(p) : 3]
        end = start + length
        y = step.y1.copy()
        x, v = system.split(y)
        x0, v0 = system.split(step.y0)
        moved = np.flatnonzero((length > 0) & ~p.pinned)
        now, linked = end.copy(), []
        doomed = np.zeros(len(p), bool)
        for i in moved:
            o, radius = i * self.text.record, p.radius[i]
            x[i], v[i] = np.reshape(
                do["settle"](self.table, self.scratch, o, end[i], length[i], *x[i], *v[i], radius), (2, 3)
            )
            if self.text.discrete:
                *state, hit = do["bounce"](self.table, self.scratch, o, end[i], *x[i], *v[i], radius)
                reset[islands[i]] |= hit > 0
                doomed[i] = hit >= KILLED
                x[i], v[i] = np.reshape(state, (2, 3))
        planned = x.copy(), v.copy()
        for i in moved:
            o, radius = i * self.text.record, p.radius[i]
            *state, now[i], events, gx, gy, gz = do["strike"](
                self.table, self.scratch, o, bool(self._alone[i]), int(self._events[i]), *x0[i], *v0[i], *x[i], *v[i],
                start[i], length[i], radius,
            )  # fmt: skip
            if events > self._events[i]:
                self._events[i], self._ground[i] = events, (gx, gy, gz)
                reset[islands[i]] = True
                if not self._alone[i] and events <= 8:
                    linked.append(i)
            x[i], v[i] = np.reshape(state, (2, 3))
            if now[i] < end[i]:
                clock[islands[i]] = now[i]
        self._events[doomed & ~(now < end)] += KILLED
        if linked:
            rows = np.array(linked)
            chord = (planned[0] - x0)[rows] / length[rows][:, None]
            self._pay(rows, chord, planned, x, v, end)
        began, when = self._began
        for i in moved:
            x[i], v[i] = np.reshape(
                do["evict"](
                    self.table,
                    self.scratch,
                    i * self.text.record,
                    now[i],
                    *x[i],
                    *v[i],
                    p.radius[i],
                    *began[i],
                    when[i],
                ),
                (2, 3),
            )
        self._keep(step, h, 0.0)
        system.filter = None
        return y, clock, reset


def pair_of_engines(world, contact, solver, x, v, radius, m, forces, functions=None, **material):
    engines = []
    for kind in (ReferenceEngine, lambda *a: ScalarEngine(*a, functions)):
        particles = pm.Particles(np.atleast_2d(x), np.atleast_2d(v), radius=radius, m=m)
        made = [pm.Springs([(0, 1)], k_s=20.0)] if len(particles) > 1 else []
        system = pm.ParticleSystem(particles, [*forces(), *made], WORLDS[world](contact=contact, **material))
        engines.append(kind(system, solver))
    return engines


def same_steps(engines, dt, steps):
    for k in range(steps):
        ends = []
        for e in engines:
            try:
                e.step(k * dt, (k + 1) * dt)
            except pm.Diverged as error:
                ends.append(str(error))
            else:
                ends.append(e.system.get_state())
        np.testing.assert_array_equal(ends[0], ends[1])
        np.testing.assert_array_equal(engines[0].died, engines[1].died)
        if isinstance(ends[0], str):
            return


@settings(max_examples=60, deadline=None)
@given(
    world=st.sampled_from(sorted(WORLDS)),
    contact=st.sampled_from(["swept", "swept", "discrete"]),
    name=st.sampled_from(["symplectic_euler", "leapfrog", "rk4", "dopri5", "implicit_euler", "bdf2"]),
    x=POINTS,
    v=POINTS,
    speed=st.sampled_from([0.0, 1.0, 30.0, 1e3]),
    radius=st.sampled_from([0.0, 0.05]),
    tilt=st.sampled_from([0.0, 3.0]),
    friction=st.sampled_from([0.0, 0.3, 2.0]),
    restitution=st.sampled_from([0.0, 0.4, 1.0]),
    response=st.sampled_from(["bounce", "bounce", "bounce", "stick", "slide", "kill"]),
    dt=st.sampled_from([1 / 20, 1 / 100, 1 / 240]),
)
def test_the_same_bits(world, contact, name, x, v, speed, radius, tilt, friction, restitution, response, dt):
    def forces():
        return [pm.Gravity((tilt, -9.81, 0.3 * tilt)), pm.Drag(0.1)]

    engines = pair_of_engines(
        world, contact, SOLVERS[name](), x, speed * np.array(v), radius, 0.7, forces,
        friction=friction, restitution=restitution, response=response,
    )  # fmt: skip
    same_steps(engines, dt, 12)


@settings(max_examples=20, deadline=None)
@given(world=st.sampled_from(sorted(WORLDS)), seed=st.integers(0, 2**32 - 1), speed=st.sampled_from([1.0, 30.0, 1e3]))
def test_linked_particles_finish_their_step(world, seed, speed):
    rng = np.random.default_rng(seed)
    x, v = rng.uniform(-1.4, 1.4, (2, 3)), speed * rng.normal(size=(2, 3))
    engines = pair_of_engines(world, "swept", pm.Leapfrog(), x, v, 0.02, 0.7, lambda: [pm.Gravity()])
    same_steps(engines, 1 / 100, 8)


@settings(max_examples=20, deadline=None)
@given(
    world=st.sampled_from(sorted(WORLDS)), contact=st.sampled_from(["swept", "discrete"]),
    name=st.sampled_from(["euler", "rk4", "implicit_euler"]), x=POINTS, radius=st.sampled_from([0.0, 0.05]),
    response=st.sampled_from(["bounce", "stick", "kill"]),
)  # fmt: skip
def test_a_flow(world, contact, name, x, radius, response):
    engines = pair_of_engines(
        world, contact, SOLVERS[name](), x, (0, 0, 0), radius, 1.0,
        lambda: [pm.Flow(velocity=("sin(3*y)", -1.0, 0.5))], response=response,
    )  # fmt: skip
    same_steps(engines, 1 / 30, 8)


def far_and_near(world, seed, n):
    """Paths of many kinds: slow and fast, grazing, bent, from inside and outside, straight."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-3, 3, (n, 1))
    x0 = rng.uniform(-1.6, 1.6, (n, 3)) * np.where(rng.random((n, 1)) < 0.1, 10, 1)
    h = 10 ** rng.uniform(-3, 0)
    v0, bend = size * rng.normal(size=(2, n, 3)) * [[[1.0]], [[0.3]]]
    v1 = v0 + rng.choice([0, 1], (n, 1)) * bend
    x1 = x0 + h * 0.5 * (v0 + v1) + rng.choice([0, 0.1], (n, 1)) * h * bend
    surface = rng.choice(surfaces_of(pm.ParticleSystem(pm.Particles(x0), (), WORLDS[world]())))
    touching = rng.random(n) < 0.3  # begins a hair's breadth off a surface
    gap = surface.distance(x0, 0.2) - 10 ** rng.uniform(-5, -2, n)
    start = np.where(touching[:, None], x0 - gap[:, None] * surface.normal(x0, 0.2), x0)
    return start, v0, x1 + (start - x0), v1, h


@pytest.mark.parametrize("radius", [0.0, 0.05])
@pytest.mark.parametrize("world", sorted(WORLDS))
def test_clear_is_never_said_where_something_happens(world, radius):
    t0 = 0.2
    surfaces = surfaces_of(pm.ParticleSystem(pm.Particles([[0, 0, 0]]), (), WORLDS[world]()))
    n = 300 if any(s.lookup for s in surfaces) else 2000  # the reference path takes long to search
    text = ContactText(surfaces, 2, False, "float64")
    table, clear = text.table(), compiled(text.text)["clear"]

    def clears(x0, v0, x1, v1, h):
        return np.array([clear(table, *x0[i], *v0[i], *x1[i], *v1[i], t0, h, radius) for i in range(n)])

    for seed in range(3):
        x0, v0, x1, v1, h = far_and_near(world, seed, n)
        said = clears(x0, v0, x1, v1, h)
        ends = (np.full(n, t0), np.full(n, h), np.full(n, radius))
        chord = (x1 - x0) / h
        for s in surfaces:
            assert not (said & (s.distance(x0, t0) - radius <= s.eps)).any()
            assert not (said & (s.distance(x1, t0 + h) - radius < s.eps)).any()
            for paths in (Paths(x0, v0, x1, v1, *ends), Paths(x0, chord, x1, chord, *ends)):
                assert not (said & np.isfinite(first_hit(s, paths))).any()
    x, v, h = np.random.default_rng(3).uniform(-1.5, 1.5, (n, 3)), np.ones((n, 3)), 1 / 240
    free = np.all([s.distance(x, t0) - radius > (0.3 if s.lookup else 0.05) for s in surfaces], axis=0)
    said = clears(x, v, x + h * v, v, h)
    assert said[free].all(), "it is of use"


@pytest.mark.parametrize(
    ("world", "solver"), [("paddle", pm.Leapfrog()), ("block", pm.ImplicitEuler()), ("meshes", pm.RK4())]
)
def test_compiled_functions_give_the_same_bits(world, solver):
    x, v = np.random.default_rng(1).uniform(-1.2, 1.2, (2, 40, 3)) * [[[1]], [[20]]]
    for k in range(len(x)):
        engines = pair_of_engines(
            world, "swept", solver, x[k], v[k], 0.02, 0.7, lambda: [pm.Gravity((1, -9.81, 0))],
            compiled, friction=0.2,
        )  # fmt: skip
        same_steps(engines, 1 / 60, 5)


@pytest.mark.parametrize("solver", ["symplectic_euler", "leapfrog", "rk4", "dopri5", "implicit_euler"])
def test_linked_particles_in_a_room_some_of_them_pinned(solver, monkeypatch):
    from types import SimpleNamespace

    monkeypatch.setattr(store, "load", lambda *text: SimpleNamespace(**store.plain(*text)))

    def run(compiled):
        rng = np.random.default_rng(1)
        particles = pm.Particles(rng.uniform(-0.9, 0.9, (12, 3)), rng.uniform(-4, 4, (12, 3)), rng.uniform(0.5, 2, 12))
        particles.pin([3])
        springs = pm.Springs([(k, k + 1) for k in range(0, 12, 2)], 50.0, 0.5, rest=0.3)
        room = pm.Box(size=(2, 2, 2), inside=True)
        system = pm.ParticleSystem(particles, [pm.Gravity(), springs], room)
        sim = pm.Simulation(system, solver, 1 / 80, compiled=compiled)
        sim.step(60)
        return particles

    slow, fast = run(False), run(True)
    tolerance = 1e-7 if solver in ("implicit_euler", "dopri5") else 1e-11
    np.testing.assert_allclose(fast.x, slow.x, rtol=0, atol=tolerance)
    np.testing.assert_allclose(fast.v, slow.v, rtol=0, atol=100 * tolerance)


# ------------------------------------------------------------------------------------------------ memory of searches


RING = trimesh.creation.torus(1.0, 0.35, major_sections=11, minor_sections=7)
GLOBE = trimesh.creation.uv_sphere(0.8, count=[6, 24])  # more triangles meet at a pole than a search remembers
SEARCHED = {
    "ring": pm.Mesh((RING.vertices, RING.faces)),
    "globe": pm.Mesh((GLOBE.vertices, GLOBE.faces), inside=True),
    "sheet": pm.Mesh(SHEET, thickness=0.1),
    "hills": pm.HeightField(HILLS, (2.5, 2.5)),
}


def walk(shape, rng, stride, count):
    """Places one after the other, from a corner of a mesh on."""
    steps = rng.normal(size=(count, 3)) * stride
    return shape.triangles.vertices[rng.integers(len(shape.triangles.vertices))] + np.cumsum(steps, axis=0)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(SEARCHED)), st.integers(0, 10**6), st.sampled_from([1e-12, 1e-5, 1e-3, 0.02, 0.3]))
def test_what_a_search_remembers_changes_no_bit(name, seed, stride):
    shape, rng = SEARCHED[name], np.random.default_rng(seed)
    text = ContactText([shape], 2, False, "float64")
    do, table, memory = printed(text.text), text.table(), np.zeros(text.record)
    x = walk(shape, rng, stride, 25)
    gaps, normals = shape.look(x)
    mesh = shape.triangles
    away = naive.distance_to_triangles(x[-1].tolist(), mesh.vertices.tolist(), mesh.faces.tolist())
    assert abs(gaps[-1] + shape.half) == pytest.approx(away, abs=1e-12)
    for place, gap, normal in zip(x, gaps, normals, strict=True):
        for way in (gap, gap - stride, gap - 10 * stride):
            assert not do["far_from"](table, memory, 0, 0, *place, way) or gap > way
        assert do["gap_of"](table, memory, 0, 0, *place) == gap
        np.testing.assert_array_equal(do["normal_of"](table, memory, 0, 0, *place), normal)


def test_who_hardly_moves_searches_once(monkeypatch):
    shape = SEARCHED["ring"]
    text = ContactText([shape], 2, False, "float64")
    do, table, memory = printed(text.text), text.table(), np.zeros(text.record)
    searches, search = [], do["triangles_search"]
    monkeypatch.setitem(do, "triangles_search", lambda *given: searches.append(given) or search(*given))
    x = walk(shape, np.random.default_rng(1), 1e-4, 50)
    for place in x:
        do["gap_of"](table, memory, 0, 0, *place)
    assert len(searches) == 1
    assert not do["far_from"](table, memory, 0, 0, 5.0, 0.0, 0.0, 1.0)  # it is, but not by where it looked last
    do["gap_of"](table, memory, 0, 0, 5.0, 0.0, 0.0)
    assert do["far_from"](table, memory, 0, 0, 5.1, 0.0, 0.0, 3.0)
