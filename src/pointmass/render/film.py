"""Frames into films: MP4, WebM, GIF, PNG. Streams; a film that fails leaves nothing behind."""

from __future__ import annotations

import errno
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, unknown
from pointmass.frame import Camera, Frame
from pointmass.render.camera import fit_camera
from pointmass.render.image import checked_size, image
from pointmass.render.style import Style
from pointmass.sequences import is_sequence

Picture = NDArray[np.uint8]

BT709 = 1  # FFmpeg's number for the colours of HD video
LIMITED = 1  # luma from 16 to 235
GIF_TICKS = 100  # a GIF counts time in hundredths of a second
SLOWEST, FASTEST = 0.001, 1000  # frames per second
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # no room for a film


class Writer(Protocol):
    """Takes one picture after another; `path` is complete only after `close`."""

    def add(self, picture: Picture, number: int) -> None:
        """One more picture; `number` is its frame's."""

    def close(self) -> None:
        """All pictures are there: finish the file."""

    def abort(self) -> None:
        """Give up: release the file without finishing it."""


class Video:
    """A video file, encoded while the pictures come."""

    def __init__(self, path: Path, size: tuple[int, int], fps: Fraction, codec: str, options: dict[str, str]) -> None:
        import av

        container_options = {"movflags": "+faststart"} if path.suffix.lower() == ".mp4" else {}
        container: Any = av.open(str(path), "w", options=container_options)
        self._container = container
        self._stream: Any = container.add_stream(codec, rate=fps, options=options)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        # Without these tags players guess, and guess wrong by up to 40 of 255.
        context = self._stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = BT709
        context.color_range = LIMITED
        self._count = 0

    def add(self, picture: Picture, number: int) -> None:
        """Encode one picture."""
        import av

        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
        frame.pts = self._count
        frame.time_base = 1 / self._stream.codec_context.framerate
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Encode what is still held back and finish the file."""
        self._container.mux(self._stream.encode())
        self._container.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self._container.close()


class Gif:
    """A GIF whose palette is made from the whole film; it holds all pictures until the end."""

    def __init__(self, path: Path, size: tuple[int, int], fps: Fraction) -> None:
        self._path, self._size, self._fps = path, size, min(fps, Fraction(GIF_TICKS, 2))
        self._wanted = fps
        self._graph: Any = None
        self._count = 0
        self._start()

    def _start(self) -> None:
        from av.filter import Graph

        graph: Any = Graph()
        width, height = self._size
        source = graph.add_buffer(width=width, height=height, format="rgb24", time_base=1 / self._fps)
        split, palette = graph.add("split"), graph.add("palettegen", "stats_mode=diff")
        use, sink = graph.add("paletteuse", "dither=bayer:bayer_scale=3"), graph.add("buffersink")
        source.link_to(split)
        split.link_to(palette, 0, 0)
        split.link_to(use, 1, 0)
        palette.link_to(use, 0, 1)
        use.link_to(sink)
        graph.configure()
        self._graph = graph
        self._seen = 0

    def add(self, picture: Picture, number: int) -> None:
        """Hand one picture to the palette; players show at most 50 a second, what is faster is left out."""
        import av

        keep = int(self._seen * self._fps / self._wanted) == self._count
        self._seen += 1
        if not keep:
            return
        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self._count, 1 / self._fps
        self._count += 1
        self._graph.push(frame)

    def close(self) -> None:
        """Choose the palette and encode."""
        import av

        self._graph.push(None)
        container: Any = av.open(str(self._path), "w", format="gif")
        with container:
            stream: Any = container.add_stream("gif", rate=self._fps)
            stream.width, stream.height = self._size
            stream.pix_fmt = "pal8"
            for _ in range(self._count):
                frame = self._graph.pull()
                frame.time_base = 1 / self._fps
                container.mux(stream.encode(frame))
            container.mux(stream.encode())

    def abort(self) -> None:
        """Forget the pictures."""
        self._graph = None


class Stills:
    """PNG files: the last picture, or all of them when the name holds a pattern such as %04d."""

    def __init__(self, path: Path, size: tuple[int, int], fps: Fraction) -> None:
        self._path, self._sequence = path, not is_single(path)
        self._last: Picture | None = None

    def add(self, picture: Picture, number: int) -> None:
        """Write the picture of a sequence, or keep it in case it is the last."""
        if self._sequence:
            _save(picture, self._path.with_name(self._path.name % number))
        self._last = picture

    def close(self) -> None:
        """Write the last picture."""
        if not self._sequence and self._last is not None:
            _save(self._last, self._path)

    def abort(self) -> None:
        """Nothing is open."""


def _save(picture: Picture, path: Path) -> None:
    from PIL import Image

    Image.fromarray(picture).save(path, format="PNG", compress_level=6)


def _mp4(path: Path, size: tuple[int, int], fps: Fraction) -> Writer:
    return Video(path, size, fps, "libx264", {"preset": "veryfast", "crf": "18"})


def _webm(path: Path, size: tuple[int, int], fps: Fraction) -> Writer:
    options = {"crf": "24", "b": "0", "deadline": "realtime", "cpu-used": "6", "row-mt": "1"}
    return Video(path, size, fps, "libvpx-vp9", options)


Maker = Callable[[Path, tuple[int, int], Fraction], Writer]
WRITERS: dict[str, Maker] = {".gif": Gif, ".mp4": _mp4, ".png": Stills, ".webm": _webm}
EVEN = (".mp4", ".webm")  # colours are stored for two by two pixels


def is_single(path: Path) -> bool:
    """Whether a file of this name is one picture, not a film nor a sequence."""
    return path.suffix.lower() == ".png" and "%" not in path.name


def check_write(
    path: str | Path, *, fps: float | Fraction = 60, size: tuple[int, int] = (1280, 720)
) -> tuple[Maker, Fraction, tuple[int, int]]:
    """What makes the writer for this name, and the checked rate and size: all that `write` refuses, before any work.

    Raises
    ------
    InvalidInput : as for `write`.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in WRITERS:
        raise unknown("kind of picture or film", target.suffix, WRITERS)
    if suffix == ".png":
        is_sequence(target)
    width, height = size = checked_size(size)
    if suffix in EVEN and (width % 2 or height % 2):
        near = f"{width + width % 2}x{height + height % 2}"
        raise InvalidInput(f"size = {width}x{height} is not allowed: {suffix} needs even numbers, such as {near}")
    rate = _rate(fps)
    _check_place(target)
    return WRITERS[suffix], rate, size


