"""Loops of all threads as functions of their own: what is printed long compiles in short pieces.

Numba's passes for `prange` take a time that grows with the square of the function around the loop. So the body of each
such loop becomes a function, which is compiled as the other inner ones are, and the loop itself one of three lines:
all that those passes see. LLVM puts the body back where it was.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from textwrap import dedent

from pointmass.engine.printing import function, indented

PARALLEL = "parallel=True, "
MAKERS = ("np.empty(", "np.zeros(", "scratch(")  # calls that give new arrays


def outlined(text: str) -> str:
    """The text of functions, in which each loop of all threads is one of its own.

    A loop may add to a variable of the function around it, or keep the largest (`most = max(most, other)`); everything
    else that it assigns is its own.
    """
    if PARALLEL not in text:
        return text
    lines = text.split("\n")
    for node in reversed(ast.parse(text).body):
        if isinstance(node, ast.FunctionDef) and node.decorator_list:
            start = node.decorator_list[0].lineno - 1
            if PARALLEL in lines[start]:
                lines[start : node.end_lineno] = _Function(lines, node).text()
    return "\n".join(lines)


class _Function:
    """A function with loops of all threads."""

    def __init__(self, lines: Sequence[str], node: ast.FunctionDef) -> None:
        self.lines, self.node = lines, node
        loops = [n for n in ast.walk(node) if isinstance(n, ast.For) and _called(n.iter) == "prange"]
        loops.sort(key=lambda loop: loop.lineno)
        bodies = {id(n) for loop in loops for each in loop.body for n in ast.walk(each)}
        around = [n for n in ast.walk(node) if id(n) not in bodies]
        self.known = {*(a.arg for a in node.args.args), *_names(around, ast.Store)}
        self.loops = [self._loop(k, loop, set(_names(around, ast.Load))) for k, loop in enumerate(loops)]

    def text(self) -> list[str]:
        """All functions that it becomes."""
        lines = list(self.lines[self.node.lineno - 1 : self.node.end_lineno])
        for loop in reversed(self.loops):
            first = loop.node.lineno - self.node.lineno
            lines[first : loop.node.end_lineno - self.node.lineno + 1] = loop.call()  # type: ignore[operator]
        head = self.lines[self.node.decorator_list[0].lineno - 1].replace(PARALLEL, "")
        if "**OWNING)" in head and not _makes(lines):
            head = head.replace("OWNING", "FLAGS")
        return [*chain.from_iterable(loop.functions() for loop in self.loops), head, *lines]

    def _loop(self, number: int, node: ast.For, read: set[str]) -> _Loop:
        inside = [n for each in node.body for n in ast.walk(each)]
        carried = {name: operation for name, operation in _carried(inside) if name in self.known}
        local = {ast.unparse(node.target), *_names(inside, ast.Store)} - set(carried)
        left = local & read - self.known
        assert not left, f"{left} leave a loop of {self.node.name}"
        wanted = dict.fromkeys(n for n in _names(inside, ast.Load) if n in self.known - local - set(carried))
        return _Loop(f"{self.node.name}_{number}", node, self.lines, list(wanted), carried)


@dataclass(frozen=True)
class _Loop:
    """A loop of all threads, the names that it is given, and how it changes variables of the function around it."""

    name: str
    node: ast.For
    source: Sequence[str]
    given: list[str]
    carried: dict[str, str]

    @property
    def index(self) -> str:
        return ast.unparse(self.node.target)

    @property
    def ends(self) -> list[str]:
        """Where it ends, or begins and ends."""
        assert isinstance(self.node.iter, ast.Call)
        return [ast.unparse(end) for end in self.node.iter.args]

    def call(self) -> list[str]:
        """What stands in its place."""
        call = f"{self.name}({', '.join([*self.ends, *self.given, *self.carried])})"
        return [f"{' ' * self.node.col_offset}{f'{self._results} = ' if self.carried else ''}{call}"]

    def functions(self) -> list[str]:
        """What is done for one index, and the loop."""
        ends = ", ".join(["first_", "last_"][-len(self.ends) :])
        begin = [f"{name} = {'0' if add == '+' else f'{name}_'}" for name, add in self.carried.items()]
        began = [f"{name}_" for name in self.carried]
        back = [f"return {self._results}"] if self.carried else []
        arguments = ", ".join([*self.given, *began])
        body = self._body(back)
        flags = "OWNING" if _makes(body) else "FLAGS"
        one = f"{self.name}_one({self.index}, {arguments})"
        loop, more = [one], []
        if self.carried:
            results = [f"{name}_more" for name in self.carried]
            more = [
                f"{name} += {result}" if add == "+" else f"{name} = max({name}, {result})"
                for (name, add), result in zip(self.carried.items(), results, strict=True)
            ]
            loop = [f"{', '.join(results)} = {one}"]
        around = [
            *(f"{name} = {name}_" for name in self.carried),
            f"for {self.index} in prange({ends}):",
            *indented([*loop, *more], 1),
            *back,
        ]
        inner = function(
            f"{self.name}_one", f"{self.index}, {arguments}", f"forceinline=True, **{flags}", [*begin, *body, *back]
        )
        outer = function(self.name, f"{ends}, {arguments}", "**LOOP", around)
        return [*inner.split("\n")[:-1], *outer.split("\n")[:-1]]

    @property
    def _results(self) -> str:
        return ", ".join(self.carried)

    def _body(self, back: list[str]) -> list[str]:
        first, last = self.node.body[0].lineno - 1, self.node.end_lineno
        lines = list(self.source[first:last])
        for on in _continued(self.node.body):
            lines[on - first - 1] = lines[on - first - 1].replace("continue", back[0] if back else "return")
        return dedent("\n".join(lines)).split("\n")


def _called(node: ast.AST) -> str:
    return node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""


def _makes(lines: Iterable[str]) -> bool:
    return any(maker in line for line in lines for maker in MAKERS)


def _names(nodes: Iterable[ast.AST], how: type[ast.expr_context]) -> Iterator[str]:
    return (n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, how))


def _carried(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, str]]:
    """Variables that a loop changes and does not begin, and how."""
    set_anew: set[str] = set()
    changed: dict[str, str] = {}
    for node in nodes:
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name) and isinstance(node.op, ast.Add):
            changed[node.target.id] = "+"
        elif isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            name, value = node.targets[0].id, node.value
            if _called(value) == "max" and isinstance(value, ast.Call) and ast.unparse(value.args[0]) == name:
                changed.setdefault(name, "max")
            else:
                set_anew.add(name)
        elif isinstance(node, ast.For):
            set_anew.update(_names([node.target], ast.Store))
    return ((name, how) for name, how in changed.items() if name not in set_anew)


def _continued(body: Sequence[ast.stmt]) -> Iterator[int]:
    """Lines that go on with the next index of the loop of this body."""
    for node in body:
        if isinstance(node, ast.Continue):
            yield node.lineno
        elif isinstance(node, ast.If):
            yield from _continued(node.body)
            yield from _continued(node.orelse)
