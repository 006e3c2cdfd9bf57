"""The page as it was built: small, and of its own code alone."""

from __future__ import annotations

import gzip
import re

import pytest

from pointmass.errors import InvalidInput
from pointmass.viewer import film
from pointmass.viewer.page import page_folder

LARGEST = 300_000  # bytes of its JavaScript, compressed


@pytest.fixture
def built():
    try:
        return page_folder()
    except InvalidInput as error:
        pytest.skip(str(error))


def test_its_code_is_small(built):
    sizes = [len(gzip.compress(file.read_bytes())) for file in (built / "assets").glob("*.js")]
    assert 0 < sum(sizes) < LARGEST


def test_it_fetches_nothing_from_elsewhere(built):
    index = (built / "index.html").read_text(encoding="utf-8")
    assert all(where.startswith(("./", "data:")) for where in re.findall(r'(?:src|href)="([^"]*)"', index))
    for file in (built / "assets").glob("*.css"):
        assert "//" not in re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"))


def test_it_fits_into_one_file(built):
    """As films need it: one script, which nothing in it ends."""
    index, code, style = film._page()
    assert len(film.CODE.findall((built / "index.html").read_text(encoding="utf-8"))) == 1
    assert "<script" not in index
    assert code
    assert style
    for text, end in ((code, "</script"), (code, "<!--"), (style, "</style")):
        assert end not in text.lower()
    assert not re.search(r"^\s*(import|export)\b", code, re.MULTILINE)
