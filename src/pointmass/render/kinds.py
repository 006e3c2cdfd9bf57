"""Kinds of films. One is encoded in parts, each a file of its own, which are joined: so a part is done once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Size = tuple[int, int]

BT709 = 1  # FFmpeg's number for the colours of HD video
LIMITED = 1  # luma from 16 to 235
GIF_TICKS = 100  # a GIF counts time in hundredths of a second
EXACT = {"fflags": "+bitexact"}  # no random numbers in files: the same pictures give the same bytes


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of film.

    Attributes
    ----------
    join : writes the film: its parts in order, its path, its kind, its rate, and whether it has an alpha.
    part : ending of the file of a part.
    codec, pixels, options : of the encoder of parts, as FFmpeg names them.
    alpha : its kind of pixels with an alpha; "" = it has none.
    even : whether width and height must be even numbers, because colours are stored for two by two pixels.
    """

    join: Callable[[Sequence[Path], Path, Kind, Fraction, bool], None]
    part: str
    codec: str
    pixels: str
    options: dict[str, str] = field(default_factory=dict)
    alpha: str = ""
    even: bool = False


class Encoder:
    """Encodes pictures into the file of a part while they come."""

    def __init__(self, path: Path, kind: Kind, size: Size, rate: Fraction, transparent: bool) -> None:
        self._container, self._stream = _opened(path, kind.codec, rate, kind.options)
        self._stream.width, self._stream.height = size
        self._pixels = kind.alpha if transparent else kind.pixels
        self._stream.pix_fmt = self._pixels
        self._rgb = self._pixels.startswith("bgr")
        context = self._stream.codec_context
        context.thread_count = 1  # what comes out depends on it, and drawing takes longer
        if not self._rgb:  # without these tags players guess, and guess wrong by up to 40 of 255
            context.colorspace = context.color_primaries = context.color_trc = BT709
            context.color_range = LIMITED
        self._count = 0

    def add(self, picture: Picture) -> None:
        """One picture more: sRGB bytes, shape (height, width, 3), or with an alpha, (height, width, 4)."""
        import av

        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgba" if picture.shape[2] == 4 else "rgb24")
        colors = {} if self._rgb else {"dst_colorspace": "ITU709", "dst_color_range": "MPEG"}
        frame = frame.reformat(format=self._pixels, **colors)
        frame.pts, frame.time_base = self._count, 1 / self._stream.codec_context.framerate
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Encode what is still held back and finish the file."""
        self._container.mux(self._stream.encode())
        self._container.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self._container.close()


def _opened(path: Path, codec: str, rate: Fraction, options: dict[str, str]) -> tuple[Any, Any]:
    """A new file and its only stream."""
    container = _new(path)
    return container, container.add_stream(codec, rate=rate, options=options)


def _new(path: Path) -> Any:
    """A new file, without streams."""
    import av

    begun = {"movflags": "+faststart"} if path.suffix.lower() in (".mp4", ".mov") else {}
    return av.open(str(path), "w", options=EXACT | begun)


def _join_videos(parts: Sequence[Path], path: Path, kind: Kind, rate: Fraction, transparent: bool) -> None:
    """One video of several, as they are encoded."""
    import av

    with _new(path) as film:
        stream: Any = None
        first = 0
        for part in parts:
            with av.open(str(part)) as source:
                given: Any = source.streams.video[0]
                if stream is None:
                    stream = film.add_stream_from_template(given)
                    stream.time_base = 1 / rate
                    if transparent and path.suffix.lower() == ".webm":
                        stream.metadata["alpha_mode"] = "1"  # of players; others show what lies under the alpha
                first += _move(source.demux(given), film, stream, first, rate)


def _move(packets: Iterable[Any], film: Any, stream: Any, first: int, rate: Fraction) -> int:
    """Put the packets of a part into a film, where it has `first` pictures; returns how many the part has."""
    count = 0
    for packet in packets:
        if packet.pts is None:  # the end
            continue
        scale = packet.time_base * rate
        packet.pts, packet.dts = (first + round(time * scale) for time in (packet.pts, packet.dts))
        packet.time_base, packet.duration = 1 / rate, 1
        packet.stream = stream
        film.mux(packet)
        count += 1
    return count


def _join_gif(parts: Sequence[Path], path: Path, kind: Kind, rate: Fraction, transparent: bool) -> None:
    """A GIF whose palette is made from the whole film, which is read twice and never held."""
    shown = min(rate, Fraction(GIF_TICKS, 2))  # players show at most 50 pictures a second: what is faster is left out

    def pictures() -> Iterator[Any]:
        count = 0
        for k, frame in enumerate(_decoded(parts)):
            if int(k * shown / rate) == count:
                frame.pts, frame.time_base = count, 1 / shown
                count += 1
                yield frame

    first = next(pictures())
    colors = _palette(pictures(), first, shown)
    container, stream = _opened(path, "gif", shown, {})
    with container:
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, "pal8"
        for frame in _with_palette(pictures(), colors, first, shown):
            frame.time_base = 1 / shown
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _decoded(parts: Sequence[Path]) -> Iterator[Any]:
    import av

    for part in parts:
        with av.open(str(part)) as source:
            yield from source.decode(video=0)


def _palette(frames: Iterable[Any], first: Any, rate: Fraction) -> Any:
    """The picture of 256 colours with which frames look best."""
    from av.filter import Graph

    graph: Any = Graph()
    graph.link_nodes(
        graph.add_buffer(width=first.width, height=first.height, format=first.format.name, time_base=1 / rate),
        graph.add("palettegen", "stats_mode=diff"),
        graph.add("buffersink"),
    ).configure()
    for frame in frames:
        graph.push(frame)
    graph.push(None)
    return graph.pull()


def _with_palette(frames: Iterable[Any], colors: Any, first: Any, rate: Fraction) -> Iterator[Any]:
    """Frames in the colours of a palette."""
    from av.filter import Graph

    graph: Any = Graph()
    width, height = first.width, first.height
    source = graph.add_buffer(width=width, height=height, format=first.format.name, time_base=1 / rate)
    palette = graph.add_buffer(width=16, height=16, format=colors.format.name, time_base=1 / rate)
    use, sink = graph.add("paletteuse", "dither=bayer:bayer_scale=3"), graph.add("buffersink")
    source.link_to(use, 0, 0)
    palette.link_to(use, 0, 1)
    use.link_to(sink)
    graph.configure()
    palette.push(colors)
    palette.push(None)
    for frame in frames:
        source.push(frame)
        yield from _ready(graph)
    source.push(None)
    yield from _ready(graph)


def _ready(graph: Any) -> Iterator[Any]:
    """Frames that a filter has done."""
    import av

    while True:
        try:
            yield graph.pull()
        except (av.BlockingIOError, av.EOFError):  # it waits for more, or there is no more
            return


KINDS: dict[str, Kind] = {
    ".gif": Kind(join=_join_gif, part=".mkv", codec="ffv1", pixels="bgr0"),  # parts without loss
    ".mov": Kind(
        join=_join_videos,
        part=".mov",
        codec="prores_ks",
        pixels="yuv444p10le",
        alpha="yuva444p10le",
        options={"profile": "4444"},
    ),
    ".mp4": Kind(
        join=_join_videos,
        part=".mp4",
        codec="libx264",
        pixels="yuv420p",
        options={"preset": "veryfast", "crf": "18", "mbtree": "0"},  # with it small pictures are not always the same
        even=True,
    ),
    ".webm": Kind(
        join=_join_videos,
        part=".webm",
        codec="libvpx-vp9",
        pixels="yuv420p",
        alpha="yuva420p",
        options={"crf": "24", "b": "0", "deadline": "realtime", "cpu-used": "6"},
        even=True,
    ),
}
