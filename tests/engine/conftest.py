"""Engines whose kernels run as plain Python, so that every combination can be tried without compiling it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pointmass.engine import store


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "load", lambda *text: SimpleNamespace(**store.plain(*text)))


@pytest.fixture(scope="session", autouse=True)
def kernels(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A folder for kernels that every worker of the run shares, and nobody else."""
    import os

    os.environ.setdefault("POINTMASS_CACHE", str(tmp_path_factory.getbasetemp().parent / "pointmass"))
