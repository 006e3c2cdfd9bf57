"""Films are made in parts: a stopped one goes on, with the same bytes, and by any number of processes."""

import itertools
import os
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from render_scenes import FRONT, frame, square

from pointmass.errors import InvalidInput
from pointmass.frame import Camera, Points
from pointmass.lock import locked
from pointmass.render import Style, image, write
from pointmass.render import parts as made
from pointmass.render.fingerprint import Fingerprints
from pointmass.render.parts import PART, Shot

SIZE = (64, 48)
SETTINGS = {"fps": 24, "camera": FRONT, "size": SIZE}


def film(count, seed=5):
    random = np.random.default_rng(seed)
    return [frame(random.normal(0, 1, (20, 3)), Points(name="p", radius=0.2), number=k) for k in range(count)]


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(made, "PART", 4)


@pytest.fixture
def drawn(monkeypatch):
    """Numbers of the frames that were drawn."""
    numbers, picture = [], Shot.picture

    def noted(self, frame):
        numbers.append(frame.number)
        return picture(self, frame)

    monkeypatch.setattr(Shot, "picture", noted)
    return numbers


def stop_at(count):
    def progress(done):
        if done >= count:
            raise KeyboardInterrupt

    return progress


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.mov", "a.gif"])
def test_a_stopped_film_goes_on_and_has_the_same_bytes(tmp_path, drawn, name):
    frames = film(14)
    write(iter(frames), tmp_path / f"whole{name}", **SETTINGS)
    drawn.clear()
    with pytest.raises(KeyboardInterrupt):
        write(frames, tmp_path / name, **SETTINGS, progress=stop_at(10))
    assert names(tmp_path) == [f".{name}.part", f"whole{name}"]
    calls = []
    write(frames, tmp_path / name, **SETTINGS, progress=calls.append)
    assert drawn == [*range(10), *range(8, 14)]
    assert calls == [4, 8, *range(9, 15)]
    assert names(tmp_path) == [name, f"whole{name}"]
    assert (tmp_path / name).read_bytes() == (tmp_path / f"whole{name}").read_bytes()


@pytest.mark.parametrize("name", ["a.mp4", "a.webm"])
def test_films_of_small_pictures_have_the_same_bytes(tmp_path, name):
    frames = film(12)
    seen = set()
    for _ in range(30):
        write(iter(frames), tmp_path / name, **SETTINGS)
        seen.add((tmp_path / name).read_bytes())
    assert len(seen) == 1


def test_only_parts_whose_frames_or_look_have_changed_are_drawn_again(tmp_path, drawn):
    frames = film(12)
    with pytest.raises(KeyboardInterrupt):
        write(frames, tmp_path / "a.mp4", **SETTINGS, progress=stop_at(11))
    drawn.clear()
    frames[5] = film(12, seed=6)[5]
    with pytest.raises(KeyboardInterrupt):
        write(frames, tmp_path / "a.mp4", **SETTINGS, progress=stop_at(11))
    assert drawn == [4, 5, 6, 7, 8, 9, 10]
    drawn.clear()
    write(frames[:8], tmp_path / "a.mp4", **SETTINGS, style=Style(bloom=0.0))
    assert drawn == list(range(8))
    write(iter(frames[:8]), tmp_path / "b.mp4", **SETTINGS, style=Style(bloom=0.0))
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()
    assert names(tmp_path) == ["a.mp4", "b.mp4"]


def test_pictures_that_are_there_stay_unless_they_are_damaged_or_others(tmp_path, drawn):
    frames = film(10)
    for stop in (3, 6):
        with pytest.raises(KeyboardInterrupt):
            write(frames, tmp_path / "x_%02d.png", **SETTINGS, progress=stop_at(stop))
        assert len(names(tmp_path)) == stop
    assert drawn == list(range(6))
    cut = tmp_path / "x_01.png"
    whole = cut.read_bytes()
    cut.write_bytes(whole[:-20])
    (tmp_path / "x_02.png").write_bytes(whole)  # of another frame
    Image.open(tmp_path / "x_03.png").save(tmp_path / "x_03.png")  # somebody else's
    drawn.clear()
    write(frames, tmp_path / "x_%02d.png", **SETTINGS)
    assert drawn == [1, 2, 3, 6, 7, 8, 9]
    assert cut.read_bytes() == whole
    write(iter(frames), tmp_path / "y_%02d.png", **SETTINGS)
    assert all(
        (tmp_path / f"x_{k:02d}.png").read_bytes() == (tmp_path / f"y_{k:02d}.png").read_bytes() for k in range(10)
    )
    assert len(names(tmp_path)) == 20


@pytest.mark.parametrize("name", ["a.mp4", "x_%02d.png"])
def test_several_processes_make_the_same_bytes(tmp_path, monkeypatch, name):
    monkeypatch.undo()  # processes make parts as long as they are
    frames = film(PART + 10)
    folders = [tmp_path / str(processes) for processes in (1, 2)]
    for folder in folders:
        folder.mkdir()
        calls = []
        write(frames, folder / name, **SETTINGS, processes=int(folder.name), progress=calls.append)
        assert calls[-1] == len(frames)
    assert names(folders[0]) == names(folders[1])
    for file in names(folders[0]):
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "x_%02d.png"])
def test_frames_are_let_go(tmp_path, name):
    """A film of 24 frames takes no more memory than one of 6, beyond two frames."""
    n = 5_000
    places = np.random.default_rng(5).normal(0, 2, (n, 3))

    def run(count):
        for k in range(count):
            yield frame(places + 0.01 * k, Points(name="p", radius=0.005), number=k)

    def peak(count):
        (tmp_path / str(count)).mkdir()
        tracemalloc.start()
        write(run(count), tmp_path / str(count) / name, **SETTINGS)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    write(run(2), tmp_path / name, **SETTINGS)  # loads and compiles
    assert peak(24) < peak(6) + 2 * 2 * n * 3 * 8


