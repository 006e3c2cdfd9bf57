"""What frames follow from, and what an edit of it can affect."""

from __future__ import annotations

import ast
import hashlib
import json
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.scene import Scene
    from pointmass.simulation import Simulation

NO_MATTER = ("name", "summary", "frames", "camera", "fps")  # keys that change no frame; fps is compared apart
FOLLOWS = ("of", "on", "name", "at", "above")  # keys of an emitter by which it is tied to others
MIRRORED = {ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE}


@dataclass(frozen=True)
class Making:
    """Everything from which the frames of a run follow.

    Attributes
    ----------
    scene : as TOML.
    fps : frames per second of simulated time.
    files : hash of each file that the scene names.
    code : version of pointmass, and whether its engine compiles.
    """

    scene: str
    fps: float
    files: dict[str, str]
    code: dict[str, str]

    @classmethod
    def of(cls, scene: Scene | None, sim: Simulation, fps: float) -> Making | None:
        """That of a run; None if it cannot be known: a law written in Python has no text."""
        from pointmass import __version__

        try:
            text = None if scene is None else scene.to_toml()
        except InvalidInput:
            text = None
        if text is None:
            return None
        engine = "compiled" if sim.engine.wanted else "reference"
        return cls(text, fps, _files(tomllib.loads(text)), {"pointmass": __version__, "engine": engine})

    @classmethod
    def read(cls, attributes: Mapping[str, Any]) -> Making | None:
        """That of a cache, by its attributes."""
        about = attributes.get("making")
        return None if not isinstance(about, dict) else cls(attributes["scene"], float(attributes["fps"]), **about)

    def attributes(self) -> dict[str, Any]:
        """What a cache keeps of it, beside the scene and fps."""
        return {"making": {"files": self.files, "code": self.code}, "made_by": self.hash}

    @property
    def hash(self) -> str:
        """The same for two runs that have the same frames."""
        matters = {name: value for name, value in self._document().items() if name not in NO_MATTER}
        whole = [matters, self.fps, self.files, self.code]
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()

    def changes(self, new: Making) -> list[Change]:
        """What another one has otherwise, of all that matters to frames."""
        parts = [(self._document(), new._document()), (self.files, new.files), (self.code, new.code)]
        found = [change for old, now in parts for change in changes(old, now) if change.path[0] not in NO_MATTER]
        return found + ([Change(("fps",), self.fps, new.fps)] if self.fps != new.fps else [])

    def untouched_until(self, new: Making) -> float:
        """The time before which the frames of another one are surely the same [s]; inf if they all are.

        That is known of emitters that open later, and of formulas that ask for the time, such as
        ``3 if t > 6 else 0``.
        """
        if self.hash == new.hash:
            return math.inf
        if (self.fps, self.files, self.code) != (new.fps, new.files, new.code):
            return 0.0
        old, now = self._document(), new._document()
        single = "float32" in (old.get("dtype"), now.get("dtype"))  # where other text may round otherwise
        return min((_untouched(c, old, now, single) for c in changes(old, now)), default=math.inf)

    def _document(self) -> dict[str, Any]:
        return tomllib.loads(self.scene)


@dataclass(frozen=True)
class Change:
    """Something that one scene has otherwise than another.

    Attributes
    ----------
    path : where, such as ("forces", 0, "k").
    old, new : what is there; None where nothing is given.
    """

    path: tuple[str | int, ...]
    old: Any
    new: Any

    def __str__(self) -> str:
        return f"{'.'.join(map(str, self.path))}: {_shown(self.old)} -> {_shown(self.new)}"


