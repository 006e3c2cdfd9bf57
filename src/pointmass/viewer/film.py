"""Frames as one HTML file that plays anywhere: the page, its code and the frames, and no server."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from pointmass.beside import beside, check_place
from pointmass.cache import Cache
from pointmass.errors import InvalidInput, number, shown, whole_number
from pointmass.frame import Camera, Frame
from pointmass.simulation import Simulation
from pointmass.viewer.framing import Framing
from pointmass.viewer.messages import FilmHead, Timeline, Welcome, encode
from pointmass.viewer.pack import pack, versions
from pointmass.viewer.page import page_folder

CHUNK = 1 << 20  # bytes of frames that are compressed together, at least
LENGTH = 4  # bytes of the number before each frame
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; font-src data:"
CODE = re.compile(r'<script type="module"[^>]* src="\./([^"]+)"></script>')
STYLE = re.compile(r'<link rel="stylesheet"[^>]* href="\./([^"]+)">')


def to_html(
    source: Simulation | Cache | Iterable[Frame],
    path: str | Path,
    frames: int | None = None,
    fps: float | None = None,
    *,
    name: str | None = None,
    camera: Camera | None = None,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Write a film: one HTML file that any browser plays, also from a disk and without a network.

    It has the live page's camera, timeline, loop and slow motion. Positions are rounded to 1/65535 of the size of the
    cloud in each direction, as on the live page.

    Parameters
    ----------
    source : a simulation, which runs on from where it is; or a cache, or frames.
    path : of the file, which is written over.
    frames : how many; 240 of a simulation, and all that there are of the others by default.
    fps : frames per second of simulated time; those of the cache, or 60, by default.
    name : title of the page; that of the cache, or the name of the file, by default.
    camera : the cache's by default; what it leaves open is chosen to show the whole scene.
    progress : called with the number of frames written so far.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    InvalidInput
        There are no frames, the file cannot be written, or the page was not built.
    Diverged
        As for `Simulation.frames`; then no file is written.

    Examples
    --------
    >>> pm.to_html(sim, "swing.html", frames=240, fps=60)
    """
    path = Path(path)
    if frames is not None:
        frames = whole_number("frames", frames, at_least=1)
    if isinstance(source, Cache):
        fps, camera = fps or source.fps, camera or source.camera
        name = name or str(source.attributes.get("name", path.stem))
    rate = number("fps", 60.0 if fps is None else fps, above=0, unit="1/s")
    index, code, style = _page()
    check_place(path)
    with beside(path) as part, part.open("w", encoding="utf-8", newline="\n") as file:
        head, body = index.split("<body>")
        policy = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}" />'
        file.write(head.replace("<head>", f"<head>\n    {policy}", 1))
        file.write(f"<style>{style}</style>\n<body>{body.split('</body>')[0]}")
        framing, count = _write_frames(file, _frames(source, frames, rate), camera or Camera(), progress)
        told = _head(name or path.stem, rate, count, framing)
        file.write(f'<script type="application/json" id="film">{told}</script>\n')
        file.write(f'<script type="module">{code}</script>\n</body>\n</html>\n')
    return path


def _frames(source: Simulation | Cache | Iterable[Frame], count: int | None, fps: float) -> Iterator[Frame]:
    if isinstance(source, Simulation):
        yield from source.frames(count or 240, fps)
        return
    try:
        every = iter(source)
    except TypeError:
        raise InvalidInput(f"source must be a simulation, a cache or frames, not {shown(source)}") from None
    for k, frame in enumerate(every):
        if k == count:
            return
        if not isinstance(frame, Frame):
            raise InvalidInput(f"source must be a simulation, a cache or frames, and holds {shown(frame)}")
        yield frame


def _write_frames(
    file: TextIO, frames: Iterator[Frame], camera: Camera, progress: Callable[[int], None] | None
) -> tuple[Framing, int]:
    framing, known, chunk, count = Framing(camera), dict[str, int](), bytearray(), 0

    def flush() -> None:
        if chunk:
            text = base64.b64encode(gzip.compress(chunk, mtime=0)).decode("ascii")
            file.write(f'<script type="text/plain" class="frames">{text}</script>\n')
            chunk.clear()

    for frame in frames:
        data = pack(replace(frame, number=count), count + 1, known)
        known = versions(frame)
        framing.sees(frame)
        chunk += len(data).to_bytes(LENGTH, "little") + data
        if len(chunk) >= CHUNK:
            flush()
        count += 1
        if progress is not None:
            progress(count)
    flush()
    if not count:
        raise InvalidInput("there are no frames to record")
    return framing, count


def _head(name: str, fps: float, count: int, framing: Framing) -> str:
    """As JSON that may stand in a script."""
    welcome = Welcome(
        name=name,
        summary="a film",
        parameters=[],
        presets=[],
        fps=fps,
        grabs=False,
        frames=count,
        solver="",
        dt=0.0,
        solvers=[],
        switches=[],
        wind=None,
    )
    timeline = Timeline(
        frames=count, loop=False, first=0, last=count - 1, resumable=False, live=False, computing=-1, computed=0
    )
    return encode(FilmHead(welcome=welcome, view=framing.view, timeline=timeline)).replace("<", "\\u003c")


def _page() -> tuple[str, str, str]:
    """The page without its code and style, and those: so that nothing in them ends their element."""
    folder = page_folder()
    index = (folder / "index.html").read_text(encoding="utf-8")
    codes, styles = CODE.findall(index), STYLE.findall(index)
    code = "\n".join((folder / name).read_text(encoding="utf-8") for name in codes)
    style = "\n".join((folder / name).read_text(encoding="utf-8") for name in styles)
    code = re.sub(r"<(?=/script|script|!--)", r"\\x3c", code, flags=re.IGNORECASE)
    style = re.sub(r"<(?=/style)", r"\\3c ", style, flags=re.IGNORECASE)
    return STYLE.sub("", CODE.sub("", index)), code, style