def test_an_error_in_a_process_is_told(tmp_path):
    frames = film(9)
    frames[7] = replace(frames[7], drawables=(Points(name="p", index=np.array([99])),))
    with pytest.raises(InvalidInput, match="99"):
        write(frames, tmp_path / "a.mp4", **SETTINGS, processes=2)
    with pytest.raises(InvalidInput, match="processes = 0 is not allowed"):
        write(frames, tmp_path / "a.mp4", **SETTINGS, processes=0)


def test_one_process_writes_a_film(tmp_path):
    with (
        locked(tmp_path / "a.mp4"),
        pytest.raises(InvalidInput, match=f"a.mp4' is being written by process {os.getpid()}: wait"),
    ):
        write(film(1), tmp_path / "a.mp4", **SETTINGS)
    assert not names(tmp_path)


def test_fingerprints_tell_apart_what_looks_different():
    first = film(1)[0]
    points = first.drawables[0]
    others = [
        first,
        replace(first, time=1.0),
        replace(first, positions=first.positions + 1e-12),
        replace(first, quantities={"energy": 1.0}),
        replace(first, drawables=()),
        replace(first, drawables=(points, points)),
        replace(first, drawables=(replace(points, radius=0.3),)),
        replace(first, drawables=(replace(points, radius=np.float32(0.3)),)),
        replace(first, drawables=(replace(points, radius=np.full(20, 0.3)),)),
    ]
    shots = [
        Shot(camera=FRONT, size=SIZE, rate=24, style=Style()),
        Shot(camera=Camera(), size=SIZE, rate=24, style=Style()),
    ]
    seen = [shot.fingerprints().of(other) for shot in shots for other in others]
    assert len(set(seen)) == len(seen)
    prints = Fingerprints(1)
    assert prints.of(first) == prints.of(replace(first)) == Fingerprints(1).of(film(1)[0])


def test_a_transparent_picture_looks_over_black_as_it_does_without():
    ball = frame([[0, 0, 0], [0.8, 0.5, 0]], Points(name="b", radius=0.5), Points(name="g", radius=0.3, glow=True))
    style = Style(bottom=(0, 0, 0), top=(0, 0, 0))
    plain = image(ball, camera=FRONT, size=SIZE, style=style).astype(float)
    clear = image(ball, camera=FRONT, size=SIZE, style=Style(transparent=True)).astype(float)
    assert clear.shape == (48, 64, 4)
    assert np.abs(clear[..., :3] * clear[..., 3:] / 255 - plain).max() <= 1.5
    assert clear[0, 0, 3] == 0
    assert clear[24, 32, 3] == 255


def test_a_transparent_square_covers_as_much_as_its_alpha():
    veil = frame([[0, 0, 0]], square(9.0, 0.0, (0.5, 0.5, 0.5, 0.25)))
    clear = image(veil, camera=FRONT, size=SIZE, style=Style(transparent=True))
    assert abs(int(clear[24, 32, 3]) - 0.25 * 255) < 80  # no less than it is bright
    assert clear[24, 32, 3] >= 0.25 * 255 - 1


@pytest.mark.parametrize("suffix", [".webm", ".mov"])
def test_a_transparent_film_has_an_alpha(tmp_path, suffix):
    import av

    frames = [frame([[0, 0, 0]], Points(name="b", radius=0.5))] * 6
    write(frames, tmp_path / f"a{suffix}", **SETTINGS, style=Style(transparent=True))
    with av.open(str(tmp_path / f"a{suffix}")) as container:
        stream = container.streams.video[0]
        name = "libvpx-vp9" if suffix == ".webm" else stream.codec_context.name
        decoder = av.CodecContext.create(name, "r")
        decoder.extradata = stream.codec_context.extradata
        pictures = [picture for packet in container.demux(stream) for picture in decoder.decode(packet)]
    assert len(pictures) == 6
    alpha = pictures[-1].reformat(format="rgba").to_ndarray()[..., 3]
    assert alpha[0, 0] < 10
    assert alpha[24, 32] > 245
    for refused in (".mp4", ".gif"):
        with pytest.raises(InvalidInput, match="transparent = True is not allowed for"):
            write(frames, tmp_path / f"a{refused}", **SETTINGS, style=Style(transparent=True))


def test_a_shutter_smears_what_moves(tmp_path):
    still = frame([[0, 0, 0]], Points(name="b", radius=0.2))
    moving = replace(still, velocities=np.array([[3.0, 0, 0]]))
    pictures = [
        image(each, camera=FRONT, size=SIZE, style=Style(shutter=shutter))
        for each, shutter in itertools.product((still, moving), (None, 0.0, 0.2))
    ]
    assert all((picture == pictures[0]).all() for picture in pictures[1:5])
    lit = (pictures[5] != pictures[0]).any(axis=2)
    assert lit[24].sum() > 2 * lit[:, 32].sum()
    with pytest.raises(InvalidInput, match=r"style.shutter = -1 is not allowed"):
        Style(shutter=-1)
