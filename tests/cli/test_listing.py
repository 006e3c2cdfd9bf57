"""`pointmass list NAME`: what a scene may hold, explained."""

from __future__ import annotations

import json

from click.testing import CliRunner, Result

import pointmass as pm
from pointmass.cli import main
from pointmass.cli.listing import KINDS
from pointmass.schema import LISTS, entry_model


def listed(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["list", *arguments], catch_exceptions=False)


def test_every_type_is_there_with_its_parameters() -> None:
    text = " ".join(listed().stdout.split())
    for what, registry in {**LISTS, "solver": pm.SOLVERS}.items():
        for name in registry:
            assert name in text
            entries = json.loads(listed(name, "--json").stdout)["entries"]
            parameters = [p["name"] for e in entries if e["kind"] == KINDS[what] for p in e["parameters"]]
            assert parameters == [n for n in entry_model(what, name).model_fields if n != "type"]


def test_for_people() -> None:
    drag = " ".join(listed("drag").stdout.split())
    assert drag.startswith('drag, a force f = -k v (lecture, "Viscous drag")')
    assert "k 0.1 drag coefficient [N s/m], at least 0" in drag
    assert "on the group" in drag


def test_one_name_for_a_scene_and_a_type() -> None:
    text = listed("springs").stdout
    assert text.index("springs, a scene") < text.index("springs, a force")
    assert "side" in text
    assert "k_s" in text


def test_camera_look_and_other_names_of_solvers() -> None:
    assert "azimuth" in listed("camera").stdout
    assert "palette" in listed("look").stdout
    assert listed("verlet").stdout == listed("leapfrog").stdout


def test_an_unknown_name() -> None:
    done = listed("nozle")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("pointmass: unknown name 'nozle': did you mean 'nozzle'? known are ")
