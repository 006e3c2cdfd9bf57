"""Where the kernels of these tests are kept."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session", autouse=True)
def kernels(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A folder for kernels that every worker of the run shares, and nobody else."""
    import os

    os.environ.setdefault("POINTMASS_CACHE", str(tmp_path_factory.getbasetemp().parent / "pointmass"))
