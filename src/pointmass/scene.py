"""The description of a scene: in Python, as text (TOML), and from either a simulation.

A scene is bodies, forces, colliders, emitters, a solver, a camera and a look. Each object remembers how it was made,
so a scene written in Python can be saved as text, and a text gives the same scene back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import asdict, dataclass, field, fields, replace
from os.path import realpath
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pointmass.beside import beside
from pointmass.bodies import BODIES, Body, join
from pointmass.collisions import COLLIDERS
from pointmass.collisions.collider import Collider
from pointmass.collisions.looked_up import LookedUp
from pointmass.constraints import Constraint
from pointmass.controllers import Controller
from pointmass.description import Described
from pointmass.emitters import Normal, Spread
from pointmass.emitters.emitter import Emitter
from pointmass.errors import InvalidInput, number, unknown, whole_number
from pointmass.forces import FORCES, load_grid
from pointmass.forces.air import VELOCITIES
from pointmass.frame import Camera
from pointmass.laws.force import Force
from pointmass.laws.grid import Grid
from pointmass.look import Look
from pointmass.meshes import TriangleMesh
from pointmass.motions import RigidMotion
from pointmass.particles import Particles
from pointmass.registries import LISTS
from pointmass.simulation import DEFAULT_DT, Simulation
from pointmass.solver_choice import AUTO
from pointmass.solvers import SOLVERS, find_solver
from pointmass.solvers.base import Solver
from pointmass.system import ParticleSystem
from pointmass.toml import dumps
from pointmass.zones import WHEN_FULL, WhenFull, Zone

VERSION = 1
FILES = ("mesh", "heights", "distances", "file")  # parameters that may be paths, beside `grid`
PATHS = tuple(f".{name}" for name in ("grid", *FILES))
HOLDS: dict[str, type] = {
    **{"bodies": Body, "forces": Force, "colliders": Collider, "emitters": Emitter, "zones": Zone},
    "motions": RigidMotion,
    "constraints": Constraint,
    "controllers": Controller,
}
PLAIN = ("name", "summary", "dt", "frames", "fps", "seed", "dtype", "max_particles", "when_full")


@dataclass(kw_only=True)
class Scene:
    """Everything that a run depends on.

    Attributes
    ----------
    bodies : what there is at the start; names make groups that forces can act on.
    names : of the bodies; by default their kind, numbered where it occurs twice.
    forces : on all particles, after the bodies' own.
    colliders, emitters, zones : surfaces, where particles come from, and where they die.
    motions : of pinned particles.
    constraints : what must hold at the end of each step.
    controllers : what sets parameters of the forces between steps.
    solver : None = SymplecticEuler, or RK4 for a flow; "auto" = chosen at the start, see `Simulation`.
    dt : the solver's step [s].
    frames, fps : length of the run, and looks per second, where nothing else is asked for.
    seed : of all chance while it runs.
    dtype : "float64" or "float32".
    max_particles, when_full : how many particles there may be, None = any number, and what happens beyond them: see
        `Simulation`.
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
    max_particles: int | None = None
    when_full: WhenFull = "no birth"
    solver: Solver | Literal["auto"] | None = None
    bodies: Sequence[Body] = ()
    names: Sequence[str] = ()
    forces: Sequence[Force] = ()
    colliders: Sequence[Collider] = ()
    emitters: Sequence[Emitter] = ()
    zones: Sequence[Zone] = ()
    motions: Sequence[RigidMotion] = ()
    constraints: Sequence[Constraint] = ()
    controllers: Sequence[Controller] = ()
    camera: Camera = field(default_factory=Camera)
    look: Look = field(default_factory=Look)

    def __post_init__(self) -> None:
        self.dt = number("dt", self.dt, above=0, unit="s")
        self.fps = number("fps", self.fps, above=0, unit="1/s")
        self.frames = whole_number("frames", self.frames, at_least=1)
        self.seed = whole_number("seed", self.seed, at_least=0)
        if self.dtype not in ("float64", "float32"):
            raise InvalidInput(f"dtype = {self.dtype!r} is not allowed: it must be float64 or float32")
        if self.max_particles is not None:
            self.max_particles = whole_number("max_particles", self.max_particles, at_least=1)
        if self.when_full not in WHEN_FULL:
            raise unknown("value of when_full:", self.when_full, WHEN_FULL)
        for what, kind in HOLDS.items():
            setattr(self, what, _items(what, kind, getattr(self, what)))
        if self.solver not in (None, AUTO) and not isinstance(self.solver, Solver):
            raise InvalidInput(f"solver must be a solver, such as pm.RK4(), not {self.solver!r}")
        for what, settings in (("camera", Camera), ("look", Look)):
            if not isinstance(getattr(self, what), settings):
                raise InvalidInput(f"{what} must be a {settings.__name__}, not {getattr(self, what)!r}")
        if not self.emitters and not any(len(b.particles) for b in self.bodies):
            raise InvalidInput("a scene needs at least one body or emitter: there are no particles")
        self.names = list(self.names) or _numbered([b.kind or "particles" for b in self.bodies])
        if len(self.names) != len(self.bodies):
            raise InvalidInput(f"names has {len(self.names)} entries for {len(self.bodies)} bodies")

    def simulation(self) -> Simulation:
        """A fresh simulation; every call gives the same.

        Raises
        ------
        InvalidInput
            Parts that do not fit together, such as a force on a group that no body has.
        """
        copies = [Body(b.particles, [_again(f) for f in b.forces]) for b in self.bodies]
        particles, own = join(copies, self.names, np.dtype(self.dtype))
        emitters = [_again(e) for e in self.emitters]
        particles.declare(*(name for e in emitters for name in e.attributes_made))
        forces = [_again(f) for f in self.forces]
        for k, force in enumerate(forces):
            force.label = f"forces.{k} ({force.name})"
        system = ParticleSystem(particles, own + forces, [_again(c) for c in self.colliders])
        solver = _again(self.solver) if isinstance(self.solver, Solver) else self.solver
        return Simulation(
            system,
            solver,
            self.dt,
            emitters=emitters,
            zones=[_again(z) for z in self.zones],
            motions=[_again(m) for m in self.motions],
            constraints=[_again(c) for c in self.constraints],
            controllers=[_again(c) for c in self.controllers],
            max_particles=self.max_particles,
            when_full=self.when_full,
            look=self.look,
            seed=self.seed,
        )

    # ------------------------------------------------------------------------------------------------ as text

    def document(self, folder: Path | None = None) -> dict[str, Any]:
        """The scene as plain tables, lists and numbers.

        Parameters
        ----------
        folder : where the text will be: files below it are named by the way from there.

        Raises
        ------
        InvalidInput
            It holds something that was written in Python and has no text.
        """
        result: dict[str, Any] = {"version": VERSION}
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name in PLAIN and (value != f.default or f.name == "name"):
                result[f.name] = value
        if self.solver == AUTO:
            result["solver"] = AUTO
        elif self.solver is not None:
            result["solver"] = _table(SOLVERS, self.solver, "solver", folder)
        for what, registry in LISTS.items():
            tables = [_table(registry, item, what, folder) for item in getattr(self, what)]
            if tables:
                result[what] = tables
        for table, name in zip(result.get("bodies", ()), self.names, strict=True):
            table["name"] = name
        for what, values in (("camera", _changed_from_default(self.camera)), ("look", self.look.described())):
            if values:
                result[what] = {name: _plain(value, f"{what}.{name}", folder) for name, value in values.items()}
        return result

    def to_toml(self, folder: Path | None = None) -> str:
        """The scene as TOML; `from_toml` gives an equal one back. See `document`."""
        return dumps(self.document(folder))

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML, beside and renamed."""
        path = Path(path)
        text = self.to_toml(path.parent.resolve())
        with beside(path) as part:
            part.write_text(text, encoding="utf-8")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.document() == other.document()

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def from_toml(
        cls,
        text: str,
        settings: Mapping[str, Any] | None = None,
        folder: Path | None = None,
        *,
        allow_outside: bool = False,
    ) -> Scene:
        """A scene from TOML.

        Parameters
        ----------
        settings : values to change before it is read, by path, such as {"forces.0.k": 0.2}.
        folder : where the paths of files in it start, and in which those files are.
        allow_outside : whether they may be elsewhere, too. Those that `settings` name always may, and so may all where
            there is no `folder`.

        Raises
        ------
        InvalidInput
            Not TOML, an unknown key or kind, a value that is not allowed, a file outside of the folder.
        """
        import tomllib

        try:
            document = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise InvalidInput(f"the scene is not TOML: {error}") from None
        for path, value in (settings or {}).items():
            _set(document, path, value)
        return cls._from_document(document, _Files(folder, allow_outside, tuple(settings or ())))

    @classmethod
    def from_document(
        cls, document: Mapping[str, Any], folder: Path | None = None, *, allow_outside: bool = False
    ) -> Scene:
        """A scene from plain tables, as `document` makes them; see `from_toml`."""
        return cls._from_document(document, _Files(folder, allow_outside))

    @classmethod
    def _from_document(cls, document: Mapping[str, Any], files: _Files) -> Scene:
        from pointmass.schema import checked  # pydantic, which a scene written in Python does without

        checked(document)
        tables = {what: [dict(table) for table in document.get(what, ())] for what in LISTS}
        named = [table.pop("name", None) for table in tables["bodies"]]
        numbered = _numbered([table["type"] for table in tables["bodies"]])
        made: dict[str, Any] = {
            what: [_made(registry, table, f"{what}.{k}", files) for k, table in enumerate(tables[what])]
            for what, registry in LISTS.items()
        }
        return cls(
            names=[name or default for name, default in zip(named, numbered, strict=True)],
            solver=_made_solver(document.get("solver")),
            camera=_settings(Camera, document.get("camera", {})),
            look=_settings(Look, document.get("look", {})),
            **made,
            **{name: document[name] for name in PLAIN if name in document},
        )

    @classmethod
    def load(cls, path: str | Path, settings: Mapping[str, Any] | None = None, *, allow_outside: bool = False) -> Scene:
        """A scene from a TOML file.

        Parameters
        ----------
        settings, allow_outside : see `from_toml`; the folder is that of the file.

        Raises
        ------
        InvalidInput
            It cannot be read, or as for `from_toml`.
        """
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8-sig")  # some editors on Windows begin a file with a mark
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
            raise InvalidInput(f"cannot read the scene {str(path)!r}: {reason}") from None
        return cls.from_toml(text, settings, path.parent, allow_outside=allow_outside)

    def changed(self, **values: Any) -> Scene:
        """A copy with other values, such as `scene.changed(dt=1e-3)`."""
        return replace(self, **values)


def body_of(particles: Particles, forces: Sequence[Force] = ()) -> Body:
    """A body for scenes from particles and forces that were made by hand."""
    p = particles
    arguments = {"x": p.x, "v": p.v, "m": p.m, "radius": p.radius, "pinned": np.flatnonzero(p.pinned).tolist()}
    if np.isfinite(p.lifetime).any():
        arguments["lifetime"] = p.lifetime
    if p.attributes:
        arguments["attributes"] = dict(p.attributes)
    return Body(p, list(forces), "points", arguments)


# ------------------------------------------------------------------------------------------------------------ objects


def _items(what: str, kind: type, value: Any) -> list[Any]:
    try:
        items = list(value)
    except TypeError:
        raise InvalidInput(f"{what} of a scene must be a list, not {value!r}") from None
    for item in items:
        if not isinstance(item, kind):
            raise InvalidInput(f"{what} of a scene cannot hold {item!r}")
    return items


def _again(item: Any) -> Any:
    """An equal object without a history."""
    if isinstance(item, LookedUp):  # it has none, and what it looks up in takes long to build
        return copy(item)
    fresh = type(item)(**item.arguments)
    if isinstance(item, Force):
        fresh.enabled = item.enabled
    return fresh


def _numbered(kinds: Sequence[str]) -> list[str]:
    seen: dict[str, int] = {}
    result = []
    for kind in kinds:
        seen[kind] = seen.get(kind, 0) + 1
        result.append(kind if kinds.count(kind) == 1 else f"{kind}{seen[kind]}")
    return result


def _changed_from_default(camera: Camera) -> dict[str, Any]:
    values = {f.name: getattr(camera, f.name) for f in fields(camera)}
    return {f.name: values[f.name] for f in fields(camera) if values[f.name] != f.default}


# ------------------------------------------------------------------------------------------------------- into tables


def _table(registry: Mapping[str, Any], item: Any, what: str, folder: Path | None) -> dict[str, Any]:
    """How an object was made."""
    kind = item.kind if isinstance(item, Body) else next((k for k, c in registry.items() if type(item) is c), None)
    if kind not in registry:
        raise InvalidInput(
            f"{_name(item)} was written in Python and has no text: in a scene file, write a law as a field"
        )
    if isinstance(item, Body):
        _check_as_built(item)
    arguments = dict(item.arguments)
    if isinstance(item, Force) and not item.enabled:
        arguments["enabled"] = False
    return {"type": kind} | {n: _plain(v, f"{what} {kind}.{n}", folder) for n, v in arguments.items() if v is not None}


def _check_as_built(body: Body) -> None:
    """A body that was changed after it was built is not what its arguments say."""
    if body.kind == "points" and body.forces:
        raise InvalidInput("a body of points with forces of its own has no text: give the forces to the scene")
    built = BODIES[body.kind](**body.arguments)
    p, q = built.particles, body.particles
    same = p.attributes.keys() == q.attributes.keys() and p.groups.keys() == q.groups.keys()
    pairs = [(p.x, q.x), (p.v, q.v), (p.m, q.m), (p.radius, q.radius), (p.lifetime, q.lifetime), (p.pinned, q.pinned)]
    pairs += [(p.attributes[a], q.attributes[a]) for a in p.attributes if same]
    pairs += [(p.groups[g], q.groups[g]) for g in p.groups if same]
    forces = [(type(f), f.enabled) for f in built.forces] == [(type(f), f.enabled) for f in body.forces]
    if not (same and forces and all(np.array_equal(a, b) for a, b in pairs)):
        raise InvalidInput(
            f"the body {body.kind!r} was changed after it was built and has no text: give its forces to the scene, "
            "and its particles as pm.body_of(particles)"
        )


def _name(item: Any) -> str:
    return (item.kind if isinstance(item, Body) else type(item).__name__) or "a body made by hand"


def _plain(value: Any, where: str, folder: Path | None) -> Any:
    """Numbers, strings, lists and tables only."""
    if isinstance(value, TriangleMesh):
        places = [] if value.uv is None else [value.uv.reshape(-1, 6).tolist()]  # u and v of each corner of a face
        return [value.vertices.tolist(), value.faces.tolist(), *places]
    if isinstance(value, Grid):
        return _plain_grid(value, where, folder)
    if isinstance(value, (Spread, Normal)):
        return asdict(value)
    if isinstance(value, Described):
        return _table(COLLIDERS if isinstance(value, Collider) else FORCES, value, where, folder)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(k): _plain(v, where, folder) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple, range)):
        return [_plain(v, where, folder) for v in value]
    if isinstance(value, Path) or (isinstance(value, str) and where.endswith(PATHS)):
        return _way(value, folder)
    if isinstance(value, (str, bool, int, float)):
        return value
    raise InvalidInput(
        f"{where} = {value!r} was written in Python and has no text: use numbers, formulas or lists of them"
    )


def _plain_grid(grid: Grid, where: str, folder: Path | None) -> Any:
    if grid.path is None:
        raise InvalidInput(f"{where} holds a grid without a file and has no text: save it and use pm.load_grid")
    path = _way(grid.path, folder)
    if grid.outside == "zero" and grid.variables is None:
        return path
    variables = {} if grid.variables is None else {"variables": list(grid.variables)}
    return {"path": path, **variables, "outside": grid.outside}


def _way(path: str | Path, folder: Path | None) -> str:
    """The path of a file as seen from a folder, if it is below it."""
    if folder is None:
        return str(path)
    whole = Path(path).resolve()
    return str(whole.relative_to(folder) if whole.is_relative_to(folder) else whole)


# ------------------------------------------------------------------------------------------------------- from tables


@dataclass(frozen=True)
class _Files:
    """Where the files are that a text names.

    Attributes
    ----------
    folder : where their paths start, None = where the program runs.
    allow_outside : whether they may be outside of the folder.
    chosen : parameters, such as "colliders.0.mesh", whose values are not of the text: these files may be anywhere.
    """

    folder: Path | None = None
    allow_outside: bool = False
    chosen: Sequence[str] = ()

    def found(self, where: str, path: str) -> str:
        """A path such that it is found again from wherever this scene, or a cache that keeps its text, is read.

        Parameters
        ----------
        where : the parameter that has it, such as "colliders.0.mesh".

        Raises
        ------
        InvalidInput
            It cannot be a path, or leads out of the folder.
        """
        name = where.rpartition(".")[2]
        if "\0" in path:
            raise InvalidInput(f"{name} = {path!r} is not allowed: no file has a name with a zero character")
        if self.folder is None:
            return path
        folder, place = (Path(realpath(way)) for way in (self.folder, self.folder / path))  # through all links
        chosen = any(f"{where}.".startswith(f"{way}.") for way in self.chosen)  # this value, or a table around it
        if not (self.allow_outside or chosen or place.is_relative_to(folder)):
            raise InvalidInput(
                f"{name} = {path!r} is not allowed: it must lie in the scene file's folder or below; copy it there, or "
                "allow it by --allow-outside (in Python, allow_outside=True)"
            )
        return str(place)


def _made(registry: Mapping[str, Any], table: Mapping[str, Any], where: str, files: _Files) -> Any:
    """The object that a table describes."""
    values = dict(table)
    kind = values.pop("type")
    try:
        for name in VELOCITIES:
            if isinstance(values.get(name), Mapping):
                values[name] = _made(FORCES, values[name], f"{where}.{name}", files)
            if isinstance(values.get(name), list):
                values[name] = [
                    _made(FORCES, part, f"{where}.{name}.{k}", files) if isinstance(part, Mapping) else part
                    for k, part in enumerate(values[name])
                ]
        if "around" in values:
            solids = enumerate(values["around"])
            values["around"] = [_made(COLLIDERS, solid, f"{where}.around.{k}", files) for k, solid in solids]
        if "grid" in values:
            values["grid"] = _grid(values["grid"], f"{where}.grid", files)
        for name in FILES:
            if isinstance(values.get(name), str):
                values[name] = files.found(f"{where}.{name}", values[name])
        return registry[kind](**values)
    except InvalidInput as error:
        raise InvalidInput(f"{where} ({kind}): {error}") from None
    except (MemoryError, OverflowError, ValueError) as error:  # NumPy's, about sizes that no machine holds
        raise InvalidInput(
            f"{where} ({kind}) does not fit into memory, of which a command takes 75% without --allow-large: {error}"
        ) from None


def _grid(value: Any, where: str, files: _Files) -> Any:
    settings = dict(value) if isinstance(value, Mapping) else {}
    path = files.found(f"{where}.path", settings.pop("path")) if settings else files.found(where, str(value))
    return load_grid(path, **settings) if settings else path


def _made_solver(value: Any) -> Solver | Literal["auto"] | None:
    if value is None or value == AUTO:
        return None if value is None else "auto"
    values = {"type": value} if isinstance(value, str) else dict(value)
    return find_solver(values.pop("type"))(**values)


def _settings(kind: Any, table: Mapping[str, Any]) -> Any:
    return kind(**{name: _tuples(value) for name, value in table.items()})


def _tuples(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def _set(document: dict[str, Any], path: str, value: Any) -> None:
    """Set a value by its path, such as forces.0.k."""
    *way, last = path.split(".")
    here: Any = document
    for part in way:
        if isinstance(here, dict) and part not in here:
            here[part] = {}
        here = _inside(here, part, path)
    if isinstance(here, list):
        _inside(here, last, path)
        here[int(last)] = value
    elif isinstance(here, dict):
        here[last] = value
    else:
        raise _no_path(path)


def _inside(here: Any, part: str, path: str) -> Any:
    try:
        return here[int(part)] if isinstance(here, list) else here[part]
    except (ValueError, IndexError, KeyError, TypeError):
        raise _no_path(path) from None


def _no_path(path: str) -> InvalidInput:
    return InvalidInput(f"the scene has no {path!r}: use a path such as forces.0.k or look.color")
