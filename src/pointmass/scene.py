"""The description of a scene: in Python, as text (TOML), and from either a simulation.

A scene is bodies, forces, colliders, emitters, a solver, a camera and a look. Each object remembers how it was made, so a scene
written in Python can be saved as text, and a text gives the same scene back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from pointmass.bodies.body import BODIES, Body, join
from pointmass.collisions import COLLIDERS
from pointmass.collisions.collider import Collider
from pointmass.description import Described
from pointmass.emitters import EMITTERS
from pointmass.emitters.emitter import Emitter
from pointmass.errors import InvalidInput, number, unknown, whole_number
from pointmass.forces import FORCES
from pointmass.frame import Camera
from pointmass.laws.force import Force
from pointmass.look import Look
from pointmass.particles import Particles
from pointmass.simulation import DEFAULT_DT, Simulation
from pointmass.solvers import SOLVERS, find_solver
from pointmass.solvers.base import Solver
from pointmass.system import ParticleSystem

VERSION = 1
LISTS: dict[str, Mapping[str, Any]] = {"bodies": BODIES, "forces": FORCES, "colliders": COLLIDERS, "emitters": EMITTERS}


@dataclass(kw_only=True)
class Scene:
    """Everything that a run depends on.

    Attributes
    ----------
    bodies : what there is at the start; names make groups that forces can act on.
    names : of the bodies; by default their kind, numbered where it occurs twice.
    forces : on all particles, after the bodies' own.
    colliders, emitters : surfaces and sources.
    solver : None = SymplecticEuler, or RK4 for a flow.
    dt : the solver's step [s].
    frames, fps : length of the run, and looks per second, where nothing else is asked for.
    seed : of all chance while it runs.
    dtype : "float64" or "float32".
    camera, look : what a picture shows.
    name, summary : for people.

    Raises
    ------
    InvalidInput
        A number that is not allowed, or something in a list that does not belong there.
    """

    name: str = "scene"
    summary: str = ""
    dt: float = DEFAULT_DT
    frames: int = 240
    fps: float = 60.0
    seed: int = 0
    dtype: str = "float64"
    solver: Solver | None = None
    bodies: Sequence[Body] = ()
    names: Sequence[str] = ()
    forces: Sequence[Force] = ()
    colliders: Sequence[Collider] = ()
    emitters: Sequence[Emitter] = ()
    camera: Camera = field(default_factory=Camera)
    look: Look = field(default_factory=Look)

    def __post_init__(self) -> None:
        self.dt = number("dt", self.dt, above=0, unit="s")
        self.fps = number("fps", self.fps, above=0, unit="1/s")
        self.frames = whole_number("frames", self.frames, at_least=1)
        self.seed = whole_number("seed", self.seed, at_least=0)
        if self.dtype not in ("float64", "float32"):
            raise InvalidInput(f"dtype = {self.dtype!r} is not allowed: it must be float64 or float32")
        for what, kind in (("bodies", Body), ("forces", Force), ("colliders", Collider), ("emitters", Emitter)):
            for item in getattr(self, what):
                if not isinstance(item, kind):
                    raise InvalidInput(f"{what} of a scene cannot hold {item!r}")
        if self.solver is not None and not isinstance(self.solver, Solver):
            raise InvalidInput(f"solver must be a solver, such as pm.RK4(), not {self.solver!r}")
        if not self.bodies and not self.emitters:
            raise InvalidInput("a scene needs at least one body or emitter: there are no particles")
        self.names = list(self.names) or _numbered([b.kind or "particles" for b in self.bodies])
        if len(self.names) != len(self.bodies):
            raise InvalidInput(f"names has {len(self.names)} entries for {len(self.bodies)} bodies")

    def simulation(self) -> Simulation:
        """A fresh simulation; every call gives the same."""
        particles, own = join([_rebuilt(b) for b in self.bodies], self.names, np.dtype(self.dtype))
        forces = own + [_again(f) for f in self.forces]
        system = ParticleSystem(particles, forces, [_again(c) for c in self.colliders])
        solver = None if self.solver is None else _again(self.solver)
        emitters = [_again(e) for e in self.emitters]
        return Simulation(system, solver, self.dt, emitters=emitters, look=self.look, seed=self.seed)

    # ------------------------------------------------------------------------------------------------ as text

    def document(self) -> dict[str, Any]:
        """The scene as plain tables, lists and numbers.

        Raises
        ------
        InvalidInput
            It holds something that was written in Python and has no text.
        """
        result: dict[str, Any] = {"version": VERSION}
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name in ("name", "summary", "dt", "frames", "fps", "seed", "dtype") and (value != f.default or f.name == "name"):
                result[f.name] = value
        if self.solver is not None:
            result["solver"] = _table(SOLVERS, self.solver, self.solver.arguments, "solver")
        for what, registry in LISTS.items():
            tables = [_table(registry, item, item.arguments, what) for item in getattr(self, what)]
            if tables:
                result[what] = tables
        for table, name in zip(result.get("bodies", ()), self.names, strict=True):
            table["name"] = name
        camera = {f.name: _plain(getattr(self.camera, f.name), "camera") for f in fields(Camera) if getattr(self.camera, f.name) != f.default}
        look = {name: _plain(value, "look") for name, value in self.look.described().items()}
        return result | {k: v for k, v in (("camera", camera), ("look", look)) if v}

    def to_toml(self) -> str:
        """The scene as TOML; `from_toml` gives an equal one back."""
        import tomlkit

        return tomlkit.dumps(self.document())

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML, beside and renamed."""
        path = Path(path)
        part = path.with_name(path.name + ".part")
        try:
            part.write_text(self.to_toml(), encoding="utf-8")
            part.replace(path)
        except OSError as error:
            raise InvalidInput(f"cannot write {path}: {error.strerror}") from None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.document() == other.document()

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def from_toml(cls, text: str, settings: Mapping[str, Any] | None = None, folder: Path | None = None) -> Scene:
        """A scene from TOML.

        Parameters
        ----------
        settings : values to change before it is read, by path, such as {"forces.0.k": 0.2}.
        folder : where the paths of files in it start.

        Raises
        ------
        InvalidInput
            Not TOML, an unknown key or kind, a value that is not allowed.
        """
        import tomllib

        try:
            document = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise InvalidInput(f"the scene is not TOML: {error}") from None
        for path, value in (settings or {}).items():
            _set(document, path, value)
        return cls.from_document(document, folder)

    @classmethod
    def from_document(cls, document: Mapping[str, Any], folder: Path | None = None) -> Scene:
        """A scene from plain tables, as `document` makes them."""
        from pointmass.schema import checked

        d = dict(checked(document))
        if d.pop("version", VERSION) != VERSION:
            raise InvalidInput(f"the scene has version {document['version']}: this pointmass reads version {VERSION}")
        bodies = [dict(b) for b in d.pop("bodies", ())]
        named = [b.pop("name", None) for b in bodies]
        numbered = _numbered([b["type"] for b in bodies])
        values = {what: [_made(LISTS[what], item, what, k, folder) for k, item in enumerate(d.pop(what, ()))] for what in LISTS if what != "bodies"}
        solver = d.pop("solver", None)
        return cls(
            bodies=[_made(BODIES, b, "bodies", k, folder) for k, b in enumerate(bodies)],
            names=[n or default for n, default in zip(named, numbered, strict=True)],
            solver=None if solver is None else _made_solver(solver),
            camera=_settings(Camera, d.pop("camera", {})),
            look=_settings(Look, d.pop("look", {})),
            **values,
            **d,
        )

    @classmethod
    def load(cls, path: str | Path, settings: Mapping[str, Any] | None = None) -> Scene:
        """A scene from a TOML file."""
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidInput(f"cannot read the scene {path}: {getattr(error, 'strerror', None) or error}") from None
        return cls.from_toml(text, settings, path.parent)

    def changed(self, **values: Any) -> Scene:
        """A copy with other values, such as `scene.changed(dt=1e-3)`."""
        return replace(self, **values)