def changes(old: Any, new: Any, path: tuple[str | int, ...] = ()) -> Iterator[Change]:
    """What two tables, lists or values have otherwise, in order."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(key for key in new if key not in old)]:
            yield from changes(old.get(key), new.get(key), (*path, key))
    elif _tables(old) and _tables(new):
        for k in range(max(len(old), len(new))):
            before, after = (each[k] if k < len(each) else None for each in (old, new))
            yield from changes(before, after, (*path, k))
    elif old != new:
        yield Change(path, old, new)


def _tables(value: Any) -> bool:
    """Whether something is a list of tables, such as forces."""
    return isinstance(value, list) and all(isinstance(item, dict) for item in value)


def _shown(value: Any) -> str:
    text = "the default" if value is None else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _files(value: Any) -> dict[str, str]:
    """Hashes of the files that a document names anywhere."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return {name: found for item in value for name, found in _files(item).items()}
    if isinstance(value, str) and len(value) < 1000 and "\n" not in value and Path(value).suffix:
        path = Path(value)
        return {value: hashlib.sha256(path.read_bytes()).hexdigest()} if path.is_file() else {}
    return {}


def _untouched(change: Change, old: dict[str, Any], new: dict[str, Any], single: bool) -> float:
    """The time before which a change does nothing [s]."""
    kind = change.path[0]
    if kind in NO_MATTER:
        return math.inf
    if isinstance(change.old, str) and isinstance(change.new, str) and not single:
        return same_until(change.old, change.new)
    if kind != "emitters" or len(change.path) < 2 or change.path[-1] in FOLLOWS:
        return 0.0
    k = change.path[1]
    assert isinstance(k, int)
    both = [each.get("emitters", [])[k : k + 1] for each in (old, new)]
    starts = [e.get("start", 0.0) if "of" not in e else 0.0 for emitters in both for e in emitters]
    followed = any("of" in e for each in (old, new) for e in each.get("emitters", []))
    return 0.0 if followed or "type" in change.path[2:] else float(min(starts))


def same_until(old: str, new: str) -> float:
    """The time before which two formulas are the same [s], as far as their comparisons with the time show."""
    try:
        trees = [ast.parse(text, mode="eval") for text in (old, new)]
    except (SyntaxError, ValueError, RecursionError):
        return 0.0
    times = sorted({time for tree in trees for time in _times(tree)}, reverse=True)
    for time in times:
        if len({ast.dump(_Before(time).visit(ast.parse(text, mode="eval"))) for text in (old, new)}) == 1:
            return time
    return 0.0


def _times(tree: ast.AST) -> Iterator[float]:
    """Times with which a formula compares t."""
    for node in ast.walk(tree):
        found = _asks(node)
        if found is not None:
            yield found[1]


def _asks(node: ast.AST) -> tuple[type[ast.cmpop], float] | None:
    """How a node compares t with a number, and with which: t > 6 and 6 < t are the same."""
    if not isinstance(node, ast.Compare) or len(node.ops) != 1 or type(node.ops[0]) not in MIRRORED:
        return None
    left, right, how = node.left, node.comparators[0], type(node.ops[0])
    if isinstance(right, ast.Name):
        left, right, how = right, left, MIRRORED[how]
    number = isinstance(right, ast.Constant) and isinstance(right.value, (int, float))
    if isinstance(left, ast.Name) and left.id == "t" and number:
        assert isinstance(right, ast.Constant)
        return how, float(right.value)  # type: ignore[arg-type]
    return None


class _Before(ast.NodeTransformer):
    """A formula as it is before a time: what is asked of the time later on is decided."""

    def __init__(self, time: float) -> None:
        self._time = time

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        """``a if t > 6 else b``."""
        return self._branch(node, node.test, node.body, node.orelse)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """``where(t > 6, a, b)``."""
        if isinstance(node.func, ast.Name) and node.func.id == "where" and len(node.args) == 3:
            return self._branch(node, *node.args)
        return self.generic_visit(node)

    def _branch(self, node: ast.AST, test: ast.expr, yes: ast.expr, no: ast.expr) -> ast.AST:
        asked = _asks(test)
        if asked is None or asked[1] < self._time:
            return self.generic_visit(node)
        early: ast.AST = self.visit(yes if asked[0] in (ast.Lt, ast.LtE) else no)
        return early
