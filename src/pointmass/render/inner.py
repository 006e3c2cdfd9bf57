"""How the kernels' helpers are compiled."""

from numba import njit

# A helper is only ever called by other kernels: without the wrappers for calls from Python and C, and without a
# cache of its own (its code is in its caller's), it compiles in half the time.
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
