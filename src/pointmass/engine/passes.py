"""Numba's passes over the text of inner functions, each with what long functions without references need of it.

Numba goes through all blocks of a function for every variable that is assigned twice, and a choice between two numbers
is one, and three blocks. Here it goes through those in which the variable occurs; what comes out is the same. And it
finds out four times how long each variable lives: only counts of references need that.
"""
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from numba.core import ir_utils, ssa, transforms, typed_passes, untyped_passes
from numba.core.analysis import compute_cfg_from_blocks
from numba.core.compiler_machinery import register_pass

Blocks = dict[int, Any]


@register_pass(mutates_CFG=False, analysis_only=False)
class Process(untyped_passes.IRProcessing):
    """Gives each function one end of each loop."""

    _name = "process"

    def run_pass(self, state: Any) -> bool:
        state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class AssignOnce(untyped_passes.ReconstructSSA):
    """Gives each assignment of a variable a name of its own."""

    _name = "assign_once"

    def run_pass(self, state: Any) -> bool:
        state.func_ir.blocks = assigned_once(state.func_ir.blocks)
        self._patch_locals(state)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class StripPhis(typed_passes.PreLowerStripPhis):
    """Makes assignments of what a variable is after a choice."""

    _name = "strip_phis_only"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=False, analysis_only=True)
class EndLives(typed_passes.IRLegalization):
    """Says where variables end, if that gives references back."""

    _name = "end_lives"

    def run_pass(self, state: Any) -> bool:
        return bool(super().run_pass(state)) if state.flags.nrt else True


def assigned_once(blocks: Blocks) -> Blocks:
    """Blocks in which every variable is assigned once: those of `numba.core.ssa.reconstruct_ssa`."""
    cfg = compute_cfg_from_blocks(blocks)
    fronts = ssa._iterated_domfronts(cfg)
    violators = ssa._find_defs_violators(blocks, cfg)
    places = _places(blocks, violators)
    known = ssa._CacheListVars()
    result = dict(blocks)
    for name in violators:
        some = {label: result[label] for label in places[name]}
        some, defined = ssa._fresh_vars(some, name)
        states = ssa._make_states(some)
        states |= {"varname": name, "defmap": defined, "phimap": defaultdict(list), "cfg": cfg}
        states["phi_locations"] = ssa._compute_phi_locations(fronts, defined)
        result |= ssa._run_block_rewrite(some, states, ssa._FixSSAVars(known))
        for label, phis in states["phimap"].items():
            result[label].body = phis + result[label].body
    return result


def _places(blocks: Blocks, names: Iterable[str]) -> dict[str, list[int]]:
    """In which blocks variables occur."""
    places: dict[str, dict[int, None]] = {name: {} for name in names}
    for label, block in blocks.items():
        for statement in block.body:
            for variable in statement.list_vars():
                if variable.name in places:
                    places[variable.name][label] = None
    return {name: list(labels) for name, labels in places.items()}
