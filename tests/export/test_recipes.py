"""The recipe for Blender in docs/caches.md, where its module is installed; test_docs runs the others."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import pointmass as pm
from pointmass.export import export

PAGE = Path(__file__).parents[2] / "docs" / "caches.md"


@pytest.mark.skipif(find_spec("bpy") is None, reason="needs Blender's module: pip install bpy")
def test_blender_counts_what_arrives(tmp_path: Path) -> None:
    scene = pm.Scene(
        bodies=[pm.cloth(4, 4)],
        emitters=[pm.Nozzle(rate=200.0, lifetime=pm.Spread(0.3, 0.1))],
        forces=[pm.Gravity()],
        colliders=[pm.Plane((0, -0.2, 0))],
    )
    frames = list(scene.simulation().frames(60))
    export(frames, tmp_path / "fountain.usd")
    found = re.search(r"```py\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    count = "\nprint(sorted(o.type for o in bpy.data.objects))"
    run = subprocess.run(
        [sys.executable, "-c", found[1] + count], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    *_, early, late, kinds = run.stdout.strip().splitlines()
    assert (early, late) == (f"10 {len(frames[10].ids)}", f"59 {len(frames[59].ids)}")
    assert kinds.count("MESH") == 2  # the cloth and the floor
    assert kinds.count("POINTCLOUD") == 1
