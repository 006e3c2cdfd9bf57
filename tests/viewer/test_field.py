"""The field laboratory: what is typed, drawn, coloured, and the integral curves of solvers."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Curves, Points, Segments
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.viewer.curves import MOST_STEPS, Start, dashed, integral_curve
from pointmass.viewer.field import Field
from pointmass.viewer.inputs import Restore, Turn
from pointmass.viewer.instruments import Instruments
from pointmass.viewer.live import Live, replay
from pointmass.viewer.messages import ChooseCurveSolver, ClearCurves, Lens, SetCurveStep, StartCurve, Vectors
from pointmass.viewer.setup import Setup
from pointmass.viewer.subject import Subject


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Nothing here is about kernels, which take long to compile."""
    monkeypatch.setenv("POINTMASS_ENGINE", "reference")


class Laboratory:
    """The scene with its instruments."""

    def __init__(self, **settings):
        settings = {"particles": 20, "arrows": 6, "streamlines": 6, **settings}
        self.subject = Subject.of_shipped(SCENES["field"](**settings))
        self.live = Live(self.subject)
        self.instruments = Instruments(self.live)
        self.frame = self.live.start()
        self.look()

    def look(self):
        self.shown, self.readings = self.instruments.look(self.frame, fresh=True)
        return self.shown

    def go(self):
        self.frame = self.live.advance(1.0)
        self.look()

    def take(self, message):
        assert self.instruments.take(message, self.frame, -1)
        self.look()

    def drawn(self, kind, name):
        return next((d for d in self.shown.drawables if isinstance(d, kind) and d.name == name), None)


def seen(*velocity):
    """A flow in the box from -2 to 2."""
    flow = pm.Flow(velocity)
    scene = pm.Scene(forces=[flow], bodies=[pm.scatter(1)], look=pm.Look(field_box=((-2, -2, 0), (2, 2, 0))), dt=0.1)
    sim = scene.simulation()
    return Field().see(next(sim.frames(1, 60)), [sim], Setup())


def test_eulers_curve_grows_by_the_same_factor_in_every_step():
    """x' = i x: a step of h multiplies by 1 + i h, whose size is sqrt(1 + h^2)."""
    h, start = 0.25, Start((1.0, 0.0, 0.0), 0.3)
    path = integral_curve(seen("-y", "x"), pm.Euler(), start, h, 5.0)
    assert path.whole
    assert len(path.places) == 21
    radius = np.linalg.norm(path.places, axis=1)
    np.testing.assert_allclose(radius[1:] / radius[:-1], np.sqrt(1 + h * h), rtol=1e-14)
    implicit = integral_curve(seen("-y", "x"), pm.ImplicitEuler(tolerance=1e-12), start, h, 5.0)
    radius = np.linalg.norm(implicit.places, axis=1)
    np.testing.assert_allclose(radius[1:] / radius[:-1], 1 / np.sqrt(1 + h * h), rtol=1e-9)


