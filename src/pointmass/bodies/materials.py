"""What cloth is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pointmass.errors import number, unknown


@dataclass(frozen=True)
class Material:
    """A thin sheet.

    Attributes
    ----------
    density : mass of an area [kg/m^2].
    stretch : tension along the threads for each unit of strain [N/m], that is N/m of width.
    shear : likewise of a shear strain [N/m].
    bend : bending stiffness B [N m]: moment [N m/m] for each unit of curvature [1/m].
    damping_ratio : of one spring between two of the masses, 1 = critical.
    """

    density: float
    stretch: float
    shear: float
    bend: float
    damping_ratio: float


# Densities are those of goods that are sold. Shear and bending stiffness are a choice within what is measured by
# Kawabata's evaluation system (Kawabata, The Standardization and Analysis of Hand Evaluation, 1980): a shear stiffness
# of 1 gf/(cm degree) is 56 N/m, a bending stiffness of 1 gf cm^2/cm is 1e-4 N m. Woven cloth hardly stretches along
# its threads (some 1e4 N/m); a tenth of that stretches by less than 1% under its weight, at a third of the work.
# Rubber is a sheet of h = 0.5 mm with a Young's modulus E = 1.5 MPa and 950 kg/m^3: stretch E h, shear E h/3 and
# bend E h^3/9, for a Poisson's ratio of a half.
MATERIALS = {
    "cotton": Material(density=0.15, stretch=800.0, shear=60.0, bend=1e-5, damping_ratio=0.05),
    "silk": Material(density=0.06, stretch=400.0, shear=15.0, bend=2e-6, damping_ratio=0.03),
    "denim": Material(density=0.4, stretch=2000.0, shear=200.0, bend=1e-4, damping_ratio=0.08),
    "leather": Material(density=0.8, stretch=4000.0, shear=1000.0, bend=1e-3, damping_ratio=0.15),
    "rubber": Material(density=0.475, stretch=750.0, shear=250.0, bend=2e-5, damping_ratio=0.02),
}


def made_of(name: Any, **given: float | None) -> Material:
    """A material by its name, with other values for what is given."""
    if not isinstance(name, str) or name not in MATERIALS:
        raise unknown("material", name, MATERIALS)
    values = {key: value for key, value in given.items() if value is not None}
    own = {key: getattr(MATERIALS[name], key) for key in MATERIALS[name].__dict__} | values
    return Material(
        density=number("density", own["density"], above=0, unit="kg/m^2"),
        stretch=number("stretch", own["stretch"], above=0, unit="N/m"),
        shear=number("shear", own["shear"], at_least=0, unit="N/m"),
        bend=number("bend", own["bend"], at_least=0, unit="N m"),
        damping_ratio=number("damping_ratio", own["damping_ratio"], at_least=0),
    )
