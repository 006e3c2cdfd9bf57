"""What a kernel reads besides the state: the numbers and columns of the laws, found anew whenever it is launched.

Which parameters are numbers, columns or functions of time is compiled; their values are data.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import grids as grid_text
from pointmass.engine import noise as noise_text
from pointmass.engine.printing import Call, statements
from pointmass.laws.force import Force
from pointmass.laws.grid import Grid, GridLookup
from pointmass.laws.parameter import Component, Parameter
from pointmass.particles import Particles, read_only
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Function, Primitive, Program
from pointmass.tracing.trace import Traced, vector_names

Array = NDArray[np.floating[Any]]
GRID = ("values", "numbers", "shape")  # arrays of a grid
OUT_OF_BOUNDS = 2  # status of an island: a function of time is not allowed at some time


@dataclass
class Table:
    """Columns of one length, the rows of an array in the kernel.

    Attributes
    ----------
    name : of the array.
    getters : give each row anew, shape (length,).
    """

    name: str
    getters: list[Callable[[], Array]] = field(default_factory=list)
    _known: dict[str, int] = field(default_factory=dict)
    _last: Array | None = None  # its memory is used again

    def column(self, key: str, get: Callable[[], Array], index: str) -> str:
        """The entry of a column as an expression; a column with a key that is known is shared."""
        if key not in self._known:
            self._known[key] = len(self.getters)
            self.getters.append(get)
        return self.entry(self._known[key], index)

    def entry(self, column: int, index: str) -> str:
        """An entry as an expression."""
        return f"{self.name}[{column}, {index}]"

    def beside(self, index: str) -> bool:
        """Whether numbers are at hand where an index is used."""
        return False

    def array(self, length: int, dtype: Any, order: NDArray[np.intp] | None) -> Array:
        """All columns now, in the order of the kernel's rows."""
        if self._last is None or self._last.shape[1] != length:
            self._last = np.empty((len(self.getters), length), dtype)
        for row, get in zip(self._last, self.getters, strict=True):
            values = get()
            row[:] = values if order is None or np.ndim(values) == 0 else values[order]
        return self._last


class Watched:
    """Columns that may change between two looks.

    One that nobody can write, and that is still the same array, is the same.
    """

    def __init__(self) -> None:
        self._known: list[Array] | None = None  # as they were given
        self._copies: list[Array] = []  # as they were

    def changed(self, columns: Sequence[Array]) -> bool:
        """Whether these are not what was given the last time, or the first ones."""
        if self._known is not None and all(map(self._same, columns, self._known, self._copies)):
            return False
        self._known = list(columns)
        self._copies = [column.copy() if column.flags.writeable else column for column in columns]
        return True

    @staticmethod
    def _same(now: Array, known: Array, copy: Array) -> bool:
        return (now is known and not now.flags.writeable) or bool(np.array_equal(now, copy))


class Packed:
    """Columns of some tables in the order of a fast path, packed anew only when one of them has changed.

    Parameters
    ----------
    tables : whose columns, one after the other.
    orders : for each table, the rows in the order in which the kernel reads them.
    pack : one array from a column in that order, and how far apart the kernel's parts of it are: 0 if all are equal.
    """

    def __init__(
        self,
        tables: Sequence[Table],
        orders: Sequence[NDArray[np.intp]],
        dtype: str,
        pack: Callable[[Array], tuple[Array, int]],
    ) -> None:
        self._columns = [(get, order) for t, order in zip(tables, orders, strict=True) for get in t.getters]
        self._dtype, self._pack = dtype, pack
        self._watched = Watched()
        self._arrays: tuple[Array, NDArray[np.int64]]

    def arrays(self) -> tuple[Array, NDArray[np.int64]]:
        """All columns, and where each begins and how far its next part is."""
        raw = [get() for get, _ in self._columns]
        if self._watched.changed(raw):
            packed = [
                self._pack(c[order].astype(self._dtype)) for c, (_, order) in zip(raw, self._columns, strict=True)
            ]
            begins = np.cumsum([0, *(part.size for part, _ in packed)])
            where = [place for begin, (_, far) in zip(begins, packed, strict=False) for place in (begin, far)]
            self._arrays = np.concatenate([part for part, _ in packed]), np.array(where, np.int64)
        return self._arrays


@dataclass
class Numbers:
    """Numbers that all rows share: the entries of one array in the kernel, read into locals p0, p1, ..."""

    getters: list[Callable[[], float]] = field(default_factory=list)
    _known: dict[str, int] = field(default_factory=dict)

    def number(self, key: str, get: Callable[[], float]) -> str:
        """The local that holds a number; one with a key that is known is shared."""
        if key not in self._known:
            self._known[key] = len(self.getters)
            self.getters.append(get)
        return f"p{self._known[key]}"

    def array(self) -> NDArray[np.float64]:
        """All numbers now."""
        return np.array([get() for get in self.getters], np.float64)

    def lines(self) -> list[str]:
        """Statements that read them."""
        return [f"p{k} = R(P[{k}])" for k in range(len(self.getters))]