def body_of(particles: Particles, forces: Sequence[Force] = ()) -> Body:
    """A body for scenes from particles and forces that were made by hand."""
    p = particles
    arguments = {"x": p.x, "v": p.v, "m": p.m, "radius": p.radius, "pinned": np.flatnonzero(p.pinned).tolist()}
    if p.attributes:
        arguments["attributes"] = dict(p.attributes)
    return Body(p, list(forces), "points", arguments)


def _again(item: Any) -> Any:
    return type(item)(**item.arguments)


def _rebuilt(body: Body) -> Body:
    fresh = BODIES[body.kind](**body.arguments) if body.kind in BODIES else body
    return Body(fresh.particles, fresh.forces if body.kind != "points" else [_again(f) for f in body.forces])


def _numbered(kinds: Sequence[str]) -> list[str]:
    seen: dict[str, int] = {}
    result = []
    for kind in kinds:
        seen[kind] = seen.get(kind, 0) + 1
        result.append(kind if kinds.count(kind) == 1 else f"{kind}{seen[kind]}")
    return result


def _table(registry: Mapping[str, Any], item: Any, arguments: Mapping[str, Any], what: str) -> dict[str, Any]:
    kind = item.kind if isinstance(item, Body) else next((k for k, c in registry.items() if type(item) is c), None)
    if kind not in registry:
        raise InvalidInput(f"{type(item).__name__} was written in Python and has no text: in a scene file, write a law as a field")
    if isinstance(item, Body) and kind == "points" and item.forces:
        raise InvalidInput("a body of points with forces of its own has no text: give the forces to the scene")
    return {"type": kind} | {name: _plain(value, f"{what} {kind}.{name}") for name, value in arguments.items()}


