"""How kernels that are written by hand, and their helpers, are compiled. Whoever needs it imports it then, for it
imports Numba."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator"

from hashlib import sha256
from importlib.resources import files

from numba import njit

# A helper is only ever called by other kernels: without the wrappers for calls from Python and C, and without a
# cache of its own (its code is in its caller's), it compiles in half the time.
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)  # type: ignore[call-overload]


def digest_of(package, *others):
    """Of all text that ends up in machine code: a package's files that begin with "kernels", and some others there."""
    folder = files(package)
    names = sorted(f.name for f in folder.iterdir() if f.name.startswith("kernels") and f.name.endswith(".py"))
    texts = [files("pointmass").joinpath("kernels_base.py"), *(folder.joinpath(name) for name in (*others, *names))]
    return sha256(b"".join(text.read_bytes() for text in texts)).hexdigest()[:16]


def compiler(digest):
    """What compiles a function for calls from Python, once on a machine.

    Numba's cache sees a change of the function's own file alone. So its entry there is named by a digest of all files.
    """

    def kernel(function):
        function.__qualname__ += f"_{digest}"
        return njit(nogil=True, cache=True, error_model="numpy")(function)

    return kernel
