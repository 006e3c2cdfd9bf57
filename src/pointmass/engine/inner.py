"""How the functions that kernels call are compiled: typed and lowered, and no more.

A kernel is many small functions and one entry that Python calls. Numba would optimise each of them and make machine
code for it, although all of them end up in the entry, where that is done anyway; so of the inner ones only the LLVM
text is kept. They are plain scalar code, so that most of Numba's passes have nothing to do (what is left of them is in
passes.py). Loops of all threads are functions of their own (outlining.py), and what Numba makes of one is text, too.
"""
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import operator
from copy import copy
from typing import Any

from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.core.typing.context import Context

from pointmass.engine import passes

PASSES = (  # what there is for closures, `with`, array expressions and prange is left out
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    passes.Process,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.InlineInlinables,
    passes.AssignOnce,
    typed_passes.NopythonTypeInference,
    passes.StripPhis,
    typed_passes.InlineOverloads,
    passes.EndLives,
    typed_passes.AnnotateTypes,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)
OPERATORS = frozenset([min, max, bool, int, *(value for value in vars(operator).values() if callable(value))])
PLAIN = types.Number, types.Boolean, types.Array
SIGNATURES: dict[Any, Any] = {}  # of operators and the numbers and arrays that they take


class _AsText(CompilerBase):
    """A compiler of Numba's whose libraries are text."""

    def __init__(self, typing: Context, target: Any, library: None, *more: Any) -> None:
        texts = copy(target)
        texts._internal_codegen = _Texts(target.codegen())
        texts.typing_context = _Remembering(typing)
        super().__init__(texts.typing_context, texts, library, *more)


class Inner(_AsText):
    """Numba's compiler for functions that only other compiled functions call."""

    def define_pipelines(self) -> list[PassManager]:
        manager = PassManager("inner")
        for each in PASSES:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class Loop(_AsText, Compiler):
    """Numba's compiler for loops of all threads, whose many small functions are text, too."""


class _Texts:
    """What makes libraries, if they are text."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def create_library(self, name: str, **options: Any) -> _Text:
        return _Text(self._codegen, name)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)


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
        plain = all(isinstance(a, PLAIN) for a in args)
        if not plain or kws or getattr(func, "typing_key", func) not in OPERATORS:
            return super().resolve_function_type(func, args, kws)
        if (func, args) not in SIGNATURES:
            SIGNATURES[func, args] = super().resolve_function_type(func, args, kws)
        return SIGNATURES[func, args]

    def resolve_value_type(self, val: Any) -> Any:
        found = super().resolve_value_type(val)
        return _Element(found) if val is operator.getitem else found


class _Element(types.Function):
    """Taking an element of an array: lowering asks what that means for each one that is taken."""

    def __init__(self, function: types.Function) -> None:
        self.__dict__.update(function.__dict__)

    def get_call_type(self, context: Context, args: Any, kws: Any) -> Any:
        return context.resolve_function_type(operator.getitem, args, kws)