def _plain(value: Any, where: str) -> Any:
    """Numbers, strings, lists and tables only."""
    if isinstance(value, Described):
        return _table(FORCES, value, value.arguments, where)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(k): _plain(v, where) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple, set)):
        return [_plain(v, where) for v in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (str, bool, int, float)):
        return value
    if getattr(value, "path", None) is not None:
        return str(value.path)
    raise InvalidInput(f"{where} = {value!r} was written in Python and has no text: use a number or a formula")


def _made(registry: Mapping[str, Any], table: Mapping[str, Any], what: str, k: int, folder: Path | None) -> Any:
    values = dict(table)
    kind = values.pop("type")
    for name, value in values.items():
        if isinstance(value, Mapping) and "type" in value:
            values[name] = _made(FORCES, value, f"{what}.{k}.{name}", 0, folder)
        if name == "grid" and folder is not None and isinstance(value, str):
            values[name] = str(folder / value)
    try:
        return registry[kind](**values)
    except InvalidInput as error:
        raise InvalidInput(f"{what}.{k} ({kind}): {error}") from None


def _made_solver(table: Any) -> Solver:
    values = {"type": table} if isinstance(table, str) else dict(table)
    return find_solver(values.pop("type"))(**values)


def _settings(kind: Any, table: Mapping[str, Any]) -> Any:
    known = {f.name for f in fields(kind)}
    for name in table:
        if name not in known:
            raise unknown(f"key in {kind.__name__.lower()}:", name, known)
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in table.items()})


def _set(document: dict[str, Any], path: str, value: Any) -> None:
    """Set a value by its path, such as forces.0.k."""
    *way, last = path.split(".")
    here: Any = document
    for part in way:
        here = _inside(here, part, path) if isinstance(here, list) or part in here else here.setdefault(part, {})
    if isinstance(here, list):
        _inside(here, last, path)
        here[int(last)] = value
    elif isinstance(here, dict):
        here[last] = value
    else:
        raise InvalidInput(f"the scene has no {path!r}: use a path such as forces.0.k")


def _inside(here: Any, part: str, path: str) -> Any:
    try:
        return here[int(part)] if isinstance(here, list) else here[part]
    except (ValueError, IndexError, KeyError, TypeError):
        raise InvalidInput(f"the scene has no {path!r}: use a path such as forces.0.k") from None


def finite(value: float) -> float | None:
    """A number for JSON: None where there is none (infinity, NaN)."""
    return value if math.isfinite(value) else None
