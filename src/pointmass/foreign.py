"""Files of other programs that hold whole scenes: opened, and what is hidden in them left out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from pointmass.errors import InvalidInput, shown


def shown_scene(file: Path) -> Any:
    """A trimesh scene of what is seen in a file: who moves comes and goes by a scale of 0 in glTF."""
    import trimesh

    if file.suffix.lower() == ".gltf":
        document = json.loads(file.read_bytes())  # of one that is none, trimesh would read a `model.gltf` beside it
        _check_inside(file, [item.get("uri", "") for what in ("buffers", "images") for item in document.get(what, [])])
    scene = trimesh.load_scene(file, process=False)
    nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    shown = {name for to_world, name in nodes if np.linalg.det(to_world[:3, :3]) != 0}
    scene.delete_geometry(set(scene.geometry) - shown)
    return scene


def _check_inside(file: Path, names: Sequence[str]) -> None:
    """Refuse a file that names others outside of its folder."""
    folder = file.parent.resolve()
    for name in names:
        if not name.startswith("data:") and not (folder / unquote(name)).resolve().is_relative_to(folder):
            raise InvalidInput(f"it names {shown(name)}, which is outside of its folder: put it there")