@pytest.mark.parametrize(("solver", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4), ("implicit_midpoint", 2)])
def test_curves_come_nearer_by_the_order_of_their_solver(solver, order):
    """x' = t x from t = 0.5: x = exp((t^2 - 0.25) / 2)."""
    errors = []
    for dt in (0.1, 0.05):
        path = integral_curve(seen("t*x", "0"), pm.solvers.find_solver(solver)(), Start((1, 0, 0), 0.5), dt, 1.0)
        errors.append(abs(path.places[-1, 0] - np.exp((1.5**2 - 0.25) / 2)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


def test_a_curve_that_leaves_ends():
    path = integral_curve(seen("x**2", "0"), pm.RK4(), Start((1.0, 0.0, 0.0), 0.0), 0.05, 5.0)  # 1 / (1 - t)
    assert not path.whole
    assert 1 < len(path.places) < 30
    assert np.abs(path.places).max() < 40


def test_dashes_are_as_long_as_they_say_and_leave_out_the_rest():
    line = np.array([[0.0, 0, 0], [1.5, 0, 0], [1.5, 1.5, 0]])
    corners, pairs = dashed([line, line + 1.0], (2.0, 1.0), 0.2)
    lengths = np.linalg.norm(corners[pairs[:, 0]] - corners[pairs[:, 1]], axis=1)
    assert lengths.sum() == pytest.approx(2 * 2.0)  # of 3 m each, five dashes of 0.4 m
    whole, all_pairs = dashed([line], (1.0, 0.0), 0.2)
    np.testing.assert_array_equal(whole, line)
    np.testing.assert_array_equal(all_pairs, [[0, 1], [1, 2]])


def test_curves_are_drawn_by_the_chosen_solvers_and_follow_the_field():
    it = Laboratory()
    told = it.instruments.message.curves
    assert [s.name for s in told.solvers if s.on] == ["euler", "midpoint", "rk4", "dopri5"]
    assert not {"leapfrog", "symplectic_euler", "xpbd"} & {s.name for s in told.solvers}
    assert len({(s.color, s.dash) for s in told.solvers}) == len(told.solvers)
    assert (told.low, told.high) == ((-2, -2, 0), (2, 2, 0))
    it.take(SetCurveStep(dt=0.5, span=4.0))
    it.take(StartCurve(place=(1.0, 0.0, 0.0)))
    steps = it.drawn(Points, "steps by euler")
    np.testing.assert_allclose(np.linalg.norm(steps.vertices, axis=1), (1 + 0.25) ** (np.arange(9) / 2), rtol=1e-6)
    errors = {end.name: end.error for end in it.readings.curves}
    exact = np.exp(4j)
    assert errors["euler"] == pytest.approx(abs((1 + 0.5j) ** 8 - exact), rel=1e-6)
    assert errors["rk4"] < 0.02 * errors["midpoint"] < 0.02 * errors["euler"]
    assert errors["dopri5"] < 1e-4
    it.take(ChooseCurveSolver(name="euler", on=False))
    assert it.drawn(Segments, "integral curves by euler") is None
    assert it.drawn(Segments, "integral curves by rk4") is not None
    version = it.drawn(Segments, "integral curves by rk4").version
    it.go()
    assert it.drawn(Segments, "integral curves by rk4").version == version  # so that pages are not sent it again
    it.live.apply(Turn({"u": "1", "v": "0"}))
    it.go()
    np.testing.assert_allclose(it.drawn(Points, "steps by rk4").vertices[-1], [5.0, 0, 0], rtol=1e-6)
    it.take(ClearCurves())
    assert it.drawn(Segments, "integral curves by rk4") is None
    for message, sentence in (
        (ChooseCurveSolver(name="leapfrog", on=True), "leapfrog"),
        (SetCurveStep(dt=5.0, span=4.0), "dt = 5 s is not allowed"),
        (SetCurveStep(dt=1.0, span=1.01 * MOST_STEPS), "dt = 1 s is not allowed"),
    ):
        with pytest.raises(InvalidInput, match=sentence):
            it.instruments.take(message, it.frame, -1)


def test_a_scene_without_a_field_has_no_curves():
    live = Live(Subject.of_shipped(SCENES["pendulum"](links=1)))
    instruments, frame = Instruments(live), live.start()
    instruments.look(frame, fresh=True)
    assert instruments.message.curves is None
    assert not {"field", "streamlines"} & {v.name for v in instruments.message.vectors}
    assert not {"divergence", "curl"} & {v.name for v in instruments.message.lenses}
    with pytest.raises(InvalidInput, match="pendulum has no velocity field"):
        instruments.take(StartCurve(place=(0.0, 0.0, 0.0)), frame, -1)


def test_a_formula_is_typed_while_it_runs_undone_and_copied():
    it = Laboratory()
    first = it.drawn(Arrows, "field")
    it.go()
    assert it.drawn(Arrows, "field") is first  # not drawn anew while it is the same
    before = it.live.sim.system.particles.x.copy()
    for wrong, sentence in (("x**", "u 'x\\*\\*' is not a formula"), ("q + 1", "unknown name in u"), ("age", "in u")):
        with pytest.raises(InvalidInput, match=sentence):
            it.live.apply(Turn({"u": wrong}))
    assert it.live.setup == Setup()
    assert it.live.apply(Turn({"u": "0.5", "v": "-0.25"})) is None
    it.go()
    n = len(before)
    moved = it.live.sim.system.particles.x[:n] - before
    np.testing.assert_allclose(moved, np.tile([0.5 / 60, -0.25 / 60, 0], (n, 1)), rtol=1e-9, atol=1e-15)
    assert it.drawn(Arrows, "field").version != first.version  # so that pages are sent it
    (vectors,) = {tuple(v) for v in it.drawn(Arrows, "field").vectors.round(6)}
    assert vectors[1] / vectors[0] == pytest.approx(-0.5, rel=1e-4)
    flow = Scene.from_toml(it.live.text()).forces[0]
    assert [*flow.arguments["velocity"]] == ["0.5", "-0.25", "0"]
    assert it.live.apply(Restore(Setup())) is None
    x = it.live.sim.system.particles.x[:n].copy()
    it.go()
    radius = [np.linalg.norm(each, axis=1) for each in (x, it.live.sim.system.particles.x[:n])]
    np.testing.assert_allclose(radius[1], radius[0], rtol=1e-9)  # it rotates again
    again = replay(it.subject, it.live.recording, it.live.steps)
    assert again.system.get_state().tobytes() == it.live.sim.system.get_state().tobytes()


def test_field_and_streamlines_are_switched_and_coloured():
    it = Laboratory(u="x*x", v="0")
    assert it.instruments.message.shown == ["field", "streamlines"]  # as the scene says
    plain = it.drawn(Arrows, "field")
    it.take(Vectors(name="streamlines", on=False))
    assert it.drawn(Curves, "streamlines") is None
    assert it.drawn(Arrows, "field") is not None
    it.take(Lens(name="divergence"))
    legend, arrows = it.readings.legend, it.drawn(Arrows, "field")
    assert (legend.low, legend.mark, legend.unit) == (-legend.high, 0.0, "1/s")
    assert legend.high == pytest.approx(2 * 2 * 11 / 12)  # 2 x in the outermost of 12 cells
    order = np.argsort((arrows.vertices + 0.5 * arrows.vectors)[:, 0])
    lightness = arrows.color[order] @ [0.2126, 0.7152, 0.0722, 0.0]
    assert (np.diff(lightness) > -1e-6).all()  # told apart without colours
    assert lightness[-1] > 5 * lightness[0]
    assert not np.array_equal(arrows.color, plain.color)
    it.take(Lens(name="curl"))
    assert (it.readings.legend.low, it.readings.legend.high, it.readings.legend.mark) == (0.0, 1.0, None)  # it is 0
    it.take(Lens(name=""))
    assert it.drawn(Arrows, "field").version == 0
    it.take(Vectors(name="field", on=False))
    assert it.drawn(Arrows, "field") is None
    with pytest.raises(InvalidInput, match="lens"):
        it.instruments.take(Lens(name="spin"), it.frame, -1)


@pytest.mark.parametrize("name", ["flag", "smoke"])
def test_any_scene_with_air_shows_its_field_if_asked(name):
    live = Live(Subject.of_shipped(SCENES[name](**({"particles": 10} if name == "flag" else {"rate": 60.0}))))
    instruments, frame = Instruments(live), live.start()
    frame, _ = live.advance(1.0), instruments.look(frame, fresh=True)
    assert {"field", "streamlines"} <= {v.name for v in instruments.message.vectors}
    assert instruments.message.shown == []
    for message in (Vectors(name="field", on=True), Vectors(name="streamlines", on=True), Lens(name="curl")):
        assert instruments.take(message, frame, -1)
    shown, readings = instruments.look(frame, fresh=True)
    assert {"field", "streamlines"} <= {d.name for d in shown.drawables}
    assert readings.legend.high > 0
    assert np.isfinite(readings.legend.high)


@pytest.mark.parametrize("drop", ["cloth", "hair"])
def test_cloth_and_hair_go_with_the_air(drop):
    it = Laboratory(drop=drop, u="1", v="0")
    start = it.frame.positions.copy()
    for _ in range(3):
        it.go()
    free = ~it.live.sim.system.particles.pinned
    moved = (it.frame.positions - start)[free]
    assert moved[:, 0].mean() > 1e-4
    assert moved[:, 0].mean() > 2 * np.abs(moved[:, 1:].mean(axis=0)).max()  # a plate also has lift
    assert it.drawn(Arrows, "field") is not None
