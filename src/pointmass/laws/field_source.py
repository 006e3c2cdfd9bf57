"""Where the numbers of a field come from: formulas, or a grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput, number, shown
from pointmass.laws.formula import CONSTANTS, FUNCTIONS, Formula
from pointmass.laws.grid import Grid
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Particles
from pointmass.tracing.program import Symbol


class FieldSource:
    """A field of space and time that a force or a flow is made of.

    Its constants, the particle attributes in its formulas, and the scale of its grid become parameters of the law, so
    each may be a number, a column or a function of t, and changing one compiles nothing.

    Attributes
    ----------
    parameters : what the law takes besides its state.
    formulas : as parsed; empty for a grid.
    grid : or the grid.

    Parameters
    ----------
    what : name of the field in messages, such as "velocity".
    formulas : `count` formulas, or numbers; a plane field may leave out the third.
    grid : or values at the points of a grid.
    constants : values by name, for the formulas.
    scale : factor on a grid.
    variables : names of the state that the formulas may use.
    count : how many numbers the field has at each place: 3, or 1 for a potential.
    """

    def __init__(
        self,
        what: str,
        formulas: Any,
        grid: Grid | None,
        constants: Mapping[str, Scalar] | None,
        scale: Scalar,
        variables: Sequence[str],
        count: int = 3,
    ) -> None:
        self.what = what
        self.variables = tuple(variables)
        if constants is not None and not isinstance(constants, Mapping):
            raise InvalidInput(f'constants of {what} must be values by name, such as {{"k": 2.0}}, not {constants!r}')
        self.constants = dict(constants or {})
        self.grid = grid
        self.formulas: tuple[Formula, ...] = ()
        if grid is not None:
            if grid.components != count:
                raise InvalidInput(
                    f"the grid of {what} has {grid.components} numbers at each point: it must have {count}"
                )
            if self.constants:
                raise InvalidInput(f"constants of {what} belong to formulas, and a grid has none: leave them out")
            self.parameters = [Parameter("scale", scale)]
        else:
            if not isinstance(scale, (int, float)) or scale != 1:
                raise InvalidInput(f"scale of {what} belongs to a grid: write the factor into the formulas")
            self.formulas = _parsed(what, formulas, count)
            self.parameters = self._parameters()

    def value(self, state: Mapping[str, Any], parameters: Sequence[Any]) -> list[Any]:
        """The field at a state, given by name, for the present values of the parameters: symbols in, symbols out."""
        own = {p.name: v for p, v in zip(self.parameters, parameters, strict=True)}
        if self.grid is None:
            return [formula({**state, **own}) for formula in self.formulas]
        place: list[Symbol] = [state[name] for name in ("x", "y", "z", "t")]
        program = place[0].program
        nodes = [place[0].lift(p) for p in place]
        looked_up = (program.call(self.grid.lookup(k), *nodes) for k in range(self.grid.components))
        return [own["scale"] * Symbol(program, node) for node in looked_up]

    def check(self, particles: Particles) -> None:
        """Refuse names that the particles do not have, with all that are known."""
        for formula in self.formulas:
            formula.restrict([*self.variables, *self.constants, *particles.columns])

    def arguments_with(self, arguments: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
        """Arguments of a force with other values: those of constants belong to `constants`."""
        constants = {n: v for n, v in values.items() if n in self.constants}
        result = arguments | {n: v for n, v in values.items() if n not in constants}
        return result | {"constants": self.constants | constants} if constants else result

    def _parameters(self) -> list[Parameter]:
        for name in self.constants:
            if not name.isidentifier():
                raise InvalidInput(f"constant {name!r} of {self.what} is not allowed: a name is one word")
            if name in (*self.variables, *CONSTANTS, *FUNCTIONS):
                raise InvalidInput(f"constant {name!r} of {self.what} is not allowed: the name has another meaning")
        names = set().union(*(formula.names for formula in self.formulas))
        attributes = sorted(names - set(self.variables) - set(self.constants))
        return [Parameter(n, v) for n, v in self.constants.items()] + [Parameter(n, n) for n in attributes]


def _parsed(what: str, formulas: Any, count: int) -> tuple[Formula, ...]:
    parts = [formulas] if count == 1 and not isinstance(formulas, (list, tuple)) else formulas
    if not isinstance(parts, (list, tuple)) or len(parts) not in ({1} if count == 1 else {2, 3}):
        wanted = "one formula" if count == 1 else 'three formulas, such as ("-y", "x", "0")'
        raise InvalidInput(f"{what} must be {wanted}, not {shown(formulas)}")
    return tuple(Formula(_text(what, part), what=what) for part in [*parts, "0"][: max(count, 1)])


def _text(what: str, part: Any) -> str:
    """A formula, or a number as one."""
    if isinstance(part, str):
        return part
    if not isinstance(part, (int, float, np.number)) or isinstance(part, bool):
        raise InvalidInput(f"{what} must be made of formulas and numbers, not {shown(part)}")
    return repr(number(what, part))
