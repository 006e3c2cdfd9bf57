import numpy as np
import pytest
from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.typing.context import Context

from pointmass.engine import inner
from pointmass.engine.inner import Inner

INNER = {"pipeline_class": Inner, "_nrt": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@pytest.mark.parametrize("kind", [inner._Text, inner._Remembering])
def test_numba_still_has_what_is_overridden(kind: type) -> None:
    base = JITCodeLibrary if issubclass(kind, JITCodeLibrary) else Context
    for name in vars(kind):
        assert hasattr(base, name) or hasattr(object, name), f"{base.__name__}.{name} is gone: see engine/inner.py"


def test_functions_end_up_in_the_one_that_calls_them_and_have_no_code_of_their_own() -> None:
    @njit(**INNER)
    def square(a):
        return a * a

    @njit(**INNER)
    def folded(x, k):
        total = x[0] - x[0]
        for i in range(k, len(x)):
            total += square(x[i]) if x[i] > 0 else -x[i]
        return total, k + 0.5

    @njit(error_model="numpy")
    def entry(x, k):
        total, half = folded(x, k)
        return total + half

    x = np.array([1.0, -2.0, 3.0])
    assert entry(x, 1) == 2.0 + 9.0 + 1.5
    assert entry(x.astype(np.float32), 0) == 1.0 + 2.0 + 9.0 + 0.5
    for function in (square, folded):
        for compiled in function.overloads.values():
            assert compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0


def test_what_is_remembered_of_an_operator_is_what_numba_says() -> None:
    from numba.core.registry import cpu_target

    context = cpu_target.typing_context
    assert inner.SIGNATURES
    for (function, arguments), signature in inner.SIGNATURES.items():
        assert context.resolve_function_type(function, arguments, {}) == signature
