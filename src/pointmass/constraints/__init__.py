"""What must hold at the end of each step: constraints that no force can keep."""

from collections.abc import Mapping

from pointmass.constraints.attachment import Attachment
from pointmass.constraints.constraint import Constraint, Step
from pointmass.constraints.self_contact import SelfContact
from pointmass.constraints.strain_limit import StrainLimit
from pointmass.constraints.surface_contact import SurfaceContact
from pointmass.constraints.tear import Tear

CONSTRAINTS: Mapping[str, type[Constraint]] = {
    "strain_limit": StrainLimit,
    "tear": Tear,
    "attachment": Attachment,
    "surface_contact": SurfaceContact,
    "self_contact": SelfContact,
}

__all__ = ["CONSTRAINTS", "Attachment", "Constraint", "SelfContact", "Step", "StrainLimit", "SurfaceContact", "Tear"]
