"""What all tests share."""

from __future__ import annotations

import os
from types import SimpleNamespace

import pytest
from hypothesis import settings

from pointmass.engine import store

# Most tests make small systems of many kinds: to compile each would take hours. Those of the engine ask for it.
os.environ.setdefault("POINTMASS_ENGINE", "reference")
# First, so that no worker is left with one of them at the end.
LONG = ("tests/engine/", "tests/contract/test_scenes.py", "tests/test_docs.py")
settings.register_profile("same examples each time", derandomize=True)  # so that a commit cannot fail by chance


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="also run the long counts: fuzz, soak, kill")


def pytest_configure(config: pytest.Config) -> None:
    if not config.getoption("--full"):
        settings.load_profile("same examples each time")
    # Kernels of all workers, and of the next run: what is there is never wrong. `--cache-clear` empties it.
    os.environ.setdefault("POINTMASS_CACHE", str(config.cache.mkdir("kernels")))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.nodeid.startswith(LONG))
    if not config.getoption("--full"):
        for item in items:
            if "full" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="needs --full"))


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels run as plain Python, so that every combination can be tried without compiling it."""
    monkeypatch.setattr(store, "load", lambda *text: SimpleNamespace(**store.plain(*text)))