def _check_place(target: Path) -> None:
    """Refuse a place where no file of this name can appear, by making one in a folder that goes at once."""
    if not target.parent.is_dir():
        raise InvalidInput(f"cannot write {str(target)!r}: there is no folder {str(target.parent)!r}")
    try:
        folder = tempfile.TemporaryDirectory(prefix=_hidden(target), dir=target.parent)
    except OSError as error:
        raise InvalidInput(f"cannot write into folder {str(target.parent)!r}: {error.strerror}") from None
    with folder:
        try:
            (Path(folder.name) / target.name).touch()
        except OSError as error:
            raise InvalidInput(f"cannot write a file of the name {target.name!r}: {error.strerror}") from None
    if target.is_dir():
        raise InvalidInput(f"cannot write {str(target)!r}: it is a folder")


def write(
    frames: Iterable[Frame],
    path: str | Path,
    *,
    fps: float | Fraction = 60,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
    style: Style | None = None,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Draw frames and write them to a file; its suffix says which kind.

    Parameters
    ----------
    frames : read once, one at a time.
    path : `.mp4`, `.webm`, `.gif`, or `.png`: the last frame, or a numbered sequence for a name such as `x_%04d.png`.
    fps : pictures per second, from 0.001 to 1000.
    camera : what it leaves open is chosen to show all frames when they are a list, else the first one.
    size : width and height [pixels], even for `.mp4` and `.webm`.
    style : the look.
    progress : called with the number of frames drawn so far, after each.

    Raises
    ------
    InvalidInput : the suffix is not known, the folder cannot be written, there are no frames, or the size or the rate
        is out of range. Nothing is written then, nor when the frames or an interrupt raise.
    """
    make, rate, size = check_write(path, fps=fps, size=size)
    target = Path(path)
    if isinstance(frames, Sequence):
        camera = fit_camera(frames, camera, size) if len(frames) else camera
    folder = Path(tempfile.mkdtemp(prefix=_hidden(target), dir=target.parent))
    try:
        _draw(frames, make(folder / target.name, size, rate), camera, size, style, progress)
        for made in sorted(folder.iterdir()):
            made.replace(target.parent / made.name)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise InvalidInput(f"cannot write {str(target)!r}: {error.strerror}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _draw(
    frames: Iterable[Frame],
    writer: Writer,
    camera: Camera | None,
    size: tuple[int, int],
    style: Style | None,
    progress: Callable[[int], None] | None,
) -> None:
    """Every frame to the writer, which encodes one picture while the next is drawn.

    On any exception, an interrupt too, the writer gives up.
    """
    count = 0
    encoded: Future[None] | None = None
    with ThreadPoolExecutor(1) as encoder:
        try:
            for frame in frames:
                if count == 0:
                    camera = fit_camera([frame], camera, size)
                picture = image(frame, camera=camera, size=size, style=style)
                if encoded is not None:
                    encoded.result()
                encoded = encoder.submit(writer.add, picture, frame.number)
                count += 1
                if progress is not None:
                    progress(count)
            if encoded is None:
                raise InvalidInput("there are no frames to write")
            encoded.result()
        except BaseException:
            encoder.shutdown()  # a picture that is being encoded needs the file
            writer.abort()
            raise
    writer.close()


def _rate(fps: float | Fraction) -> Fraction:
    """Frames per second as a fraction with a small denominator: 29.97 becomes 30000/1001 or near it."""
    try:
        valid = SLOWEST <= fps <= FASTEST
    except TypeError:
        valid = False
    if not valid:
        raise InvalidInput(f"fps = {fps} is not allowed: it must be from {SLOWEST} to {FASTEST}")
    return Fraction(fps).limit_denominator(1001)


def _hidden(target: Path) -> str:
    """How the name of a folder for unfinished files begins."""
    return f".{target.stem[:32].replace('%', '_')}-"
