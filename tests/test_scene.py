"""Scenes as text: what can be written comes back with the same bits, and what is wrong gets one sentence."""

from __future__ import annotations

import copy
import json
import tomllib
from inspect import Parameter
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.description import parameters_of
from pointmass.errors import Diverged, InvalidInput
from pointmass.forces import Flow
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.schema import LISTS, UNKNOWN, entry_model, form_of, json_schema, settings_model
from pointmass.solvers import ALIASES, SOLVERS
from pointmass.toml import dumps
from tests.shapes import CLOUD

SCHEMA = Path(__file__).parent.parent / "docs" / "scene.schema.json"
VALIDATOR = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))
SQUARE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]]
NEEDED: dict[str, dict[str, Any]] = {
    "surface_attractor": {"around": [{"type": "sphere", "radius": 0.4}]},  # what cannot be left out, by kind
    "avoid": {"around": [{"type": "sphere", "radius": 0.4}]},
    "cushion": {"around": [{"type": "sphere", "radius": 0.4}]},
    "springs": {"pairs": [[0, 1], [1, 2]]},
    "muscles": {"pairs": [[0, 1], [1, 2]]},
    "scales": {"links": [[0, 1], [1, 2]]},
    "slender_drag": {"links": [[0, 1], [1, 2]]},
    "steer": {"on": "crawler"},
    "snake": {"segments": 4},
    "worm": {"segments": 4},
    "angles": {"joints": [[0, 1, 2]]},
    "hinges": {"hinges": [[0, 1, 2, 3]]},
    "volumes": {"tetrahedra": [[0, 1, 2, 3]]},
    "bulk": {"tetrahedra": [[0, 1, 2, 3]]},
    "plate_wind": {"triangles": [[0, 1, 2]]},
    "water": {"triangles": [[0, 1, 2]]},
    "fins": {"sections": [[0, 1, 2, 3]]},
    "field": {"force": ["-k*x", "0.1*sin(t)", "vx*0"], "constants": {"k": 2.0}},
    "flow": {"velocity": ["-y", "x", "0.1*t"]},
    "mesh": {"mesh": [[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]},
    "cloth_from_mesh": {"mesh": [[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]]},
    "cloud": {"file": CLOUD},
    "points": {"x": [[0.0, 1.0, 0.0], [0.5, 1.2, 0.1]]},
    "scatter": {"count": 4},
    "polygon": {"vertices": SQUARE},
    "distance_grid": {"distances": [[[-0.5, -0.5], [-0.5, -0.5]], [[0.5, 0.5], [0.5, 0.5]]], "spacing": 1.0},
    "attachment": {"on": "some", "to": "sheet"},
    "height_field": {"heights": [[0.0, 0.1, 0.2], [0.1, 0.0, -0.1]]},
    "cloth": {"rows": 6, "cols": 5},  # these only take long by default
    "hair": {"strands": 8, "points": 6},
    "jelly": {"counts": [3, 3, 3]},
    "lattice": {"counts": [3, 3, 3]},
    "net": {"rows": 4, "cols": 4},
}
OTHER: dict[str, Any] = {  # another value than the default, by annotation
    "Contact": "discrete",
    "Families": ["stretch", "bend"],
    "Response": "slide",
    "bool": False,
    "float | None": 0.3,
    "Scalar": "0.5 + 0.1*sin(t)",
    "Scalar | None": 0.25,
    "Vector": [0.3, "0.1*cos(t)", -0.2],
    "Velocity": {"type": "vortex", "circulation": 2.0},
    "Selection": "others",
    "Surfaces | None": "sheet",
    "str": "end",
}
ENTRIES = [(what, kind) for what, registry in LISTS.items() for kind in registry]


def entry(what: str, kind: str) -> dict[str, Any]:
    return {"type": kind, **NEEDED.get(kind, {})}


def scene_with(what: str, table: dict[str, Any]) -> dict[str, Any]:
    """A small scene that holds one more table."""
    points = [[0.1, 0.5, 0.0], [0.6, 0.7, 0.1], [1.3, 0.4, 0.2]]
    base: dict[str, Any] = {
        "name": "test",
        "dt": 1 / 120,
        "bodies": [
            {
                "type": "points",
                "name": "some",
                "x": points,
                "attributes": {"charge": 1.0, "circulation": 0.5, "temperature": 300.0},
            },
            {"type": "points", "name": "others", "x": [[2.0, 0.5, 0.0]], "m": [2.0]},
        ],
    }
    kind = LISTS[what][table["type"]]
    order = getattr(kind, "order", 2)
    if order == 2:
        base["forces"] = [{"type": "drag", "k": 0.1}]
    if what == "motions":
        base["bodies"] = [{**body, "pinned": [0]} for body in base["bodies"]]
    if what == "constraints":
        base["bodies"].append({"type": "cloth", "name": "sheet", "rows": 3, "cols": 3})
        base["colliders"] = [{"type": "plane", "point": [0, -5, 0]}]
    if what == "controllers":
        base["bodies"].append({"type": "snake", "name": "crawler", "segments": 4})
        base["bodies"].append({"type": "fish", "name": "fish"})
    if what == "controllers" or table["type"] == "fish":
        base["dt"] = 1 / 960  # the ends of its tail are light
    base[what] = [*base.get(what, []), table]
    return base


def variants(what: str, kind: str) -> list[dict[str, Any]]:
    """The entry as small as can be, and with every parameter changed in turn."""
    result = [entry(what, kind)]
    for name, parameter in parameters_of(LISTS[what][kind]).items():
        if parameter.default is Parameter.empty:
            continue
        value = other(parameter)
        if value is not None and (kind == "wind" or name not in ("force", "velocity", "potential", "scale")):
            result.append({**entry(what, kind), name: value})
    return result


def other(parameter: Parameter) -> Any:
    default, annotation = parameter.default, str(parameter.annotation)
    if annotation in OTHER:
        return OTHER[annotation]
    if isinstance(default, int) and not isinstance(default, bool):
        return default + 1
    if isinstance(default, float):
        return 0.6 * default if 0 < default < 1e9 else 0.01
    if isinstance(default, tuple) and default and isinstance(default[0], (int, float)):
        return [value + 1 for value in default]
    return None


def run(scene: Scene) -> list[bytes]:
    try:
        frames = list(scene.simulation().frames(2, 60))
    except Diverged:
        return []
    return [f.positions.tobytes() + f.velocities.tobytes() for f in frames]


@pytest.mark.parametrize(("what", "kind"), ENTRIES, ids=str)
def test_every_entry_goes_through_text_with_the_same_bits(what: str, kind: str) -> None:
    worked = 0
    for table in variants(what, kind):
        try:
            scene = Scene.from_document(scene_with(what, table))
            first = run(scene)
        except InvalidInput:
            continue  # another value may be out of its range, or not go with the rest
        text = scene.to_toml()
        again = Scene.from_toml(text)
        assert again == scene
        assert again.to_toml() == text
        assert run(again) == first
        VALIDATOR.validate(tomllib.loads(text))
        worked += 1
    assert worked >= 1 + len(variants(what, kind)) // 2


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_goes_through_text(name: str) -> None:
    document = scene_with("forces", {"type": "gravity"})
    for solver in (name, {"type": name}):
        scene = Scene.from_document({**document, "solver": solver})
        assert type(scene.solver) is SOLVERS[name]
        assert Scene.from_toml(scene.to_toml()) == scene
    for parameter in parameters_of(SOLVERS[name]).values():
        if (value := other(parameter)) is not None:
            scene = Scene.from_document({**document, "solver": {"type": name, parameter.name: value}})
            assert Scene.from_toml(scene.to_toml()) == scene
            assert scene.solver is not None
            assert scene.solver.arguments == {parameter.name: value}


@pytest.mark.parametrize("alias", [*ALIASES, "RK4", "Velocity-Verlet"])
def test_aliases_of_solvers_are_understood(alias: str) -> None:
    assert Scene.from_document({**scene_with("forces", {"type": "gravity"}), "solver": alias}).solver is not None


@pytest.mark.parametrize("name", SCENES)
def test_shipped_scenes_go_through_text_and_fit_the_published_schema(name: str) -> None:
    scene = SCENES[name]().build()
    text = scene.to_toml()
    assert Scene.from_toml(text) == scene
    VALIDATOR.validate(tomllib.loads(text))


def test_the_published_schema_is_that_of_the_code() -> None:
    assert json.loads(SCHEMA.read_text()) == json_schema(), "run: python -m pointmass.schema > docs/scene.schema.json"


def test_the_schema_knows_every_parameter() -> None:
    for what, registry in {**LISTS, "solver": SOLVERS}.items():
        for kind, factory in registry.items():
            for parameter in parameters_of(factory).values():
                annotation = str(parameter.annotation)
                assert form_of(annotation) is not UNKNOWN, f"schema.FORMS has no {annotation!r} ({what} {kind})"
            properties = entry_model(what, kind).model_json_schema()["properties"]
            assert set(properties) >= set(parameters_of(factory))
    for what in ("camera", "look"):
        assert "another value" not in settings_model(what).allowed.values(), settings_model(what).allowed


# ------------------------------------------------------------------------------------------------------------ Python


def test_a_scene_in_python_runs_twice_alike_and_keeps_what_was_changed() -> None:
    chain = pm.chain(3)
    chain.particles.v[1] = (0.0, 1.0, 0.0)
    particles = pm.Particles([[0, 1, 0], [1, 1, 0]])
    made = pm.body_of(particles, [pm.Springs([(0, 1)], 50.0)])
    scene = Scene(bodies=[chain, made], forces=[pm.Gravity(on="particles")], names=["rope", "particles"])
    first, second = run(scene), run(scene)
    assert first == second
    assert np.array_equal(scene.simulation().system.particles.v[1], (0.0, 1.0, 0.0))
    with pytest.raises(InvalidInput, match="'chain' was changed after it was built and has no text"):
        scene.to_toml()
    with pytest.raises(InvalidInput, match="give the forces to the scene"):
        scene.changed(bodies=[made], names=["particles"]).to_toml()


def test_a_body_made_by_hand_runs_twice_alike() -> None:
    body = pm.Body(pm.Particles([[0, 0, 0], [1, 0, 0]]), [pm.Springs([(0, 1)], 10.0, rest=0.5)])
    scene = Scene(bodies=[pm.chain(2), body])
    assert run(scene) == run(scene)
    with pytest.raises(InvalidInput, match="a body made by hand was written in Python and has no text"):
        scene.to_toml()


def test_a_law_of_ones_own_runs_and_has_no_text() -> None:
    @pm.unary_force
    def swirl(x: Any, v: Any, m: Any, t: Any, strength: float = 1.0) -> Any:
        return -strength * x[1], strength * x[0], 0.0

    scene = Scene(bodies=[pm.points([[1.0, 0.0, 0.0]])], forces=[swirl(strength=2.0)])
    assert run(scene) == run(scene) != []
    with pytest.raises(InvalidInput, match="swirl was written in Python and has no text: in a scene file, write a law"):
        scene.to_toml()
    function = Scene(bodies=[pm.points([[1.0, 0.0, 0.0]])], forces=[pm.Drag(lambda t: 1 + t)])
    sliced = pm.Scene(bodies=[pm.chain(3)], forces=[pm.Gravity(on=slice(1, 3))])
    assert sliced.simulation().system.forces[-1].on.tolist() == [False, True, True, False]
    with pytest.raises(InvalidInput, match=r"forces gravity\.on = slice\(1, 3, None\) .* has no text: use .* lists"):
        sliced.to_toml()
    listed = pm.Scene(bodies=[pm.chain(3)], forces=[pm.Gravity(on=range(1, 3))])
    assert pm.Scene.from_toml(listed.to_toml()).forces[0].arguments["on"] == [1, 2]
    with pytest.raises(InvalidInput, match=r"forces drag\.k = .* was written in Python"):
        function.to_toml()


def test_switched_off_forces_stay_off() -> None:
    gravity = pm.Gravity()
    gravity.enabled = False
    scene = Scene(bodies=[pm.points([[1.0, 0.0, 0.0]])], forces=[gravity])
    again = Scene.from_toml(scene.to_toml())
    assert not again.forces[0].enabled
    assert not again.simulation().system.forces[0].enabled


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"bodies": []}, "needs at least one body or emitter"),
        ({"forces": pm.Gravity()}, "forces of a scene must be a list"),
        ({"forces": ["gravity"]}, "forces of a scene cannot hold 'gravity'"),
        ({"look": {"size": 1.0}}, "look must be a Look"),
        ({"names": ["a", "b"]}, "names has 2 entries for 1 bodies"),
        ({"solver": "rk4"}, "solver must be a solver"),
        ({"dt": 0}, "dt = 0 is not allowed"),
        ({"seed": -1}, "seed = -1 is not allowed"),
        ({"seed": 2**63}, "seed = 9223372036854775808 is not allowed"),  # its text could not be read again
    ],
)
def test_wrong_values_in_python(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        Scene(**{"bodies": [pm.chain(2)], **values})


# --------------------------------------------------------------------------------------------------- groups and files


def test_bodies_are_groups_and_forces_name_particles_by_id() -> None:
    text = """
        dt = 0.01
        [[bodies]]
        type = "chain"
        links = 2
        [[bodies]]
        type = "points"
        name = "dust"
        x = [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0]]
        [[forces]]
        type = "gravity"
        on = "dust"
        [[forces]]
        type = "springs"
        pairs = [[2, 3]]
        rest = 0.5
    """
    system = Scene.from_toml(text).simulation().system
    assert set(system.particles.groups) == {"chain", "dust"}
    f = system.deriv_eval(0.0, system.get_state()).reshape(2, 5, 3)[1]
    assert f[3, 0] < 0 < f[2, 0]
    assert f[3, 1] == f[4, 1] == -9.81
    assert f[1, 1] == 0


def test_paths_start_at_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "scenes"
    folder.mkdir()
    np.savez(folder / "wind.npz", values=np.ones((2, 2, 2, 3)), origin=np.zeros(3), spacing=np.ones(3))
    (folder / "a.toml").write_text(
        '[[bodies]]\ntype = "points"\nx = [[0.5, 0.5, 0.5]]\n'
        '[[forces]]\ntype = "wind"\nvelocity = { type = "flow", grid = "wind.npz" }\n'
        '[[forces]]\ntype = "field"\ngrid = { path = "wind.npz", outside = "wrap" }\n'
    )
    monkeypatch.chdir(tmp_path)
    scene = Scene.load("scenes/a.toml")
    scene.save(folder / "b.toml")
    scene.save(tmp_path / "c.toml")
    assert 'grid = "wind.npz"' in (folder / "b.toml").read_text()
    assert 'grid = "scenes/wind.npz"' in (tmp_path / "c.toml").read_text()
    monkeypatch.chdir("/")
    assert Scene.load(folder / "b.toml") == Scene.load(tmp_path / "c.toml") == scene == Scene.from_toml(scene.to_toml())
    assert 'outside = "wrap"' in scene.to_toml()
    (folder / "wind.npz").write_bytes((folder / "wind.npz").read_bytes()[:200])
    with pytest.raises(InvalidInput, match=r"forces\.0\.velocity \(flow\): grid file .* is damaged"):
        Scene.load(folder / "b.toml")
    grid = pm.Grid(np.ones((2, 2, 2, 3)))
    with pytest.raises(InvalidInput, match="holds a grid without a file and has no text"):
        Scene(bodies=[pm.points([[0, 0, 0]])], forces=[pm.Wind(Flow(grid=grid))]).to_toml()


BALL = '[[bodies]]\ntype = "points"\nx = [[0, 1, 0]]\n[[colliders]]\ntype = "mesh"\nmesh = '
OUTSIDE = {
    "an absolute path": (f"{BALL}'{{outside}}/ball.obj'", "mesh"),
    "dots": (f"{BALL}'../outside/ball.obj'", "mesh"),
    "a link to a file": (f"{BALL}'link.obj'", "mesh"),
    "a link to a folder": (f"{BALL}'links/ball.obj'", "mesh"),
    "links in a ring": (f"{BALL}'ring.obj/../../outside/ball.obj'", "mesh"),
    "what is not there": (f"{BALL}'../nowhere.obj'", "mesh"),
    "a cloud": ("[[bodies]]\ntype = 'cloud'\nfile = '../outside/ball.obj'", "file"),
    "an emitter": ("[[emitters]]\ntype = 'mesh'\nmesh = '../outside/ball.obj'", "mesh"),
    "ground": (f"{BALL}'ball.obj'\n[[colliders]]\ntype = 'height_field'\nheights = '../outside/a.npy'", "heights"),
    "distances": (
        f"{BALL}'ball.obj'\n[[colliders]]\ntype = 'distance_grid'\ndistances = '../outside/a.npz'",
        "distances",
    ),
    "a grid": (f"{BALL}'ball.obj'\n[[forces]]\ntype = 'field'\ngrid = '../outside/a.npz'", "grid"),
    "a grid in a wind": (
        f"{BALL}'ball.obj'\n[[forces]]\ntype = 'wind'\nvelocity = [{{{{ type = 'flow', grid = '../a.npz' }}}}]",
        "grid",
    ),
    "the path of a grid": (f"{BALL}'ball.obj'\n[[forces]]\ntype = 'field'\ngrid = {{{{ path = '../a.npz' }}}}", "path"),
    "a solid in the air": (
        f"{BALL}'ball.obj'\n[[forces]]\ntype = 'wind'\n[forces.velocity]\ntype = 'curl_noise'\n"
        "around = [{{ type = 'mesh', mesh = '../outside/ball.obj' }}]",
        "mesh",
    ),
}


@pytest.fixture
def folders(tmp_path: Path) -> Path:
    """A folder for scenes with links that lead out, and one beside it with files."""
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    for folder in (inside, outside):
        (folder / "ball.obj").write_text(text)
    (inside / "link.obj").symlink_to(outside / "ball.obj")
    (inside / "links").symlink_to(outside)
    (inside / "ring.obj").symlink_to("ring.obj")
    return tmp_path


@pytest.mark.parametrize(("text", "name"), OUTSIDE.values(), ids=OUTSIDE)
def test_scene_files_name_nothing_outside_of_their_folder(text: str, name: str, folders: Path) -> None:
    scene = folders / "inside" / "a.toml"
    scene.write_text(text.format(outside=folders / "outside"))
    with pytest.raises(InvalidInput, match=rf" {name} = '.*' is not allowed: it must lie in the scene file's folder"):
        Scene.load(scene)


def test_files_outside_of_the_folder_may_be_allowed(folders: Path) -> None:
    scene = folders / "inside" / "a.toml"
    scene.write_text(f"{BALL}'../outside/ball.obj'\n")
    loaded = Scene.load(scene, allow_outside=True)
    assert loaded.colliders[0].arguments["mesh"] == str((folders / "outside" / "ball.obj").resolve())
    assert Scene.load(scene, {"colliders.0.mesh": str(folders / "outside" / "ball.obj")}) == loaded  # the user's word
    assert Scene.from_toml(loaded.to_toml()) == loaded  # as a cache keeps it, for which its user was asked
    with pytest.raises(InvalidInput, match="folder or below"):
        Scene.load(scene, {"colliders.0.friction": 0.5})
    scene.write_text(f"{BALL}'ball.obj'\n[[forces]]\ntype = 'field'\ngrid = {{ path = '../a.npz' }}\n")
    with pytest.raises(InvalidInput, match="folder or below"):
        Scene.load(scene, {"forces.0.grid.outside": "wrap"})


@pytest.mark.parametrize("path", ["ball.obj", "../inside/ball.obj", "deep/ball.obj", "deep/link.obj"])
def test_files_below_the_folder_are_found_through_links_too(
    path: str, folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = folders / "inside"
    (inside / "deep").mkdir()
    (inside / "deep" / "ball.obj").write_bytes((inside / "ball.obj").read_bytes())
    (inside / "deep" / "link.obj").symlink_to("../ball.obj")
    (inside / "a.toml").write_text(f"{BALL}{path!r}\n")
    (folders / "way").symlink_to(inside)
    for place in (inside / "a.toml", folders / "way" / "a.toml"):
        assert len(Scene.load(place).colliders) == 1
    monkeypatch.chdir(inside)
    assert len(Scene.load("a.toml").colliders) == 1


def test_settings_reach_into_the_text() -> None:
    text = dumps(scene_with("forces", {"type": "gravity"}))
    scene = Scene.from_toml(text, {"forces.0.k": 0.7, "dt": 0.5, "look.color": "red", "solver.type": "rk4"})
    assert (scene.forces[0].arguments, scene.dt, scene.look.color) == ({"k": 0.7}, 0.5, "red")
    assert scene.solver is not None
    for path in ("forces.7.k", "forces.x.k", "dt.k", "forces.0.k.j", "forces.0"):
        with pytest.raises(InvalidInput):
            Scene.from_toml(text, {path: 0.7})


# ------------------------------------------------------------------------------------------------------ wrong in text

BODY = '[[bodies]]\ntype = "chain"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("dt = ", "the scene is not TOML"),
        ("version = 2\n" + BODY, "the scene has version 2: this pointmass reads version 1"),
        ("colour = 1\n" + BODY, "unknown key in the scene: 'colour'"),
        ('dt = "fast"\n' + BODY, r"dt = 'fast' is not allowed: it must be a number greater than 0 \[s\]"),
        ("dt = true\n" + BODY, "dt = True is not allowed: it must be a number"),
        ("dt = 0\n" + BODY, "dt = 0 is not allowed"),
        ("dt = nan\n" + BODY, "dt = nan is not allowed"),
        ("frames = 1.5\n" + BODY, "frames = 1.5 is not allowed: it must be a whole number, at least 1"),
        ("seed = -1\n" + BODY, "seed = -1 is not allowed"),
        ('dtype = "float16"\n' + BODY, "dtype = 'float16' is not allowed: it must be 'float64' or 'float32'"),
        ('[bodies]\ntype = "chain"\n', r"bodies must be a list of tables: begin each with \[\[bodies\]\]"),
        ("bodies = [1]\n", "bodies.0 must be a table with a type, not 1"),
        ("[[bodies]]\nlinks = 3\n", "bodies.0 needs a type: one of"),
        ('[[bodies]]\ntype = "chian"\n', "unknown type in bodies.0: 'chian': did you mean 'chain'"),
        ("[[bodies]]\ntype = [1]\n", "unknown type in bodies.0"),
        ('[[bodies]]\ntype = "scatter"\n', r"bodies.0 \(scatter\) needs 'count': a whole number"),
        (BODY + "lenght = 2\n", r"unknown key in bodies.0 \(chain\): 'lenght': did you mean 'length'"),
        (BODY + "links = 2.5\n", "bodies.0.links = 2.5 is not allowed: it must be a whole number"),
        (BODY + f"links = {10**30}\n", "bodies.0.links = 10+ is not allowed: a whole number has at most 64 bits"),
        (BODY + f"links = {10**18}\n", r"bodies.0 \(chain\) does not fit into memory"),
        (BODY + "mass = -1\n", r"bodies.0 \(chain\): mass = -1 is not allowed"),
        (BODY + "name = 3\n", "bodies.0.name = 3 is not allowed: it must be text in quotes"),
        (BODY + '[look]\ncolour = "red"\n', "unknown key in look: 'colour': did you mean 'color'"),
        (
            BODY + '[look]\nparticles = "shiny"\n',
            "look.particles = 'shiny' is not allowed: .* 'solid', 'glow', .* or 'none'",
        ),
        (
            BODY + "[look]\ncolor_range = [1]\n",
            r"look.color_range = \[1\] is not allowed: it must be a list of 2 numbers",
        ),
        (BODY + "[[look]]\n", "look must be a table, not"),
        (BODY + "[camera]\nposition = 3\n", "camera.position = 3 is not allowed: it must be a list of 3 numbers"),
        (BODY + "[camera]\nazimuth = inf\n", "camera.azimuth = inf is not allowed: it must be a finite number"),
        (BODY + "[camera]\nfov = 200\n", "camera.fov = 200 is not allowed"),
        ('solver = "rk5"\n' + BODY, "unknown solver 'rk5': did you mean 'rk4'"),
        ("solver = 4\n" + BODY, "solver must be a name such as 'rk4', or a table with a type, not 4"),
        (
            BODY + '[solver]\ntype = "dopri5"\nrtoll = 1\n',
            r"unknown key in solver \(dopri5\): 'rtoll': did you mean 'rtol'",
        ),
        (BODY + '[solver]\ntype = "dopri5"\nrtol = "x"\n', "solver.rtol = 'x' is not allowed: it must be a number"),
        (BODY + '[[forces]]\ntype = "drag"\nk = -1\n', r"forces.0 \(drag\): k = -1 is not allowed"),
        (
            BODY + '[[forces]]\ntype = "drag"\nk = {}\n',
            "forces.0.k = {} is not allowed: it must be a number, a formula",
        ),
        (BODY + '[[forces]]\ntype = "drag"\nk = nan\n', r"forces.0 \(drag\)?.*k = nan is not allowed|forces.0.k = nan"),
        (BODY + '[[forces]]\ntype = "field"\nforce = ["__import__(1)", "0", "0"]\n', r"forces.0 \(field\)"),
        (BODY + '[[forces]]\ntype = "wind"\nvelocity = { type = "gravity" }\n', "unknown type in forces.0.velocity"),
        (BODY + '[[forces]]\ntype = "wind"\nvelocity = { type = "vortex", ep = 1 }\n', "did you mean 'eps'"),
        (BODY + '[[forces]]\ntype = "flow"\ngrid = { pth = "a.npz" }\n', "unknown key in forces.0.grid: 'pth'"),
        (BODY + '[[forces]]\ntype = "springs"\npairs = [[1, 1]]\n', "joins particle 1 with itself"),
        (BODY + '[[forces]]\ntype = "springs"\npairs = [[1, 99]]\n', "joins particle 99, which does not exist"),
        (
            BODY + '[[forces]]\ntype = "gravity"\non = "chane"\n',
            "unknown group of particles 'chane': did you mean 'chain'",
        ),
        (BODY + '[[colliders]]\ntype = "plane"\nrestitution = 1.5\n', "restitution = 1.5 is not allowed"),
        (BODY + "name = 'a'\n" + BODY + "name = 'a'\n", "bodies need different names"),
        ('name = "empty"\n', "a scene needs at least one body or emitter"),
    ],
)
def test_one_sentence_about_what_is_wrong(text: str, sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence) as caught:
        Scene.from_toml(text).simulation()
    assert "\n" not in str(caught.value)