@dataclass(frozen=True)
class Text:
    """How a kernel evaluates a law for one particle or element.

    Attributes
    ----------
    at_time : statements that need only the time `t`, in float64.
    lines : statements for one item.
    outputs : expressions.
    """

    at_time: list[str]
    lines: list[str]
    outputs: list[str]


class Binder:
    """Binds the inputs of laws to expressions of a kernel.

    Parameters
    ----------
    columns : where columns of the particles go; the inverse mass is the first, unless it is the same for all.
    switches : whether forces can be switched off without another kernel.
    equal : columns that are the same for all particles.
    """

    def __init__(
        self,
        particles: Particles,
        columns: Table,
        switches: bool = True,
        equal: frozenset[str] = frozenset(),
    ) -> None:
        self.switches, self.equal = switches, equal
        self.particles = particles
        self.dtype = str(particles.dtype)
        self.numbers = Numbers()
        self.particle = columns
        if "w" not in equal:
            self.attribute("w", "")
        self._grids: list[Grid] = []
        self._masks: dict[tuple[int, str], Array] = {}  # of groups, by the version of the particles
        self._functions: dict[Hashable, tuple[str, str]] = {}  # name and text, in the order in which laws need them

    @property
    def arrays(self) -> list[str]:
        """Names of the arrays that the laws read, in order: numbers, columns, and three for each grid."""
        return ["P", self.particle.name, *(f"grid{k}_{what}" for k in range(len(self._grids)) for what in GRID)]

    def data(self, length: int, order: NDArray[np.intp] | None) -> list[Any]:
        """The arrays now; columns have one entry for each row of the kernel."""
        columns = self.particle.array(length, self.particles.dtype, order)
        numbers, *grids = self.common()
        return [numbers, columns, *grids]

    def common(self) -> list[Any]:
        """The arrays now without the columns."""
        dtype = self.particles.dtype
        grids = [(g.table(dtype).ravel(), grid_text.numbers(g, dtype), grid_text.shape(g)) for g in self._grids]
        return [self.numbers.array(), *(array for each in grids for array in each)]

    @property
    def functions(self) -> str:
        """Text of the functions that the laws call."""
        return "".join(text for _, text in self._functions.values())

    def caller(self, program: Program, precision: str = "") -> Call:
        """How a program calls its primitives, in the precision of the kernel or another one."""
        dtype = precision or self.dtype
        found = dict.fromkeys(program.nodes[i][1] for i in program.live() if program.nodes[i][0] == "call")

        def call(primitive: Primitive, parts: list[str]) -> tuple[str, int | None]:
            if isinstance(primitive, GridLookup):
                return self._look_up(primitive, parts), None
            assert isinstance(primitive, Function)
            together = tuple(p for p in found if isinstance(p, Function) and p.family == primitive.family)
            name = self._function((dtype, together), lambda name: noise_text.function_of(together, name, dtype))
            return f"{name}({', '.join(parts)})", together.index(primitive)

        return call

    def _look_up(self, lookup: GridLookup, parts: list[str]) -> str:
        """A look-up in a grid."""
        self._function("along", lambda name: grid_text.ALONG)
        name = self._function(lookup, lambda name: grid_text.look_up(lookup, name))
        if lookup.grid not in self._grids:
            self._grids.append(lookup.grid)
        k = self._grids.index(lookup.grid)
        return f"{name}({', '.join([*parts, *(f'grid{k}_{what}' for what in GRID)])})"

    def _function(self, key: Hashable, text: Callable[[str], str]) -> str:
        """The name of a function, whose text is printed on its first use."""
        if key not in self._functions:
            name = f"call{len(self._functions)}"
            self._functions[key] = name, text(name)
        return self._functions[key][0]

    def attribute(self, name: str, index: str) -> str:
        """A column of the particles."""
        if name in self.equal:
            number = self.numbers.number(f"all {name}", lambda: float(self._column(name)))
            return number if self.particle.beside(index) else f"R(P[{number.removeprefix('p')}])"
        return self.particle.column(name, lambda: self._column(name), index)

    def _column(self, name: str) -> Array:
        """A column, or the number that all have."""
        p = self.particles
        if name not in self.equal:
            return p.w if name == "w" else p.column(name)
        first = p.column("m" if name == "w" else name)[0]
        result: Array = 1 / first if name == "w" else first
        return result

    def law(
        self,
        traced: Traced,
        force: Force,
        state: Mapping[str, str],
        index: str,
        table: Table,
        tag: str,
        time: str = "t",
    ) -> Text:
        """A law of a force.

        Parameters
        ----------
        traced : the law, or a derivative of it, of the same inputs.
        state : expression of each input that is no parameter.
        index : of the item in its table.
        table : where columns of parameters go.
        tag : keeps its locals apart.
        time : the local that holds the time, a float64.
        """
        program = expanded(traced.program)
        needed = program.arguments()
        names, at_time, lines = dict(state), [], []
        for parameter in force.parameters.values():
            for name, expression, timed, own in self._parameter(force, parameter, needed, index, table, tag, time):
                names[name] = expression
                at_time += timed
                lines += own
        body, outputs = statements(program, names, f"{tag}_", self.dtype, self.caller(program))
        return Text(at_time, lines + body, outputs)

    def selected(self, force: Force, index: str) -> str | None:
        """The condition under which a force acts on a row; None if it always does."""
        tests = [f"{self.switch(force)} != 0"] if self.switches else []
        if force.on is not None:
            tests.append(f"{self.particle.column(f'on {id(force)}', lambda: self._mask(force), index)} != 0")
        return " and ".join(tests) or None

    def switch(self, force: Force) -> str:
        """The local that is not 0 where a force is enabled."""
        return self.numbers.number(f"enabled {id(force)}", lambda: float(force.enabled))

    def _mask(self, force: Force) -> Array:
        p = self.particles
        if not isinstance(force.on, str):
            return self._acts_on(force)
        key = p.version, force.on
        if key not in self._masks:
            self._masks = {known: mask for known, mask in self._masks.items() if known[0] == p.version}
            self._masks[key] = read_only(self._acts_on(force))
        return self._masks[key]

    def _acts_on(self, force: Force) -> Array:
        mask = np.zeros(len(self.particles), self.particles.dtype)
        mask[self.particles.select(force.on)] = 1
        return mask

    def _parameter(
        self, force: Force, parameter: Parameter, needed: set[str], index: str, table: Table, tag: str, time: str
    ) -> list[tuple[str, str, list[str], list[str]]]:
        """(input, expression, statements of the time, statements of the item) of each component that is needed."""
        found = []
        inputs = vector_names(parameter.name) if parameter.vector else (parameter.name,)
        for axis, (name, component) in enumerate(zip(inputs, parameter.components, strict=True)):
            if name in needed:
                get = _getter(force, parameter.name, axis)
                key = f"{id(force)} {name}"
                found.append((name, *self._component(component, get, key, index, table, f"{tag}_{name}_", time)))
        return found

    def _component(
        self,
        component: Component,
        get: Callable[[], Component],
        key: str,
        index: str,
        table: Table,
        prefix: str,
        time: str,
    ) -> tuple[str, list[str], list[str]]:
        value = component.value
        if isinstance(value, float):
            return self.numbers.number(key, lambda: float(get().value)), [], []  # type: ignore[arg-type]
        if isinstance(value, np.ndarray):
            return table.column(key, lambda: get().value, index), [], []  # type: ignore[arg-type, return-value]
        program = expanded(value.program)
        if not component.needs:
            lines, (result,) = statements(program, {"t": time}, prefix, "float64", self.caller(program, "float64"))
            bounds = _bounds(component, f"{prefix}q")
            return f"{prefix}r", [*lines, f"{prefix}q = {result}", f"{prefix}r = R({prefix}q)", *bounds], []
        names = {n: self.attribute(n, index) for n in component.needs} | {"t": f"R({time})"}
        lines, (result,) = statements(program, names, prefix, self.dtype, self.caller(program))
        return result, [], lines


