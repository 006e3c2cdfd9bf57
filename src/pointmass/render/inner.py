"""How the kernels and their helpers are compiled, and how arrays are handed to them."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator"

from numba import config
from numba.core import cgutils
from numba.extending import intrinsic

from pointmass.kernels_base import compiler, digest_of

DIGEST = digest_of("pointmass.render", "inner.py", "balls.py", "capsules.py", "sprites.py")
kernel = compiler(DIGEST)


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