def test_files_that_are_no_scenes(tmp_path: Path) -> None:
    (tmp_path / "image.toml").write_bytes(b"\xff\xfe\x00")
    for path, sentence in (
        ("image.toml", "it is not text in UTF-8"),
        ("none.toml", "No such file"),
        (".", "directory"),
    ):
        with pytest.raises(InvalidInput, match=sentence):
            Scene.load(tmp_path / path)


# --------------------------------------------------------------------------------------------------------------- fuzz

SEEDS = [
    {
        "dt": 0.01,
        "solver": {"type": "dopri5", "rtol": 1e-4},
        "camera": {"position": [0.0, 1.0, 3.0]},
        "look": {"color_by": "speed"},
        "bodies": [
            {"type": "chain", "links": 2, "name": "a"},
            {"type": "points", "x": [[0.0, 1.0, 0.0]], "attributes": {"charge": 1.0}},
        ],
        "forces": [
            {"type": "gravity", "on": "a"},
            {"type": "wind", "velocity": {"type": "vortex", "eps": 0.1}},
            {"type": "springs", "pairs": [[0, 1]], "rest": 1.0},
            {"type": "field", "force": ["-k*x", "0", "0"], "constants": {"k": 1.0}},
        ],
        "colliders": [{"type": "plane", "point": [0.0, -1.0, 0.0]}],
        "emitters": [{"type": "nozzle", "rate": 5.0}],
    }
]
JUNK = st.one_of(
    st.sampled_from(
        [
            None,
            "",
            "x",
            "1/0",
            "a.b",
            [],
            {},
            [[]],
            [{}],
            True,
            -1,
            0,
            10**30,
            10**18,
            1e308,
            float("nan"),
            float("inf"),
        ]
    ),
    st.sampled_from(
        [
            "gravity",
            "points",
            "rk4",
            "speed",
            {"type": "gravity"},
            [[0, 1, 2]],
            ["0", "0"],
            tomllib.loads("d=2020-01-01")["d"],
        ]
    ),
    st.integers(-3, 3),
    st.floats(-2, 2),
    st.text(max_size=5),
).map(copy.deepcopy)  # mutations change it


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every container with every key or index in it."""
    items = (
        list(value.items()) if isinstance(value, dict) else list(enumerate(value)) if isinstance(value, list) else []
    )
    return [(value, key) for key, _ in items] + [place for _, item in items for place in places(item)]


def mutate(draw: Any, document: dict[str, Any]) -> dict[str, Any]:
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        spots = places(document)
        if not spots:
            break
        container, key = draw(st.sampled_from(spots))
        match draw(st.integers(0, 4)):
            case 0:
                del container[key]
            case 1 if isinstance(container, list):
                container.append(copy.deepcopy(container[key]))
            case 2 if isinstance(container, dict):
                container[draw(st.text(max_size=4) | st.sampled_from(["type", "name", "on", "grid", "velocity"]))] = (
                    draw(JUNK)
                )
            case _:
                container[key] = draw(JUNK)
    return document


def try_document(data: Any) -> None:
    document = mutate(data.draw, data.draw(st.sampled_from(SEEDS)))
    try:
        scene = Scene.from_document(document)
        with np.errstate(all="ignore"):
            scene.simulation()
            # A step of a mutated size, or an adaptive solver, may rightly take hours.
            list(scene.changed(dt=0.01, solver=None).simulation().frames(2, 100))
    except (InvalidInput, Diverged) as error:
        sentence = str(error)
    else:
        assert Scene.from_toml(scene.to_toml()) == scene
        return
    assert "\n" not in sentence


@given(st.data())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_mutations_of_a_scene_give_a_sentence_or_a_scene(data: Any) -> None:
    try_document(data)


@pytest.mark.full
@given(st.data())
@settings(max_examples=3_000, deadline=None)
def test_many_mutations(data: Any) -> None:
    try_document(data)


# --------------------------------------------------------------------------------------------------------------- TOML

PLAIN = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(alphabet=st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=5), inner, max_size=4)
    ),
    max_leaves=20,
)


@given(st.dictionaries(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=5), PLAIN, max_size=5))
@settings(max_examples=200, deadline=None)
def test_toml_comes_back(document: dict[str, Any]) -> None:
    assert tomllib.loads(dumps(document)) == document


def test_toml_of_many_particles_is_quick() -> None:
    scene = Scene(bodies=[pm.points(np.linspace(0, 1, 30_000).reshape(-1, 3))])
    assert Scene.from_toml(scene.to_toml()) == scene


def test_look_keeps_its_defaults_out_of_the_text() -> None:
    text = Scene(
        bodies=[pm.chain(2)], look=Look(color_by="speed", color_range=(0.0, 2.0)), camera=pm.Camera(fov=30.0)
    ).to_toml()
    assert text.endswith('[camera]\nfov = 30.0\n\n[look]\ncolor_by = "speed"\ncolor_range = [0.0, 2.0]\n')


def test_marks_of_windows_editors_are_no_mistakes(tmp_path: Path) -> None:
    text = '[[bodies]]\ntype = "chain"\nlinks = 2\n'
    (tmp_path / "w.toml").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert Scene.load(tmp_path / "w.toml") == Scene.from_toml(text)


def test_what_a_mesh_looks_up_is_built_once() -> None:
    ground = pm.HeightField(np.zeros((3, 3)), friction=0.9)
    scene = pm.Scene(bodies=[pm.chain(2)], colliders=[ground])
    one, other = (scene.simulation().system.colliders[0] for _ in range(2))
    assert one.tree is other.tree is ground.tree
    one.friction = 0.1
    assert (ground.friction, other.friction) == (0.9, 0.9)
