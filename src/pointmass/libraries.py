"""Libraries that only some kinds of files need."""

from __future__ import annotations

from importlib.util import find_spec

from pointmass.errors import InvalidInput

VTK, USD, GSD = ("vtkmodules", "vtk"), ("pxr", "usd-core"), ("gsd", "gsd")
NEEDED = {  # by the ending of a file: the module, and what to install for it
    **dict.fromkeys((".vtp", ".pvd", ".vtkhdf"), VTK),
    **dict.fromkeys((".usd", ".usda", ".usdc"), USD),
    ".gsd": GSD,
}


def check_library(doing: str, suffix: str) -> None:
    """Refuse a kind of file whose library is not there.

    Parameters
    ----------
    doing : "reading" or "writing".
    suffix : ending of the file, in small letters.

    Raises
    ------
    InvalidInput
        It is not installed.
    """
    if suffix in NEEDED and find_spec(NEEDED[suffix][0]) is None:
        raise InvalidInput(f"{doing} {suffix} needs {NEEDED[suffix][1]}: pip install 'pointmass[export]'")
