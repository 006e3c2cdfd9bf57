"""What loads what: importing pointmass is quick, and the layers hold."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import pointmass as pm

HEAVY = (
    "numba",
    "scipy",
    "pydantic",
    "zarr",
    "numcodecs",
    "av",
    "PIL",
    "rich",
    "click",
    "starlette",
    "matplotlib",
    "trimesh",
    "pxr",
    "vtkmodules",
    "gsd",
)
SOURCES = Path(pm.__file__).parent
PIPELINES = "render/inner.py", "engine/inner.py", "engine/passes.py"
TEXTS = (
    "engine/support.py",
    "engine/contact_text.py",
    "engine/distances_text.py",
    "engine/surfaces_text.py",
    "engine/triangles_text.py",
)  # what kernels import, and kernels' texts


def loaded_by(code: str) -> set[str]:
    program = f"{code}\nimport sys, json; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return {name.split(".")[0] for name in json.loads(done.stdout.splitlines()[-1])}


def test_importing_pointmass_loads_nothing_heavy() -> None:
    assert not loaded_by("import pointmass") & {*HEAVY}


def test_a_scene_in_python_needs_no_film_or_cache() -> None:
    code = "import pointmass as pm; pm.Scene(bodies=[pm.chain(2)], forces=[pm.Gravity()]).simulation()"
    assert not loaded_by(code) & {"numba", "pydantic", "zarr", "av", "rich", "click"}


def test_listing_scenes_loads_nothing_heavy() -> None:
    heavy = {"numba", "scipy", "pydantic", "zarr", "av"}
    assert not loaded_by("import pointmass.cli, pointmass.scenes") & heavy


@pytest.mark.parametrize(
    "registry", ["FORCES", "COLLIDERS", "EMITTERS", "ZONES", "MOTIONS", "CONSTRAINTS", "SOLVERS", "BODIES"]
)
def test_everything_in_a_registry_is_public(registry: str) -> None:
    for entry in getattr(pm, registry).values():
        assert getattr(pm, entry.__name__, None) is entry


@pytest.mark.parametrize("name", pm.__all__)
def test_every_public_name_is_there_and_explained(name: str) -> None:
    value = getattr(pm, name)
    assert name in dir(pm)
    if callable(value):
        assert (value.__doc__ or "").strip(), f"{name} has no docstring"


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="Gravty"):
        _ = pm.Gravty  # type: ignore[attr-defined]


def test_numba_is_imported_by_kernels_and_on_first_use_only() -> None:
    for path in SOURCES.rglob("*.py"):
        where = path.relative_to(SOURCES).as_posix()
        tree = ast.parse(path.read_text())
        first = {id(node) for node in tree.body}
        for node in ast.walk(tree):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.split(".")[0] == "numba" for name in names):
                kernel = path.name.startswith("kernels") or where in (*PIPELINES, *TEXTS)
                lazy = id(node) not in first and where.split("/")[0] in ("render", "engine", "cli")
                assert kernel or lazy, f"{where} line {node.lineno} imports numba"
