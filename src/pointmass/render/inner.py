"""How the kernels and their helpers are compiled, and how arrays are handed to them."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator"

from hashlib import sha256
from importlib.resources import files

from numba import config, njit
from numba.core import cgutils
from numba.extending import intrinsic

# A helper is only ever called by other kernels: without the wrappers for calls from Python and C, and without a
# cache of its own (its code is in its caller's), it compiles in half the time.
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)  # type: ignore[call-overload]


def _digest():
    """Of all text that ends up in a kernel's machine code."""
    folder = files("pointmass.render")
    names = sorted(f.name for f in folder.iterdir() if f.name.startswith("kernels") and f.name.endswith(".py"))
    tables = ("balls.py", "capsules.py", "sprites.py")
    texts = [folder.joinpath(name).read_bytes() for name in ("inner.py", *tables, *names)]
    return sha256(b"".join(texts)).hexdigest()[:16]


DIGEST = _digest()


def kernel(function):
    """Compile a function for calls from Python, once on a machine.

    Numba's cache sees a change of the function's own file alone. So its entry there is named by a digest of all files.
    """
    function.__qualname__ += f"_{DIGEST}"
    return njit(nogil=True, cache=True, error_model="numpy")(function)


@intrinsic
def _bare(typing_context, array):
    """Copy the description of an array, without the owner."""

    def generate(context, builder, signature, arguments):
        struct = context.make_array(signature.args[0])(context, builder, value=arguments[0])
        for owner in ("meminfo", "parent"):
            setattr(struct, owner, cgutils.get_null_value(getattr(struct, owner).type))
        return struct._getvalue()

    return array(array), generate


def _same(array):
    return array


# The same array without an owner. Every call that is handed an owned array counts its references atomically; in a
# call for each pixel, by several threads, that costs more than the pixel. The caller must keep the owner alive.
bare = _same if config.DISABLE_JIT else _bare  # type: ignore[attr-defined]
