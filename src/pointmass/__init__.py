"""pointmass: particle systems.

A particle system is a collection of point masses that obeys some physical laws. Forces are objects that add into
accumulators, a solver knows a system by four verbs, and a law of your own is a few lines of Python.
"""

from lazy_loader import attach_stub

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)  # imports a name of __init__.pyi on its first use
