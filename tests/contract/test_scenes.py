"""Every scene that ships runs headless, twice to the same bits, passes its own check, and survives as text."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.frame import Frame
from pointmass.scene import Scene
from pointmass.scenes import SCENES, CheckFailed
from pointmass.scenes.base import ShippedScene
from pointmass.scenes.curtain import HOOK, Curtain
from pointmass.simulation import Simulation
from pointmass.solvers import ImplicitEuler
from tests.small import SMALL

VARIANTS = [(name, SMALL.get(name, {})) for name in SCENES] + [
    ("orbit", {"kind": "kepler"}),
    ("flow", {"particles": 200, "sway": 0.0, "arrows": 0, "streamlines": 0}),
    ("field", {"drop": "cloth", "arrows": 6, "streamlines": 6}),
    ("field", {"drop": "hair", "arrows": 6, "streamlines": 6}),
]
FRAMES = {"orbit": 150, "pendulum": 150}  # whole turns and swings; of others the first second shows as much


def frames_of(scene: Scene, count: int) -> list[Frame]:
    return list(scene.simulation().frames(count, scene.fps))


def bits(frames: list[Frame]) -> list[bytes]:
    return [f.positions.tobytes() + f.velocities.tobytes() + f.ids.tobytes() for f in frames]


def made(name: str, settings: dict[str, object]) -> ShippedScene:
    return SCENES[name].with_settings(settings)


@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_scene_passes_its_check_and_repeats_its_bits(name: str, settings: dict[str, object]) -> None:
    shipped = made(name, settings)
    scene = shipped.build()
    count = min(scene.frames, FRAMES.get(name, 60))
    first = frames_of(scene, count)
    shipped.check(first)
    assert all(np.isfinite(f.positions).all() and np.isfinite(f.velocities).all() for f in first)
    again = frames_of(Scene.from_toml(scene.to_toml()), 10)
    assert bits(again) == bits(first[:10])


FEW: dict[str, dict[str, object]] = {  # of scenes that implicit steps are made for, or that take them as well
    "cloth": {"particles": 8},
    "flag": {"particles": 8},
    "drape": {"particles": 8},
    "curtain": {"particles": 9, "rings": 3},
    "tear": {"particles": 8},
    "heap": {"cloths": 2, "particles": 8},
    "jelly": {"particles": 3, "jellies": 2},
    "hair": {"strands": 3, "points": 12, "length": 0.2, "children": 0},
    "net": {"balls": 2, "size": 1.0, "mesh": 0.8},
}
DIVIDED = {
    "flag": 1.0
}  # divisions for each step that are allowed: in gusts a sheet turns over in a sixtieth of a second
SOFT = [(n, p) for n in FEW for p in (None, *SCENES[n].presets)]


def in_implicit_steps(scene: Scene) -> Simulation:
    """The scene, with whatever leads, tears or meets its bodies, in steps of backward Euler of 1/60 s."""
    return replace(scene, solver=ImplicitEuler(tolerance=1e-3), dt=1 / 60).simulation()


@pytest.mark.parametrize(("name", "preset"), SOFT)
def test_a_soft_body_takes_implicit_steps_of_a_sixtieth(name: str, preset: str | None) -> None:
    shipped = SCENES[name].with_settings(FEW[name], preset)
    scene = shipped.build()
    simulation = in_implicit_steps(scene)
    shipped.check(list(simulation.frames(20, 60.0)))
    assert simulation.engine.stats.rejected < 20


@pytest.mark.full
@pytest.mark.parametrize("small", [True, False], ids=["small", "normal"])
@pytest.mark.parametrize(("name", "preset"), SOFT)
def test_a_soft_body_takes_implicit_steps_of_a_sixtieth_at_full_length(
    name: str, preset: str | None, small: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("POINTMASS_ENGINE", "compiled")
    shipped = SCENES[name].with_settings(SMALL[name] if small else {}, preset)
    scene = shipped.build()
    simulation = in_implicit_steps(scene)
    shipped.check(list(simulation.frames(scene.frames, scene.fps)))
    assert simulation.engine.stats.rejected < DIVIDED.get(name, 0.1) * simulation.steps


@pytest.mark.full
@pytest.mark.parametrize("name", SCENES)
def test_scene_passes_its_check_at_full_length(name: str) -> None:
    shipped = SCENES[name]()
    scene = shipped.build()
    shipped.check(frames_of(scene, scene.frames))


PRESETS = [(name, preset) for name, shipped in SCENES.items() for preset in shipped.presets]


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_a_preset_passes_the_check(name: str, preset: str) -> None:
    shipped = SCENES[name].with_settings(SMALL.get(name, {}), preset)
    shipped.check(frames_of(shipped.build(), 10))
    assert SCENES[name].with_settings({}, preset) != made(name, {})


@pytest.mark.full
@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_a_preset_passes_the_check_at_full_length(name: str, preset: str) -> None:
    shipped = SCENES[name].with_settings({}, preset)
    scene = shipped.build()
    shipped.check(frames_of(scene, scene.frames))


def test_every_scene_has_presets() -> None:
    assert all(len(shipped.presets) >= 3 for shipped in SCENES.values())
    with pytest.raises(InvalidInput, match=r"unknown preset of scene fountain: 'geysir': did you mean 'geyser'"):
        SCENES["fountain"].with_settings({}, "geysir")
    assert SCENES["fountain"].with_settings({"speed": 3}, "geyser") == made(
        "fountain", {**SCENES["fountain"].presets["geyser"], "speed": 3}
    )


QUICK = {
    "flow": {"particles": 20, "arrows": 0, "streamlines": 0},
    "field": {"particles": 20, "arrows": 0, "streamlines": 0},
    "springs": {"side": 3},
    "bounce": {"balls": 10},
    **{name: SMALL[name] for name in ("fireworks", "snow", "smoke", "dust", "flock")},
    **{name: {"particles": 10} for name in ("cloth", "flag", "drape", "tear")},
    "curtain": {"particles": 9, "rings": 3},
    "net": {"balls": 2, "size": 1.0, "mesh": 0.8},
    "jelly": {"particles": 4, "jellies": 2},
    "hair": {"strands": 8, "points": 12, "style": "straight", "children": 0},
    "heap": {"cloths": 2, "particles": 10},
    "school": {"fish": 8},
}
COSTLY = {  # only so many steps
    *("balls", "rate", "links", "side", "particles", "mass", "stiffness", "steps_per_second"),
    *("launches", "stars", "tail", "smoke", "sand", "dust", "stretch", "bend", "strands", "points", "children"),
    *("animals", "fish", "predators"),
}
ENDS = [
    (name, parameter["name"], value)
    for name, shipped in SCENES.items()
    for parameter in shipped.parameters()
    for value in parameter["choices"] or (parameter["minimum"], parameter["maximum"])
    if value is not None and (parameter["name"] not in COSTLY or value == parameter["minimum"] >= 1)
]


def at_end(name: str, parameter: str, value: object, frames: int) -> None:
    shipped = made(name, {**QUICK.get(name, {}), parameter: value})
    shipped.check(frames_of(shipped.build(), frames))


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("bounce", "height", 0),  # would begin in the floor
        ("bounce", "radius", 10),
        ("bounce", "gravity", 0),  # no energy to compare with
        ("flow", "speed", 100),  # too fast for the usual step
        ("pendulum", "damping_ratio", 10),  # too stiff for it
        ("springs", "height", 0),
        ("springs", "size", 100),
        ("springs", "damping_ratio", 5),
        ("springs", "drag", 10),
        ("jelly", "gravity", 0),  # no energy to compare with
    ],
)
def test_the_ends_of_a_range_that_were_hard(name: str, parameter: str, value: object) -> None:
    at_end(name, parameter, value, 8)


def test_hair_with_links_that_would_lead_through_the_head_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"points = 10 is not allowed: .* give at least 11 points"):
        made("hair", {"points": 10, "length": 0.5})
    at_end("hair", "points", 6, 16)


def test_a_jelly_too_soft_for_its_weight_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"stiffness = 6000 is not allowed: .* give at least 9810 Pa"):
        made("jelly", {"stiffness": 6e3, "size": 0.5})
    assert made("jelly", {"stiffness": 9810, "size": 0.5})


def test_a_curtain_too_soft_to_hang_at_its_rings_is_refused() -> None:
    large: dict[str, object] = {"width": 10, "height": 8, "material": "leather"}
    with pytest.raises(InvalidInput, match=r"stretch = 200 is not allowed: .* give at least 1047 N/m"):
        made("curtain", large)
    assert made("curtain", {**large, "stretch": 1047})


@pytest.mark.full
@pytest.mark.parametrize(
    "settings",
    [
        {"width": 10, "height": 8, "material": "leather", "stretch": 840},
        {"width": 10, "height": 8, "material": "leather", "stretch": 2600, "gravity": 30},
        {"width": 3, "height": 8, "material": "denim", "stretch": 420},
    ],
)
def test_a_curtain_just_stiff_enough_is_not_torn_out_of_shape(settings: dict[str, object]) -> None:
    curtain = made("curtain", {"particles": 9, "rings": 3, "wind": 0.0, "time": 60.0, **settings})
    with pytest.raises(InvalidInput, match="stretch"):
        replace(curtain, stretch=0.9 * curtain.stretch)
    curtain.check(frames_of(curtain.build(), 100))


@pytest.mark.parametrize("settings", [{}, {"material": "leather", "rings": 3}, {"width": 10}, {"stretch": 50.0}])
def test_hooks_of_a_curtain_bear_it_whatever_its_cloth(settings: dict[str, object]) -> None:
    curtain = Curtain.with_settings({"particles": 9, "wind": 0.0, "time": 60.0, **settings})
    sheet, hooks = curtain.bodies()[0], curtain.hooks()
    k = hooks.settings(sheet.particles, 0.0, np.arange(len(hooks.ids)))["k_s"][0]
    longer = 9.81 * sheet.particles.m.sum() / (curtain.rings - 1) / k
    assert np.all((longer > 0.2 * HOOK) & (longer <= 0.25 * HOOK))


@pytest.mark.full
@pytest.mark.parametrize(("name", "parameter", "value"), ENDS)
def test_the_ends_of_every_range(name: str, parameter: str, value: object) -> None:
    at_end(name, parameter, value, 60)


@pytest.mark.parametrize("name", SCENES)
def test_frames_of_a_scene_show_something(name: str) -> None:
    scene = made(name, SMALL.get(name, {})).build()
    last = frames_of(scene, 12)[-1]
    assert {d.kind for d in last.drawables} & {"points", "segments", "curves", "triangles"}
    for drawable in last.drawables:
        assert drawable.version >= 0
        for attribute in vars(drawable).values():
            if isinstance(attribute, np.ndarray) and attribute.dtype.kind == "f":
                assert np.isfinite(attribute).all()


@pytest.mark.parametrize("name", SCENES)
def test_scene_declares_its_parameters(name: str) -> None:
    shipped = SCENES[name]
    assert shipped.name == name
    assert shipped.summary().endswith(".")
    assert 4 <= len(shipped.parameters()) <= 12
    for parameter in shipped.parameters():
        assert parameter["summary"]
        low, high = parameter["minimum"], parameter["maximum"]
        if low is not None:
            assert low <= parameter["default"] <= high
            with pytest.raises(InvalidInput, match=parameter["name"]):
                shipped.with_settings({parameter["name"]: high * 2 + 1})
        with pytest.raises(InvalidInput, match=parameter["name"]):
            shipped.with_settings(
                {parameter["name"]: float("nan")} if low is not None else {parameter["name"] + "x": 1}
            )


@pytest.mark.parametrize("name", SCENES)
def test_a_check_can_fail(name: str) -> None:
    """A run that was tampered with does not pass."""
    shipped = made(name, SMALL.get(name, {}))
    frames = frames_of(shipped.build(), 16)
    last = frames[-1]
    wrong = Frame(
        number=last.number,
        time=last.time,
        ids=last.ids,
        positions=last.positions - (0.0, 100.0, 100.0),
        velocities=last.velocities,
        quantities={k: 2 * v + 1e6 for k, v in last.quantities.items()},
    )
    with pytest.raises(CheckFailed, match=r".{20,}"):
        shipped.check([*frames[:-1], wrong])


def test_scene_parameters_are_checked_in_one_sentence() -> None:
    with pytest.raises(InvalidInput, match=r"links = 0 is not allowed"):
        SCENES["pendulum"].with_settings({"links": 0})
    with pytest.raises(InvalidInput, match=r"links = 2.5 is not allowed: it must be a whole number"):
        SCENES["pendulum"].with_settings({"links": "2.5"})
    with pytest.raises(InvalidInput, match=r"did you mean 'length'"):
        SCENES["pendulum"].with_settings({"lenght": 1})
    with pytest.raises(InvalidInput, match=r"known are figure_eight, kepler"):
        SCENES["orbit"].with_settings({"kind": "square"})


@pytest.mark.full
def test_an_undamped_cube_on_an_elastic_floor_gains_no_energy() -> None:
    scene = SCENES["springs"](restitution=1.0, damping_ratio=0.0, drag=0.0, friction=0.0)
    described = scene.build()
    scene.check(list(described.simulation().frames(described.frames, described.fps)))
