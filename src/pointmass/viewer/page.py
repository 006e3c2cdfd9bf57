"""Where the page is that was built from the repository's folder `viewer`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pointmass.errors import InvalidInput

if TYPE_CHECKING:
    from pointmass.viewer.server import Server


def server_type() -> type[Server]:
    """What serves the page.

    Raises
    ------
    InvalidInput
        The extra `view` is not installed.
    """
    try:
        from pointmass.viewer.server import Server
    except ModuleNotFoundError as error:
        raise InvalidInput(f"the live page needs {error.name}: pip install 'pointmass[view]'") from None
    return Server


def page_folder() -> Path:
    """The folder with the page: in an installed package beside this file, in a checkout where npm builds it.

    Raises
    ------
    InvalidInput
        It was not built.
    """
    installed = Path(__file__).parent / "page"
    checkout = Path(__file__).parents[3] / "viewer" / "dist"
    for folder in (installed, checkout):
        if (folder / "index.html").is_file():
            return folder
    raise InvalidInput(
        "the live page was not built, because there was no Node.js when pointmass was installed: install Node.js 20 or "
        "newer and pointmass again, or in a checkout run `npm install && npm run build` in its folder viewer"
    )
