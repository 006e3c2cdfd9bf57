"""Builds the live page with npm while the package is built, if Node.js is there, and puts it into the wheel."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

INSTALL = ["install", "--no-package-lock", "--no-audit", "--no-fund"]


class PageHook(BuildHookInterface):  # type: ignore[type-arg]
    """An editable install leaves the page where npm builds it, in viewer/dist: `view` looks there, too."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page, and say so if that cannot be done: everything but `pointmass view` works without it."""
        if self.target_name != "wheel":
            return
        folder = Path(self.root) / "viewer"
        npm = shutil.which("npm")
        if npm is None:
            self.app.display_warning("there is no npm: pointmass view will have no page")
            return
        for step in (INSTALL, ["run", "build"]):
            done = subprocess.run([npm, *step], cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                self.app.display_warning(
                    f"npm {step[0]} failed: pointmass view will have no page\n{done.stderr[-2000:]}"
                )
                return
        if version != "editable":
            build_data["force_include"][str(folder / "dist")] = "pointmass/viewer/page"
