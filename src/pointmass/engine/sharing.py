"""What kernels have in common is compiled once in a process.

Two kernels of one scene, or a kernel before and after a force was switched, call many functions of the same text, such
as those that find impacts. The second kernel takes those of the first.
"""

from __future__ import annotations

import ast
from hashlib import sha256
from types import ModuleType
from typing import Any

KNOWN: dict[str, Any] = {}  # inner functions, by the hash of all the text that they depend on


def share(module: ModuleType, source: str) -> None:
    """Give a module that is not compiled yet the inner functions that other modules have already, and keep its own."""
    texts, names = _parts(source)
    for name, text in texts.items():
        if text.startswith("@njit(") and "ENTRY" not in text.split("\n", 1)[0]:
            key = sha256("\n".join([name, *(texts[n] for n in sorted(_needed(name, names)))]).encode()).hexdigest()
            setattr(module, name, KNOWN.setdefault(key, getattr(module, name)))


def _parts(source: str) -> tuple[dict[str, str], dict[str, set[str]]]:
    """The text of each function and constant of a module, and the names on which it depends."""
    lines = source.split("\n")
    texts, names = {}, {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            defined = [node.name]
        elif isinstance(node, ast.Assign):
            first = node.lineno
            defined = [t.id for t in node.targets if isinstance(t, ast.Name)]
        else:
            continue
        for name in defined:
            texts[name] = "\n".join(lines[first - 1 : node.end_lineno])
            names[name] = _globals(node)
    return texts, names


def _globals(node: ast.AST) -> set[str]:
    """Names that come from outside of a function, or of an expression."""
    found = [n for n in ast.walk(node) if isinstance(n, ast.Name)]
    own = {n.id for n in found if isinstance(n.ctx, ast.Store)} | {
        a.arg for a in ast.walk(node) if isinstance(a, ast.arg)
    }
    return {n.id for n in found} - own


def _needed(name: str, names: dict[str, set[str]]) -> set[str]:
    """A name and all on which it depends."""
    found: set[str] = set()
    left = [name]
    while left:
        one = left.pop()
        if one in names and one not in found:
            found.add(one)
            left += names[one]
    return found
