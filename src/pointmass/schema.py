"""The form of scene files, made from the constructors of everything that can stand in one.

A new force, solver, collider, emitter or body is in the schema as soon as it is in its registry. `python -m
pointmass.schema` prints it, for editors that complete and check TOML.
"""

from __future__ import annotations

import ast
import inspect
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from inspect import Parameter
from typing import Annotated, Any, ClassVar, Literal, Union

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from pointmass.collisions import COLLIDERS
from pointmass.description import parameters_of
from pointmass.errors import InvalidInput, shown, unknown
from pointmass.forces import FORCES
from pointmass.forces.air import VELOCITIES
from pointmass.frame import Camera
from pointmass.laws.unary import VelocityField
from pointmass.look import OF_PARTICLES, Look
from pointmass.registries import LISTS
from pointmass.simulation import DEFAULT_DT
from pointmass.solver_choice import AUTO
from pointmass.solvers import ALIASES, SOLVERS, find_solver
from pointmass.zones import WHEN_FULL

VERSION = 1
DTYPES = ("float64", "float32")
LARGEST = 2**63 - 1
MAY_LAST = re.compile(r"emitters\.|bodies\.\d+\.lifetime")  # values that may be infinite


class Table(BaseModel):
    """A table of a scene file; `allowed` says in words what each value may be."""

    model_config = ConfigDict(extra="forbid", strict=True)
    allowed: ClassVar[dict[str, str]] = {}


class GridTable(Table):
    """A grid file, read in another way than by default."""

    path: str
    variables: list[str] | None = None
    outside: Literal["zero", "clamp", "wrap"] = "zero"
    allowed: ClassVar[dict[str, str]] = {
        "path": "text",
        "variables": "a list of names",
        "outside": "'zero', 'clamp' or 'wrap'",
    }


class SpreadTable(Table):
    """mean +- half_range, each value in between equally likely."""

    mean: float
    half_range: float


class NormalTable(Table):
    """A normal distribution."""

    mean: float
    sd: float


def _exactly(count: int, kind: Any) -> Any:
    return Annotated[list[kind], Field(min_length=count, max_length=count)]


Row = list[float | str]
CHANCE = float | SpreadTable | NormalTable
SPREAD = "{ mean = 5, half_range = 0.5 } or { mean = 5, sd = 0.5 }"
BOX = "tuple[tuple[float, float, float], tuple[float, float, float]]"
SCALAR = (float | str | list[float], "a number, a formula in quotes, or a list of numbers")
VECTOR = (Row | list[list[float]], "three numbers or formulas, such as [0, -9.81, 0]")
FORMS: dict[str, tuple[Any, str]] = {  # by the annotation of a constructor's parameter, without "| None"
    "Any": (float | str | list[float | str | Row], "a number, or a list of numbers or formulas"),
    "ArrayLike": (list[list[int]], "a list of lists of particle ids, such as [[0, 1], [1, 2]]"),
    "Axis": (Row | str, "three numbers, such as [0, 1, 0], or 'normal'"),
    "Chance": (CHANCE, f"a number, or {SPREAD}"),
    "Families": (str | list[str], "the name of a family of springs, such as 'stretch', or a list of names"),
    "Grid | str": (str | GridTable, "the path of a file, or a table with its path"),
    "CurveSource": (list[list[list[float]]], "a list of strands, each a list of points"),
    "DistanceSource": (str | list[list[list[float]]], "the path of a file, or rows of rows of distances"),
    "HeightSource": (str | list[list[float]], "the path of a file, or a list of rows of heights"),
    "Rate": (float | str, "a number, or a formula of t in quotes"),
    "Scalar": SCALAR,
    "Selection": (str | list[int] | list[bool], "the name of a body or group, or a list of rows"),
    "Sequence[tuple[float, int]]": (
        list[_exactly(2, float)],  # type: ignore[misc]
        "a list of times and counts, such as [[0, 100], [0.5, 200]]",
    ),
    "Surfaces": (str | list[str], "the name of a surface or body, such as 'cloth', or a list of names"),
    "str | Path": (str, "the path of a file"),
    "str | Sequence[str]": (str | list[str], "a name, or a list of names"),
    "TriangleSource": (
        str | _exactly(2, list[list[float]]) | _exactly(3, list[list[float]]),
        "the path of a file, or a list of vertices, a list of faces, and if wanted one of places of their corners",
    ),
    "Triangles": (
        str | list[list[int]],
        "the name of a surface, or a list of lists of particle ids, such as [[0, 1, 2]]",
    ),
    "Vector": VECTOR,
    "Color": (str | float, "a colour, such as orange or #ffb454, or a temperature [K]"),
    "Curve": (
        str | list[_exactly(2, float)],  # type: ignore[misc]
        "a list of [fraction of the life, value], or the name of a curve",
    ),
    "Gradient": (
        str | list[_exactly(2, float | str)],  # type: ignore[misc]
        "a list of [fraction of the life, colour], or the name of a gradient",
    ),
    "tuple[tuple[float, ...], ...]": (
        list[_exactly(7, float)],  # type: ignore[misc]
        "a list of times, positions and targets, such as [[0, 0, 1, 5, 0, 0, 0], [4, 5, 1, 0, 0, 0, 0]]",
    ),
    BOX: (_exactly(2, _exactly(3, float)), "two corners, such as [[0, 0, 0], [1, 1, 1]]"),
    "bool": (bool, "true or false"),
    "dict[str, Any]": (dict[str, float | list[float]], "a table of numbers, or of lists of numbers"),
    "dict[str, Chance]": (dict[str, CHANCE], f"a table of numbers, or of {SPREAD}"),
    "dict[str, Scalar]": (dict[str, float | str | list[float]], "a table of numbers or formulas"),
    "float": (float, "a number"),
    "int": (int, "a whole number"),
    "str": (str, "text in quotes"),
}
UNKNOWN = (Any, "another value")
AIR = "Velocity"
SOLIDS = "Sequence[Solid]"
SHORT = {
    "Contact": "Literal['swept', 'discrete']",
    "Event": "Literal['death', 'birth', 'impact', 'trail']",
    "Where": "Literal['surface', 'volume']",
    "Response": "Literal['bounce', 'stick', 'slide', 'kill']",
}


