"""The documentation is true: programs run and print what they say, scenes load, links lead somewhere.

A page's ```python blocks run in order as one program, in an empty folder. A block that begins with `# src/...` is a
quotation and must be found in that file. `# -> text` after a print is what it prints. A ```toml block is a scene; one
that begins with `# name.toml` is put into the folder as that file, and one that begins with `# fragment` is a part of a
scene.
"""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

import pointmass as pm

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
LARGEST = 150_000  # bytes of a picture
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)|<img[^>]+src=\"([^\"]+)\"")
FILE = re.compile(r"# ([\w-]+\.toml)\n")
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)


def blocks(page: Path, language: str) -> list[tuple[int, str]]:
    """Position and text of the page's blocks in a language."""
    text = page.read_text(encoding="utf-8")
    return [(m.start(2), m[2]) for m in FENCE.finditer(text) if m[1] == language]


def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def program(page: Path) -> str:
    """The page with everything blank that is not to be run, so that lines keep their numbers."""
    text = page.read_text(encoding="utf-8")
    lines = [""] * (text.count("\n") + 1)
    for start, block in blocks(page, "python"):
        if not block.startswith("# src/"):
            first = text.count("\n", 0, start)
            lines[first : first + block.count("\n")] = block.splitlines()
    return "\n".join(lines)


def anchors(page: Path) -> set[str]:
    """Names that headings get."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


@every_page
def test_programs_run_and_print_what_they_say(page: Path, tmp_path: Path) -> None:
    if not (source := program(page)).strip():
        return
    for _, block in blocks(page, "toml"):
        if name := FILE.match(block):
            (tmp_path / name[1]).write_text(block, encoding="utf-8")
    script = tmp_path / page.name
    script.write_text(source, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, page.name], cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
    )
    assert run.returncode == 0, run.stderr[-3000:]
    printed = iter(run.stdout.splitlines())
    for wanted in re.findall(r"# -> (.*)$", source, re.MULTILINE):
        assert wanted in printed, f"{page.name} does not print {wanted!r} in its place:\n{run.stdout}"


@every_page
def test_quotations_are_in_the_source(page: Path) -> None:
    for _, block in blocks(page, "python"):
        if not block.startswith("# src/"):
            continue
        first, _, quoted = block.partition("\n")
        source = textwrap.dedent((ROOT / first[2:].strip()).read_text(encoding="utf-8"))
        for part in quoted.split("\n\n"):  # a quotation may leave out what stands between its paragraphs
            lines = [line.strip() for line in part.strip().splitlines()]
            assert "\n".join(lines) in "\n".join(line.strip() for line in source.splitlines()), part


@every_page
def test_scene_files_load(page: Path) -> None:
    for _, block in blocks(page, "toml"):
        if block.startswith("# fragment"):
            tomllib.loads(block)
        elif name := FILE.match(block):
            assert f'Scene.load("{name[1]}"' in program(page), f"{page.name} has {name[1]} and does not load it"
        else:
            pm.Scene.from_toml(block).simulation()


@every_page
def test_links_lead_somewhere(page: Path) -> None:
    for found in LINK.finditer(prose(page)):
        target = found[1] or found[2]
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        assert other.exists(), f"{page.name} links to {target}, which does not exist"
        assert not anchor or anchor in anchors(other), f"{page.name} links to {target}, and there is no such heading"


def test_pictures_are_small_and_shown() -> None:
    shown = "".join(p.read_text(encoding="utf-8") for p in PAGES)
    for picture in sorted((ROOT / "docs" / "images").iterdir()):
        assert picture.stat().st_size < LARGEST, f"{picture.name} has {picture.stat().st_size} bytes"
        assert picture.name in shown, f"{picture.name} is on no page"


def test_every_picture_is_drawn_by_the_program() -> None:
    program = (ROOT / "docs" / "draw.py").read_text(encoding="utf-8")
    drawn = set(re.findall(r'(?:save|store|rain|scene_picture|page_picture)\(\s*"([\w-]+)', program))
    drawn |= {f"scene-{name}" for name in re.findall(r'shipped\("(\w+)', program)}
    assert drawn == {picture.stem for picture in (ROOT / "docs" / "images").iterdir()}
    assert drawn >= {f"scene-{name}" for name in pm.SCENES}
