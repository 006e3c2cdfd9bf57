"""Plain tables as TOML text, laid out for people: one line to a value, one header to a table.

Libraries that write TOML put each number of a nested list on a line of its own, or take minutes for a list of a
thousand particles.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

WIDTH = 110  # a list of lists that does not fit in it is broken into rows


def dumps(document: Mapping[str, Any]) -> str:
    """A document of tables, lists, text, numbers, true and false; `tomllib.loads` gives an equal one back.

    Tables in the document, and in its lists, get a header each; deeper ones are written in line.
    """
    plain = [f"{_key(name)} = {_value(value)}\n" for name, value in document.items() if not _headed(value)]
    parts = ["".join(plain)]
    for name, value in document.items():
        if isinstance(value, Mapping):
            parts.append(_table(f"[{_key(name)}]", value))
        elif _headed(value):
            parts += [_table(f"[[{_key(name)}]]", item) for item in value]
    return "\n".join(part for part in parts if part)


def _headed(value: Any) -> bool:
    """Whether it is written under a header: a table, or a list of tables."""
    listed = isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0
    return isinstance(value, Mapping) or (listed and all(isinstance(item, Mapping) for item in value))


def _table(header: str, table: Mapping[str, Any]) -> str:
    return "".join([f"{header}\n", *(f"{_key(name)} = {_value(value)}\n" for name, value in table.items())])


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }" if value else "{}"
    if isinstance(value, Sequence):
        items = [_value(item) for item in value]
        line = "[" + ", ".join(items) + "]"
        nested = any(isinstance(item, (list, tuple, dict)) for item in value)
        return line if len(line) <= WIDTH or not nested else "[\n" + "".join(f"    {item},\n" for item in items) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # nan, inf and -inf, as in TOML
    return json.dumps(value)  # numbers and truth values are written alike


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("-", "").replace("_", "").isalnum()
    return name if bare else _text(name)
