"""How the functions that kernels call are compiled: typed and lowered, and no more.

A kernel is many small functions and one entry that Python calls. Numba would optimise each of them and make machine
code for it, although all of them end up in the entry, where that is done anyway; so of the inner ones only the LLVM
text is kept. They are plain scalar code, so that most of Numba's passes have nothing to do. Together that takes a third
off the time of compiling.
"""
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import operator
from typing import Any

from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.core.typing.context import Context

PASSES = (  # what there is for closures, `with`, array expressions and prange is left out
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.InlineInlinables,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.InlineOverloads,
    typed_passes.IRLegalization,
    typed_passes.AnnotateTypes,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)
OPERATORS = frozenset(value for value in vars(operator).values() if callable(value))
SIGNATURES: dict[Any, Any] = {}  # of operators and the numbers that they take


class Inner(CompilerBase):
    """Numba's compiler for functions that only other compiled functions call."""

    def __init__(self, typing: Context, target: Any, library: None, *more: Any) -> None:
        super().__init__(_Remembering(typing), target, _Text(target.codegen(), "inner"), *more)

    def define_pipelines(self) -> list[PassManager]:
        manager = PassManager("inner")
        for each in PASSES:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class _Text(JITCodeLibrary):
    """LLVM text that others link in."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> _Nowhere:
        return _Nowhere()


class _Nowhere:
    """Takes what a function would need to be called from Python."""

    def set_env(self, name: str, environment: Any) -> None:
        pass


class _Remembering(Context):
    """Numba's knowledge of types; it need not find out again what the sum of two numbers is."""

    def __init__(self, context: Context) -> None:
        self.__dict__ = context.__dict__

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        numbers = all(isinstance(a, (types.Number, types.Boolean)) for a in args)
        if not numbers or kws or getattr(func, "typing_key", None) not in OPERATORS:
            return super().resolve_function_type(func, args, kws)
        if (func, args) not in SIGNATURES:
            SIGNATURES[func, args] = super().resolve_function_type(func, args, kws)
        return SIGNATURES[func, args]