@cache
def model() -> type[Table]:
    """The pydantic model of a scene file."""
    lists: dict[str, Any] = {
        what: (list[_one_of(what, tuple(registry))], Field(default=[], description=_LIST_DOCS[what]))  # type: ignore[misc]
        for what, registry in LISTS.items()
    }
    names: Any = Literal[(*SOLVERS, *ALIASES, AUTO)]
    solver: Any = Union[names, _one_of("solver", tuple(SOLVERS))]  # noqa: UP007
    dtype: Any = Literal[DTYPES]
    full: Any = Literal[WHEN_FULL]
    result = create_model(
        "Scene",
        __base__=Table,
        version=(Literal[1], Field(default=VERSION, description="of the form of scene files")),
        name=(str, Field(default="scene", description="short, for people and file names")),
        summary=(str, Field(default="", description="one line about what one sees")),
        dt=(float, Field(default=DEFAULT_DT, gt=0, description="the solver's step [s]")),
        frames=(int, Field(default=240, ge=1, description="length of the run")),
        fps=(float, Field(default=60.0, gt=0, description="frames for a second of simulated time")),
        seed=(int, Field(default=0, ge=0, description="of all chance while it runs")),
        dtype=(dtype, Field(default=DTYPES[0], description="precision of the numbers")),
        max_particles=(int, Field(default=None, ge=1, description="how many there may be; any number by default")),
        when_full=(full, Field(default=WHEN_FULL[0], description="what happens beyond max_particles")),
        solver=(solver, Field(default=None, description="symplectic_euler by default, rk4 for a flow; auto = chosen")),
        camera=(settings_model("camera"), Field(default={}, description="what a picture shows")),
        look=(settings_model("look"), Field(default={}, description="how it looks")),
        **lists,
    )
    result.allowed = {
        "name": "text in quotes",
        "summary": "text in quotes",
        "dt": "a number greater than 0 [s]",
        "frames": "a whole number, at least 1",
        "fps": "a number greater than 0 [1/s]",
        "seed": "a whole number, at least 0",
        "dtype": "'float64' or 'float32'",
        "max_particles": "a whole number, at least 1",
        "when_full": "'no birth' or 'oldest dies'",
    }
    return result


def json_schema() -> dict[str, Any]:
    """The form of scene files as a JSON schema."""
    schema = model().model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "pointmass scene",
        "description": "A scene file of pointmass. Units are SI.",
    }


