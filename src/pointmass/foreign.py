"""Files of other programs that hold whole scenes: opened, without what is hidden, and without files elsewhere."""

from __future__ import annotations

import json
import math
import re
from base64 import b64decode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, shown

DENSEST = 10_000  # numbers that a byte of a compressed file may stand for
LONGER = "it is damaged: it says that it holds more than its length allows; write it again"
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float64)  # rows: where the axes of such a file are


def shown_scene(file: Path) -> Any:
    """A trimesh scene of what is seen in a file: who moves comes and goes by a scale of 0 in glTF."""
    import trimesh

    if file.suffix.lower() == ".gltf":
        document = json.loads(file.read_bytes())  # of one that is none, trimesh would read a `model.gltf` beside it
        check_inside(file, [item.get("uri", "") for what in ("buffers", "images") for item in document.get(what, [])])
    scene = trimesh.load_scene(file, process=False)
    nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    shown = {name for to_world, name in nodes if np.linalg.det(to_world[:3, :3]) != 0}
    scene.delete_geometry(set(scene.geometry) - shown)
    return scene


def poly_data(file: Path) -> Any:
    """What is in a `.vtp` file, by VTK."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    _check_lengths(file)
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(file))
    with _quiet():
        reader.Update()
    if reader.GetErrorCode():
        raise ValueError(reader.GetErrorCode())
    return reader.GetOutput()


def _check_lengths(file: Path) -> None:
    """Refuse arrays that are said to be longer than what the file can hold: VTK would read on for minutes, or crash.

    An array begins with its length, a compressed one with the number and the length of its blocks.
    """
    with file.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        appended = data.find(b"<AppendedData")
        head = data[: appended if appended >= 0 else len(data)]
        raw = appended >= 0 and re.match(rb'[^>]*encoding="raw"', data[appended : appended + 200]) is not None
        order = ">" if b'byte_order="BigEndian"' in head else "<"
        number = order + ("u8" if b'header_type="UInt64"' in head else "u4")
        count = 3 if b'compressor="' in head else 1
        size = count * int(number[-1])
        first = data.find(b"_", appended) + 1
        starts = [(first + int(offset), raw) for offset in re.findall(rb'Array[^>]*\soffset="([^"]*)"', head)]
        inline = re.finditer(rb'Array[^>]*format="binary"[^>]*>\s*(?=[^<\s])', head)
        starts += [(found.end(), False) for found in inline]
        wide = max((int(many) for many in re.findall(rb'NumberOfComponents="([^"]*)"', head)), default=1)
        lengths = [wide * int(many) for many in re.findall(rb'NumberOf(?!Components)\w+="([^"]*)"', head)]
        for start, plain in starts:
            code = data[start : start + (size if plain else 4 * math.ceil(size / 3))]
            numbers = np.frombuffer((code if plain else b64decode(code))[:size], number).tolist()
            lengths.append(math.prod(numbers[:2]))
            if len(numbers) == 3:
                blocks, length, last = numbers
                if blocks > len(data) or last > (length if blocks else 0):  # each block has a length of its own
                    raise InvalidInput(LONGER)
        if max(lengths, default=0) > DENSEST * len(data):
            raise InvalidInput(LONGER)


@contextmanager
def _quiet() -> Iterator[None]:
    """VTK says nothing on stderr; what is wrong, an error says."""
    from vtkmodules.vtkCommonCore import vtkObject

    before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(before)


def open_stage(file: Path) -> Any:
    """A USD stage with all that it refers to, which must be in its folder."""
    from pxr import Tf, Usd

    try:
        stage = Usd.Stage.Open(str(file))
    except Tf.ErrorException as error:
        raise ValueError(str(error)) from None
    others = [layer for layer in stage.GetUsedLayers() if layer != stage.GetRootLayer()]
    check_inside(file, [layer.realPath for layer in others if layer.realPath])
    return stage


def last_time(stage: Any) -> Any:
    """The time of the last frame of a stage, or of whatever it has where it says nothing of frames."""
    from pxr import Usd

    ranged = stage.HasAuthoredTimeCodeRange()
    return Usd.TimeCode(stage.GetEndTimeCode()) if ranged else Usd.TimeCode.EarliestTime()


def shown_prims(stage: Any, kind: Any, time: Any) -> list[Any]:
    """What there is of a kind in a stage and is seen, such as all `UsdGeom.Points`."""
    from pxr import Usd, UsdGeom

    prims = [kind(prim) for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(kind)]
    hidden = (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)  # a simple form beside what is rendered
    shown = [prim for prim in prims if prim.ComputeVisibility(time) != UsdGeom.Tokens.invisible]
    return [prim for prim in shown if prim.ComputePurpose() not in hidden]


def to_world(stage: Any, prim: Any, time: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What leads from a prim to metres with y up: a matrix from the right, shape (3, 3), and a shift."""
    from pxr import UsdGeom

    whole = UsdGeom.GetStageMetersPerUnit(stage) * np.array(prim.ComputeLocalToWorldTransform(time))[:, :3]
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        whole = whole @ Z_UP
    return whole[:3], whole[3]


def check_inside(file: Path, names: Sequence[str]) -> None:
    """Refuse a file that names others outside of its folder."""
    folder = file.parent.resolve()
    for name in names:
        if not name.startswith("data:") and not (folder / unquote(name)).resolve().is_relative_to(folder):
            raise InvalidInput(f"it names {shown(name)}, which is outside of its folder: put it there")
