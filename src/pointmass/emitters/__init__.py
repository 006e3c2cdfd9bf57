"""Where particles come from."""

from pointmass.emitters.emitter import Birth, Emitter
from pointmass.emitters.nozzle import Nozzle

EMITTERS: dict[str, type[Emitter]] = {"nozzle": Nozzle}

__all__ = ["EMITTERS", "Birth", "Emitter", "Nozzle"]
