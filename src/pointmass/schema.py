"""The form of scene files, made from the constructors of everything that can stand in one.

A new force, solver, collider, emitter or body is in the schema as soon as it is in its registry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from inspect import Parameter
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from pointmass.bodies.body import BODIES
from pointmass.collisions import COLLIDERS
from pointmass.description import parameters_of
from pointmass.emitters import EMITTERS
from pointmass.errors import InvalidInput, unknown
from pointmass.forces import FORCES
from pointmass.frame import Camera
from pointmass.look import Look
from pointmass.solvers import ALIASES, SOLVERS

Number = float | int
REGISTRIES: dict[str, Mapping[str, Any]] = {
    "bodies": BODIES,
    "forces": FORCES,
    "colliders": COLLIDERS,
    "emitters": EMITTERS,
}
FORMS: dict[str, Any] = {  # by the annotation of a constructor's parameter, as written there
    "float": Number,
    "int": int,
    "bool": bool,
    "str": str,
    "str | None": str,
    "Scalar": Number | str | list[Number],
    "Scalar | None": Number | str | list[Number],
    "Vector": list[Number | str] | list[list[Number]],
    "Contact": Literal["swept", "discrete"],
    "Selection": str | list[int] | list[bool],
    "dict[str, float] | None": dict[str, Number],
}


@cache
def model() -> type[BaseModel]:
    """The pydantic model of a scene file."""
    lists: dict[str, Any] = {
        what: (list[_one_of(what, registry)], Field(default=[])) for what, registry in REGISTRIES.items()
    }
    solver = Union[Literal[tuple([*SOLVERS, *ALIASES])], _one_of("solver", SOLVERS)]  # type: ignore[valid-type]  # noqa: UP007
    return create_model(
        "Scene",
        __config__=ConfigDict(extra="forbid", title="pointmass scene"),
        version=(Literal[1], 1),
        name=(str, "scene"),
        summary=(str, ""),
        dt=(Number, 1 / 240),
        frames=(int, 240),
        fps=(Number, 60),
        seed=(int, 0),
        dtype=(Literal["float64", "float32"], "float64"),
        solver=(solver, "symplectic_euler"),
        camera=(_table("camera", Camera), {}),
        look=(_table("look", Look), {}),
        **lists,
    )


def json_schema() -> dict[str, Any]:
    """The form of scene files as a JSON schema."""
    return model().model_json_schema()


def checked(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The document, if it has the form of a scene.

    Raises
    ------
    InvalidInput
        One sentence about the first thing that is wrong.
    """
    _check_kinds(document)
    try:
        model().model_validate(document, strict=False)
    except ValidationError as error:
        raise InvalidInput(_sentence(error)) from None
    return document


def _one_of(what: str, registry: Mapping[str, Any]) -> Any:
    kinds = tuple(_model(what, kind, factory) for kind, factory in registry.items())
    return Annotated[Union[kinds], Field(discriminator="type")] if len(kinds) > 1 else kinds[0]  # type: ignore[valid-type]  # noqa: UP007


def _model(what: str, kind: str, factory: Any) -> type[BaseModel]:
    entries: dict[str, Any] = {"type": (Literal[kind], ...)}
    for name, parameter in parameters_of(factory).items():
        form = FORMS.get(str(parameter.annotation), Any)
        entries[name] = (form, ... if parameter.default is Parameter.empty else None)
    if what == "bodies":
        entries["name"] = (str, None)
    summary = (factory.__doc__ or "").strip().splitlines()
    config = ConfigDict(extra="forbid", title=kind, json_schema_extra={"description": summary[0] if summary else kind})
    return create_model(f"{what}_{kind}", __config__=config, **entries)


def _table(name: str, kind: Any) -> type[BaseModel]:
    forms = {f.name: (Any, None) for f in fields(kind)}
    return create_model(name, __config__=ConfigDict(extra="forbid"), **forms)  # type: ignore[call-overload,no-any-return]


def _check_kinds(document: Mapping[str, Any]) -> None:
    """Name what is unknown before pydantic lists every kind there is."""
    for key in document:
        if key not in model().model_fields:
            raise unknown("key in the scene:", key, model().model_fields)
    for what, registry in REGISTRIES.items():
        for k, table in enumerate(document.get(what) or ()):
            if not isinstance(table, Mapping) or "type" not in table:
                raise InvalidInput(f"{what}.{k} needs a type: one of {', '.join(registry)}")
            if table["type"] not in registry:
                raise unknown(f"type in {what}.{k}:", table["type"], registry)
            known = {*parameters_of(registry[table["type"]]), "type", *(["name"] if what == "bodies" else [])}
            for key in table:
                if key not in known:
                    raise unknown(f"key in {what}.{k} ({table['type']}):", key, known)
    solver = document.get("solver", "euler")
    kind = solver.get("type") if isinstance(solver, Mapping) else solver
    if kind not in SOLVERS and kind not in ALIASES:
        raise unknown("solver", kind, [*SOLVERS, *ALIASES])


def _sentence(error: ValidationError) -> str:
    first = error.errors()[0]
    path = ".".join(str(part) for part in first["loc"] if not str(part).startswith(("list[", "function", "float", "int", "str")))
    value = repr(first.get("input"))
    shown = value if len(value) <= 60 else value[:57] + "..."
    text = first["msg"][0].lower() + first["msg"][1:]
    return f"{path or 'the scene'}: {text}, not {shown}"
