"""The page's types, from the messages: `python -m pointmass.viewer.typescript > viewer/src/messages.ts`."""

from __future__ import annotations

import types
from dataclasses import fields, is_dataclass
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from pointmass.viewer import messages

ALIASES = {"Vector": messages.Vector, "Color": messages.Color, "Value": messages.Value}
UNIONS = {"Inbound": messages.Inbound, "Outbound": messages.Outbound, "Part": messages.Part}
PLAIN = {bool: "boolean", int: "number", float: "number", str: "string", type(None): "null"}


def generated() -> str:
    """The text of messages.ts."""
    lines = ["// Made by: python -m pointmass.viewer.typescript > viewer/src/messages.ts", ""]
    lines += [f"export type {name} = {_type(hint, top=True)};" for name, hint in ALIASES.items()]
    for name, value in vars(messages).items():
        if is_dataclass(value) and isinstance(value, type) and value.__module__ == messages.__name__:
            lines += ["", f"/** {(value.__doc__ or '').strip().splitlines()[0]} */", f"export interface {name} {{"]
            kind = getattr(value, "kind", None)
            lines += [] if kind is None else [f'  kind: "{kind}";']
            hints = get_type_hints(value)
            lines += [f"  {f.name}: {_type(hints[f.name])};" for f in fields(value)]
            lines.append("}")
    for name, union in UNIONS.items():
        lines += ["", f"export type {name} = {' | '.join(part.__name__ for part in get_args(union))};"]
    lines += ["", f"export const FRAME = {messages.FRAME};"]
    return "\n".join(lines) + "\n"


def _type(hint: Any, top: bool = False) -> str:
    for name, alias in (ALIASES | UNIONS).items():
        if not top and hint == alias:
            return name
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if set(get_args(messages.Part)) < set(parts):
            return "Part | null"
        return " | ".join(dict.fromkeys(_type(part) for part in parts))
    if origin is tuple:
        return f"[{', '.join(_type(part) for part in parts)}]"
    if origin is list:
        return f"{_type(parts[0])}[]"
    if origin is dict:
        return f"Record<{_type(parts[0])}, {_type(parts[1])}>"
    if origin is Literal:
        return " | ".join(f'"{part}"' for part in parts)
    return PLAIN.get(hint) or str(hint.__name__)


if __name__ == "__main__":
    print(generated(), end="")
