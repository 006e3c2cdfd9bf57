"""How the kernels of this package are compiled."""

# mypy: disable-error-code="no-untyped-call"

from pointmass.kernels_base import compiler, digest_of

kernel = compiler(digest_of("pointmass.self_contact"))
