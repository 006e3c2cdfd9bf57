"""How a system is advanced: by the reference path in NumPy, or by kernels printed from its laws and its solver."""

import os

# Threads that spin while they wait slow each other down where there are more of them than cores. The library of threads
# reads this when it is loaded, so it must stand here before anything else asks for one.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
