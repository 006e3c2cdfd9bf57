"""The picture of stability: dots where the eigenvalues are, the region of the solver, springs in their colours."""

from pathlib import Path

import av
import numpy as np
import pytest
from click.testing import CliRunner

from pointmass.cli import main
from pointmass.stability_picture import ALARM, BAR, CALM, PANEL, PLOT, SCENE, Plane

TWO = """
solver = "leapfrog"
dt = {dt}
[[bodies]]
type = "points"
x = [[0, 0, 0], [1, 0, 0]]
m = 0.5
[[forces]]
type = "springs"
pairs = [[0, 1]]
k_s = 100.0
"""  # w = sqrt(100 (2 + 2)) = 20


def drawn(folder: Path, dt: float) -> np.ndarray:
    """The picture of two masses on a spring, read by FFmpeg."""
    (folder / "two.toml").write_text(TWO.format(dt=dt))
    target = folder / "two.png"
    done = CliRunner().invoke(
        main, ["check", str(folder / "two.toml"), "--picture", str(target)], catch_exceptions=False
    )
    assert done.exit_code == 0, done.stderr
    with av.open(str(target)) as container:
        return next(container.decode(video=0)).to_ndarray(format="rgb24").astype(int)


def places(picture: np.ndarray, ink: tuple[int, int, int]) -> np.ndarray:
    """Middles of the dots of a colour in the plane, from the top down, shape (k, 2)."""
    left, top, right, bottom = PLOT
    y, x = np.nonzero(np.abs(picture[top:bottom, left:right] - ink).max(axis=2) < 12)
    rows = np.split(np.arange(len(y)), np.flatnonzero(np.diff(np.sort(y)) > 3) + 1)
    order = np.argsort(y, kind="stable")
    return np.array([(left + x[order[r]].mean() + 0.5, top + y[order[r]].mean() + 0.5) for r in rows if len(r)])


@pytest.mark.parametrize(("dt", "ink", "other"), [(0.075, CALM, ALARM), (0.11, ALARM, CALM)])
def test_eigenvalues_lie_where_they_belong(tmp_path: Path, dt: float, ink, other) -> None:
    """lambda = +-20i, and 0 for the motions of both masses together: dots at 20 dt above and below the middle."""
    picture = drawn(tmp_path, dt)
    found = places(picture, ink)
    scale = 272 / 3.2  # half of the plot's height shows 3.2
    zero = PLOT[0] + 0.76 * (PLOT[2] - PLOT[0]), 0.5 * (PLOT[1] + PLOT[3])
    swings = [(zero[0], zero[1] - scale * 20 * dt), (zero[0], zero[1] + scale * 20 * dt)]
    np.testing.assert_allclose(found[[0, -1]], swings, atol=1.0)
    still = places(picture, CALM)
    assert np.abs(still - zero).max(axis=1).min() < 1.0
    if other == ALARM:
        assert not len(places(picture, ALARM))


def test_the_region_is_that_of_the_solver_and_springs_show_their_share(tmp_path: Path) -> None:
    """Near the imaginary axis leapfrog keeps in bounds up to 2; below the limit springs are yellow, above it red."""
    calm, alarm = drawn(tmp_path, 0.08), drawn(tmp_path, 0.2)
    plane = Plane.around(np.array([1.6j]))
    for number, inside in ((-0.1 + 1.8j, True), (-0.1 + 2.3j, False), (0.3 + 1.0j, False), (-0.3 - 1.0j, True)):
        x, y = (round(place) for place in plane.pixel(number))
        brighter = int((calm[y, x] - PANEL).sum())
        assert (brighter > 40) is inside, number
    left, top, right, bottom = SCENE
    for picture, share in ((calm, 0.8), (alarm, 2.0)):
        part = picture[top:bottom, left:right]
        shown = part[part.max(axis=2) - part.min(axis=2) > 60]  # what has a colour
        assert len(shown) > 200
        x = BAR[0] + min(share, 1.49) / 1.5 * (BAR[2] - BAR[0])
        named = picture[(BAR[1] + BAR[3]) // 2, int(x)]
        for color in (shown.mean(axis=0), named):
            assert color[0] > color[2] + 40
            assert bool(color[1] > 0.6 * color[0]) is (share < 1)


def test_a_plane_that_shows_fast_motions_too() -> None:
    plane = Plane.around(np.array([-30.0 + 0j, 2.0 + 12j, -1.0 - 12j]))
    for number in (-30.0 + 0j, 2.0 + 12j, -1.0 - 12j):
        x, y = plane.pixel(number)
        assert PLOT[0] < x < PLOT[2]
        assert PLOT[1] < y < PLOT[3]
        assert plane.number(x, y) == pytest.approx(number)


@pytest.mark.parametrize("name", ["a.jpg", "a.mp4", "a_%04d.png", "nowhere/a.png"])
def test_pictures_that_cannot_be_written_are_refused_first(tmp_path: Path, monkeypatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["check", "pendulum", "--picture", name], catch_exceptions=False)
    assert (done.exit_code, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())
