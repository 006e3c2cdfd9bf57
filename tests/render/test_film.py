from dataclasses import replace
from fractions import Fraction

import av
import numpy as np
import pytest
from PIL import Image
from render_scenes import FRONT, everything, frame, square

from pointmass.errors import InvalidInput
from pointmass.frame import Points
from pointmass.render import SUFFIXES, Style, check_write, image, write

SIZE = (64, 48)


def film(count):
    random = np.random.default_rng(5)
    for number in range(count):
        yield frame(random.normal(0, 1, (20, 3)), Points(name="p", radius=0.2), number=number)


def decoded(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        pictures = [picture.to_ndarray(format="rgb24") for picture in container.decode(stream)]
        return stream, pictures


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".mov"])
def test_video_comes_back(tmp_path, suffix):
    path = tmp_path / f"film{suffix}"
    calls = []
    write(film(11), path, fps=24, camera=FRONT, size=(66, 48), progress=calls.append)
    stream, pictures = decoded(path)
    assert len(pictures) == 11
    assert calls == list(range(1, 12))
    assert pictures[0].shape == (48, 66, 3)
    assert stream.average_rate == 24
    assert stream.codec_context.colorspace == 1
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("color", [(0.9, 0.02, 0.02), (0.02, 0.7, 0.05), (0.03, 0.05, 0.9)])
def test_saturated_colours_survive_the_video(tmp_path, color):
    scene = frame([[0, 0, 0]], square(9.0, 0.0, (*color, 1.0)))
    style = Style(bloom=0.0, pool=0.0)
    drawn = image(scene, camera=FRONT, size=SIZE, style=style)[24, 32].astype(int)
    path = tmp_path / "film.mp4"
    write([scene] * 3, path, camera=FRONT, size=SIZE, style=style)
    with av.open(str(path)) as container:
        picture = next(container.decode(video=0)).reformat(
            format="rgb24", src_colorspace="ITU709", src_color_range="MPEG", dst_color_range="JPEG"
        )
    assert np.abs(picture.to_ndarray()[24, 32].astype(int) - drawn).max() <= 8


def test_gif_comes_back(tmp_path):
    path = tmp_path / "film.gif"
    write(film(9), path, fps=25, camera=FRONT, size=SIZE)
    with Image.open(path) as picture:
        assert picture.n_frames == 9
        assert picture.size == SIZE
        assert picture.info["duration"] == 40


def test_fast_gif_keeps_its_length(tmp_path):
    path = tmp_path / "film.gif"
    write(film(30), path, fps=100, camera=FRONT, size=SIZE)
    with Image.open(path) as picture:
        assert picture.n_frames == 15


def test_png_holds_the_last_frame(tmp_path):
    frames = list(film(3))
    write(frames, tmp_path / "still.png", camera=FRONT, size=SIZE)
    with Image.open(tmp_path / "still.png") as picture:
        assert (np.array(picture) == image(frames[-1], camera=FRONT, size=SIZE)).all()


def test_png_sequence_is_numbered_by_frame(tmp_path):
    frames = [replace(f, number=10 * f.number) for f in film(3)]
    write(frames, tmp_path / "x_%04d.png", camera=FRONT, size=SIZE)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x_0000.png", "x_0010.png", "x_0020.png"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.png", "a.webm", "a.mov"])
def test_a_film_that_fails_leaves_nothing(tmp_path, error, name):
    def broken():
        yield from film(2)
        raise error

    (tmp_path / "a.mp4").write_text("old")
    with pytest.raises(error):
        write(broken(), tmp_path / name, camera=FRONT, size=SIZE)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_text() == "old"


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.avi", {}, "did you mean|known are"),
        ("a", {}, "known are"),
        ("nowhere/a.mp4", {}, "no folder"),
        ("a.mp4", {"size": (0, 4)}, "size"),
        ("a.mp4", {"size": (10**6, 4)}, "size"),
        ("a.mp4", {"fps": 0}, "fps"),
        ("a.mp4", {"fps": float("nan")}, "fps"),
        ("a.mp4", {"fps": 1e9}, "fps"),
        ("a.mp4", {"fps": "fast"}, "fps"),
        ("a.mp4", {"fps": 1e-4}, "from 0.001 to 1000"),
        ("a.mp4", {"size": (65, 48)}, "even"),
        ("a.webm", {"size": (64, 47)}, "even"),
        ("a_%s.png", {}, "one number"),
        ("a_%d_%d.png", {}, "one number"),
        ("a_%4d.png", {}, "one number"),
        ("a_%s_%s.png", {}, "one number"),
        ("a_%%.png", {}, "one number"),
        ("%.png", {}, "one number"),
        ("a" * 300 + ".mp4", {}, "name"),
    ],
)
def test_one_clear_sentence_and_nothing_written(tmp_path, name, options, words):
    options = {"fps": 60, "size": SIZE, **options}
    for attempt in (
        lambda: check_write(tmp_path / name, **options),
        lambda: write(film(2), tmp_path / name, camera=FRONT, **options),
    ):
        with pytest.raises(InvalidInput, match=words) as caught:
            attempt()
        assert "\n" not in str(caught.value)
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "size"), [("a.mp4", (2, 2)), ("a.webm", (2, 2)), ("a.gif", (1, 1)), ("a.png", (1, 1)), ("a.MP4", (4, 2))]
)
def test_what_is_accepted_can_be_written(tmp_path, name, size):
    for fps in (0.001, 1000):
        check_write(tmp_path / name, fps=fps, size=size)
        assert not list(tmp_path.iterdir())
        write(film(2), tmp_path / name, fps=fps, camera=FRONT, size=size)
        (tmp_path / name).unlink()


@pytest.mark.parametrize("suffix", sorted(SUFFIXES))
def test_no_frames(tmp_path, suffix):
    for frames in ([], iter([])):
        with pytest.raises(InvalidInput, match="no frames"):
            write(frames, tmp_path / f"a{suffix}", size=SIZE)
    assert not list(tmp_path.iterdir())


def test_a_folder_is_not_a_film(tmp_path):
    (tmp_path / "a.mp4").mkdir()
    with pytest.raises(InvalidInput, match="folder"):
        write(film(1), tmp_path / "a.mp4", size=SIZE)


@pytest.mark.parametrize("fps", [29.97, 23.976, 0.5, Fraction(30000, 1001), 60])
def test_rates_that_are_no_whole_numbers(tmp_path, fps):
    write(film(3), tmp_path / "a.mp4", fps=fps, camera=FRONT, size=SIZE)
    stream, pictures = decoded(tmp_path / "a.mp4")
    assert len(pictures) == 3
    assert float(stream.average_rate) == pytest.approx(float(fps), rel=1e-3)


def test_frames_are_taken_one_at_a_time(tmp_path):
    drawn = []
    taken = []

    def frames():
        for f in film(4):
            taken.append(f.number)
            assert len(drawn) == f.number
            yield f

    write(frames(), tmp_path / "a.mp4", size=SIZE, progress=drawn.append)
    assert taken == [0, 1, 2, 3]


def test_list_of_frames_is_seen_whole(tmp_path):
    frames = [everything(seed=1), everything(seed=2)]
    write(frames, tmp_path / "a.png", size=SIZE)
    assert (tmp_path / "a.png").exists()
