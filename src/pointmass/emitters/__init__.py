"""Where particles come from."""

from pointmass.emitters.box import BoxEmitter
from pointmass.emitters.chance import Normal, Spread
from pointmass.emitters.emitter import Birth, Emitter, Parents
from pointmass.emitters.line import LineEmitter
from pointmass.emitters.mesh import MeshEmitter
from pointmass.emitters.nozzle import Nozzle
from pointmass.emitters.point import PointEmitter
from pointmass.emitters.shaped import ShapedEmitter
from pointmass.emitters.sphere import SphereEmitter

EMITTERS: dict[str, type[Emitter]] = {
    "point": PointEmitter,
    "line": LineEmitter,
    "nozzle": Nozzle,
    "sphere": SphereEmitter,
    "box": BoxEmitter,
    "mesh": MeshEmitter,
}

__all__ = [
    "EMITTERS",
    "Birth",
    "BoxEmitter",
    "Emitter",
    "LineEmitter",
    "MeshEmitter",
    "Normal",
    "Nozzle",
    "Parents",
    "PointEmitter",
    "ShapedEmitter",
    "SphereEmitter",
    "Spread",
]