def equal_columns(particles: Particles) -> frozenset[str]:
    """Columns that are the same for all particles: masses, inverse masses and radii."""
    p = particles
    found = {name for name in ("m", "radius") if len(p) and bool((p.column(name) == p.column(name)[0]).all())}
    return frozenset(found | {"w"} if "m" in found and not p.has_pins else found)


def kinds(forces: list[Force]) -> tuple[Any, ...]:
    """What of the forces is compiled: another value needs another kernel."""
    return tuple(
        (f, f.on is None, *(c.value if isinstance(c.value, Traced) else type(c.value) for c in _components(f)))
        for f in forces
    )


def _components(force: Force) -> list[Component]:
    return [c for p in force.parameters.values() for c in p.components]


def _getter(force: Force, name: str, axis: int) -> Callable[[], Component]:
    return lambda: force.parameters[name].components[axis]


def _bounds(component: Component, value: str) -> list[str]:
    """Statements that note when a function of time is not allowed, as `errors.number` would say."""
    if component.bounds is None:
        return []
    tests = [f"not abs({value}) < np.inf"]
    signs = {"above": "> {0}", "at_least": ">= {0}", "at_most": "<= {0}", "below": "< {0}"}
    tests += [f"not {value} {signs[name].format(repr(float(limit)))}" for name, limit in component.bounds.items()]
    return [f"if {' or '.join(tests)}:", f"    status = {OUT_OF_BOUNDS}"]
