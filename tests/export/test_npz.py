"""Frames as NumPy arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.export import EXPORTERS, export
from pointmass.frame import Frame


def frames_of(counts: list[int]) -> list[Frame]:
    rng = np.random.default_rng(1)
    return [
        Frame(
            number=k,
            time=k / 60,
            ids=np.arange(n) + 10 * k,
            positions=rng.normal(size=(n, 3)),
            velocities=rng.normal(size=(n, 3)),
            quantities={"particles": float(n)} | ({"energy": 1.5} if k else {}),
        )
        for k, n in enumerate(counts)
    ]


@pytest.mark.parametrize("counts", [[3, 5, 0, 1], [0, 0], [4]])
def test_npz_holds_every_frame(tmp_path: Path, counts: list[int]) -> None:
    frames = frames_of(counts)
    seen: list[int] = []
    export(frames, tmp_path / "a.npz", seen.append)
    assert seen == list(range(1, len(counts) + 1))
    most = max(counts)
    with np.load(tmp_path / "a.npz") as data:
        assert data["count"].tolist() == counts
        assert data["time"].tolist() == [f.time for f in frames]
        assert data["ids"].shape == (len(counts), most)
        assert data["positions"].shape == data["velocities"].shape == (len(counts), most, 3)
        for k, frame in enumerate(frames):
            n = len(frame.ids)
            assert data["ids"][k, :n].tolist() == frame.ids.tolist()
            assert (data["ids"][k, n:] == -1).all()
            assert data["positions"][k, :n].tobytes() == frame.positions.tobytes()
            assert data["velocities"][k, :n].tobytes() == frame.velocities.tobytes()
            assert np.isnan(data["positions"][k, n:]).all()
            assert np.isnan(data["velocities"][k, n:]).all()
        assert data["quantity_particles"].tolist() == counts
        if len(counts) > 1:
            assert np.isnan(data["quantity_energy"][0])
            assert (data["quantity_energy"][1:] == 1.5).all()
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_single_precision_stays_single(tmp_path: Path) -> None:
    scene = pm.Scene(bodies=[pm.chain(2)], dtype="float32", forces=[pm.Gravity()])
    cache = pm.record(scene.simulation(), tmp_path / "c.zarr", 3, scene=scene)
    export(cache, tmp_path / "c.npz")
    with np.load(tmp_path / "c.npz") as data:
        assert data["positions"].dtype == np.float32
        assert data["positions"][2].tobytes() == cache[2].positions.tobytes()


def test_what_is_refused_leaves_old_files_alone(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_text("old")
    (tmp_path / "b.npz").mkdir()
    frames = frames_of([2])
    for name, sentence in (
        ("a.xyz", "unknown kind of export '.xyz'"),
        ("none/a.npz", "there is no folder"),
        ("b.npz", "it is a folder"),
    ):
        with pytest.raises(InvalidInput, match=sentence):
            export(frames, tmp_path / name)
    with pytest.raises(InvalidInput, match="no frames to export"):
        export([], tmp_path / "a.npz")

    def stop(frames: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(frames, tmp_path / "a.npz", stop)
    assert (tmp_path / "a.npz").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_every_exporter_says_what_it_does() -> None:
    for suffix, exporter in EXPORTERS.items():
        assert suffix.startswith(".")
        assert exporter.write.__doc__


def test_what_is_not_installed_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pointmass.libraries.find_spec", lambda name: None)
    with pytest.raises(InvalidInput, match=r"writing \.usd needs usd-core: pip install 'pointmass\[export\]'"):
        export(frames_of([2]), tmp_path / "a.usd")