def checked(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The document, if it has the form of a scene.

    Raises
    ------
    InvalidInput
        One sentence about the first thing that is wrong.
    """
    if document.get("version", VERSION) != VERSION:
        raise InvalidInput(f"the scene has version {document['version']!r}: this pointmass reads version {VERSION}")
    plain = {k: v for k, v in document.items() if k not in (*LISTS, "solver", "camera", "look")}
    _check_table("the scene", model(), plain, "")
    for what, registry in LISTS.items():
        for k, table in enumerate(_list(what, document.get(what, []))):
            _check_entry(f"{what}.{k}", what, table, registry)
    _check_solver(document.get("solver"))
    _check_table("camera", settings_model("camera"), document.get("camera", {}), "camera.")
    _check_look(document.get("look", {}))
    _check_numbers(document)
    return document


@cache
def settings_model(what: str) -> type[Table]:
    """The model of the camera or the look."""
    kind = {"camera": Camera, "look": Look}[what]
    docs = documented(kind)
    entries = {f.name: (str(f.type), docs.get(f.name, ""), f.default) for f in fields(kind) if f.name != "groups"}
    result = _created(what, entries, {})
    if what == "look":
        groups: Any = (dict[str, group_model()], Field(default=None, description=docs["groups"]))  # type: ignore[misc]
        allowed = result.allowed | {"groups": "a table of tables, such as [look.groups.smoke]"}
        result = create_model(what, __base__=result, groups=groups)
        result.allowed = allowed
    return result


@cache
def group_model() -> type[Table]:
    """The model of the look of a group."""
    docs = documented(Look)
    entries = {f.name: (str(f.type), docs[f.name], f.default) for f in fields(Look) if f.name in OF_PARTICLES}
    return _created("look_of_group", entries, {})


@cache
def entry_model(what: str, kind: str) -> type[Table]:
    """The model of one kind of body, force, collider, emitter or solver."""
    factory = {**LISTS, "solver": SOLVERS}[what][kind]
    docs = documented(factory)
    entries = {n: (str(p.annotation), docs.get(n, ""), p.default) for n, p in parameters_of(factory).items()}
    own: dict[str, Any] = {"type": (Literal[kind], ...)}
    if what == "bodies":
        own["name"] = (str, Field(default="", description="forces and reports call it by this name"))
    result = _created(f"{what}_{kind}", entries, own)
    result.__doc__ = (inspect.getdoc(factory) or kind).splitlines()[0]
    return result


def form_of(annotation: str) -> tuple[Any, str]:
    """What may stand in a file for a parameter with this annotation: a type for pydantic, and words."""
    annotation = SHORT.get(annotation, annotation).removesuffix(" | None")
    if annotation.startswith("Literal["):
        choices = ast.literal_eval(annotation.removeprefix("Literal"))
        return Literal[tuple(choices)], _listed(choices)
    if annotation.startswith("tuple[float"):
        count = annotation.count("float")
        return _exactly(count, float), f"a list of {count} numbers"
    if annotation == AIR:
        kind, words = VECTOR
        several = list[Union[_flows(), kind]]  # type: ignore[misc, valid-type] # noqa: UP007
        return Union[kind, _flows(), several], f"{words}, a table with the type of a flow, or a list of both"  # noqa: UP007
    if annotation == SOLIDS:
        return list[_one_of("colliders", tuple(COLLIDERS))], "a list of tables, each with the type of a collider"  # type: ignore[misc]
    return FORMS.get(annotation, UNKNOWN)


def documented(factory: Any) -> dict[str, str]:
    """What the docstring of a class or function says about each of its parameters, one sentence each.

    A dataclass has the parameters of its bases too.
    """
    result: dict[str, str] = {}
    names: list[str] = []
    bases = factory.__mro__ if is_dataclass(factory) and isinstance(factory, type) else ()
    told = [base for base in reversed(bases) if is_dataclass(base)] or [factory]
    for line in "\n\n".join(inspect.getdoc(each) or "" for each in told).splitlines():
        entry = re.fullmatch(r"(\w+(?:, \w+)*) : (.+)", line)
        if entry:
            names = entry[1].split(", ")
            result |= dict.fromkeys(names, entry[2])
        elif line.startswith("    ") and names:
            result |= {name: f"{result[name]} {line.strip()}" for name in names}
        else:
            names = []
    return result


# ---------------------------------------------------------------------------------------------------- making models

_LIST_DOCS = {
    "bodies": "what there is at the start",
    "forces": "that act on the particles, after the bodies' own",
    "colliders": "surfaces that particles bounce off",
    "emitters": "where particles come from",
    "zones": "where particles die",
    "motions": "of pinned particles",
    "constraints": "what must hold at the end of each step",
    "controllers": "what sets parameters of the forces between steps",
}


def _created(name: str, entries: Mapping[str, tuple[str, str, Any]], own: dict[str, Any]) -> type[Table]:
    made = dict(own)
    allowed = {"name": "text in quotes"} if "name" in own else {}
    for key, (annotation, doc, default) in entries.items():
        form, allowed[key] = form_of(annotation)
        required = default is Parameter.empty
        made[key] = (form, Field(default=... if required else _plain_default(default), description=doc or None))
    result = create_model(name, __base__=Table, **made)
    result.allowed = allowed
    return result


def _plain_default(value: Any) -> Any:
    """A default as JSON can hold it; None stands for everything else, and for "not given"."""
    if isinstance(value, (tuple, list)):
        return list(value)
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _one_of(what: str, kinds: Sequence[str]) -> Any:
    models = tuple(entry_model(what, kind) for kind in kinds)
    return Annotated[Union[models], Field(discriminator="type")] if len(models) > 1 else models[0]  # noqa: UP007


def _flows() -> Any:
    return _one_of("forces", tuple(_flow_kinds()))


def _flow_kinds() -> dict[str, Any]:
    return {name: kind for name, kind in FORCES.items() if issubclass(kind, VelocityField)}


# ------------------------------------------------------------------------------------------------ checking, in words


def _list(what: str, value: Any) -> Sequence[Any]:
    if not isinstance(value, list):
        raise InvalidInput(f"{what} must be a list of tables: begin each with [[{what}]], not with [{what}]")
    return value


def _check_entry(where: str, what: str, table: Any, registry: Mapping[str, Any]) -> None:
    """A table whose `type` says what it is."""
    if not isinstance(table, Mapping):
        raise InvalidInput(f"{where} must be a table with a type, not {shown(table)}")
    kind = table.get("type")
    if kind is None:
        raise InvalidInput(f"{where} needs a type: one of {', '.join(registry)}")
    if not isinstance(kind, str) or kind not in registry:
        raise unknown(f"type in {where}:", kind, registry)
    for name in VELOCITIES if what in ("forces", "bodies") else ():
        nested = table.get(name)
        if isinstance(nested, Mapping):
            _check_entry(f"{where}.{name}", "forces", nested, _flow_kinds())
        for k, part in enumerate(nested if isinstance(nested, list) else ()):
            if isinstance(part, Mapping):
                _check_entry(f"{where}.{name}.{k}", "forces", part, _flow_kinds())
    if isinstance(around := table.get("around"), list):
        for k, solid in enumerate(around):
            _check_entry(f"{where}.around.{k}", "colliders", solid, COLLIDERS)
    grid = table.get("grid")
    if isinstance(grid, Mapping):
        _check_table(f"{where}.grid", GridTable, grid, f"{where}.grid.")
    _check_table(f"{where} ({kind})", entry_model(what, kind), table, f"{where}.")


def _check_solver(value: Any) -> None:
    if value is None or value == AUTO:
        return
    kind = value.get("type") if isinstance(value, Mapping) else value
    if not isinstance(kind, str):
        raise InvalidInput(f"solver must be a name such as 'rk4', or a table with a type, not {shown(value)}")
    if isinstance(value, Mapping):
        name = find_solver(kind).name
        _check_table(f"solver ({name})", entry_model("solver", name), {**value, "type": name}, "solver.")
    else:
        find_solver(kind)


def _check_look(table: Any) -> None:
    groups = table.get("groups") if isinstance(table, Mapping) else None
    for name, group in groups.items() if isinstance(groups, Mapping) else ():
        _check_table(f"look.groups.{name}", group_model(), group, f"look.groups.{name}.")
    _check_table("look", settings_model("look"), table, "look.")


def _check_table(where: str, form: type[Table], table: Any, prefix: str) -> None:
    """A table whose keys are known and whose values are of the right kinds."""
    if not isinstance(table, Mapping):
        raise InvalidInput(f"{where} must be a table, not {shown(table)}")
    for key in table:
        if key not in form.model_fields:
            raise unknown(f"key in {where}:", key, form.model_fields)
    try:
        form.model_validate(table)
    except ValidationError as error:
        first = error.errors()[0]
    else:
        return
    name = str(first["loc"][0])
    if first["type"] == "missing" and len(first["loc"]) == 1:
        raise InvalidInput(f"{where} needs {name!r}: {form.allowed[name]}")
    raise InvalidInput(f"{prefix}{name} = {shown(table[name])} is not allowed: it must be {form.allowed[name]}")


def _check_numbers(value: Any, path: str = "") -> None:
    """Refuse NaN everywhere, infinity where nothing lasts for ever, and whole numbers that no array holds."""
    if isinstance(value, float) and (math.isnan(value) or (math.isinf(value) and not MAY_LAST.match(path))):
        raise InvalidInput(f"{path} = {value} is not allowed: it must be a finite number")
    if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
        raise InvalidInput(f"{path} = {shown(value)} is not allowed: a whole number has at most 64 bits, as in TOML")
    items = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        _check_numbers(item, f"{path}.{key}" if path else str(key))


def _listed(choices: Sequence[Any]) -> str:
    *most, last = [repr(c) for c in choices]
    return f"{', '.join(most)} or {last}" if most else last


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1))
