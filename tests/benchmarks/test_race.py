"""The races: only the right answer counts, who is absent is left out, and the tables say it. No timing is tested."""

from __future__ import annotations

import importlib
import os
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner

import pointmass as pm
from benchmarks import page, race, track
from benchmarks.probe import Machine, probe
from benchmarks.toolchain import compiled
from benchmarks.workloads import emit, fish, free, hair, implicit, pairs, springs, xpbd
from benchmarks.workloads.cloth import cloth, irregular
from benchmarks.workloads.solids import DEEP, Stone

MACHINE = Machine("a machine", 2, 4e9, {"float32": (64e9, 128e9), "float64": (32e9, 64e9)}, (20e9, 40e9))

TOYS = """
import os
import numpy as np
from benchmarks.track import Contestant, Missing, Race, against


def problem():
    return np.arange(12.0).reshape(4, 3)


def judge(p, scheme):
    return against(p + 1, 1.0, 1e-6)


class Right(Contestant):
    name = "right"

    def frame(self):
        self.problem = self.problem + 1

    def result(self):
        return self.problem

    def note(self):
        return "well done"


class OwnClock(Right):
    name = "own clock"

    def frame(self):
        super().frame()
        return 0.25


class Wrong(Right):
    name = "wrong"

    def result(self):
        return self.problem + 1e-3


class NotFinite(Right):
    name = "not finite"

    def result(self):
        return self.problem * np.nan


class Absent(Right):
    name = "absent"

    def __init__(self, problem):
        import a_peer_that_nobody_has


class NoCompiler(Right):
    name = "no compiler"

    def __init__(self, problem):
        raise Missing("no C compiler was found")


class Crashes(Right):
    name = "crashes"

    def frame(self):
        raise ValueError("a kernel of mine\\nwas wrong")


class Dies(Right):
    name = "dies"

    def frame(self):
        if (self.problem != problem()).any():
            os._exit(7)
        super().frame()


def toy_race(kinds, case="a case"):
    return Race("Toys", case, problem, kinds, judge, "steps", 100.0, 4, 2.0, 1.0)
"""


@pytest.fixture(scope="module")
def toys(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """Contestants in a module that worker processes can import too."""
    folder = tmp_path_factory.mktemp("toys")
    (folder / "toy_contestants.py").write_text(TOYS, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield importlib.import_module("toy_contestants")


def test_only_the_right_answer_counts_and_nobody_stops_the_others(toys: ModuleType) -> None:
    kinds = [toys.Right, toys.OwnClock, toys.Wrong, toys.NotFinite]
    kinds += [toys.Absent, toys.NoCompiler, toys.Crashes, toys.Dies]
    said: list[str] = []
    results = {r.name: r for r in track.run(toys.toy_race(kinds), turns=3, threads=1, say=said.append)}
    assert len(results["right"].seconds) == 3
    assert results["right"].error == 0
    assert results["right"].note == "well done"
    assert results["own clock"].median == 0.25
    assert results["wrong"].out == "disqualified: its error is 1.7e-03 and may be 1e-06"
    assert results["not finite"].out.startswith("disqualified")
    assert results["absent"].out == "left out: a_peer_that_nobody_has is not installed"
    assert results["no compiler"].out == "left out: no C compiler was found"
    assert results["crashes"].out == "failed: ValueError: a kernel of mine"
    assert results["dies"].out == "its process ended with code 7"
    out = [name for name, r in results.items() if r.out]
    assert all(not results[name].seconds for name in out)
    assert [line.split(":")[0] for line in said] == out


def test_the_number_of_threads_is_that_of_the_workers_only(toys: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    with track._pools(3):
        assert os.environ["OMP_NUM_THREADS"] == os.environ["NUMBA_NUM_THREADS"] == "3"
    assert os.environ["OMP_NUM_THREADS"] == "5"
    assert "NUMBA_NUM_THREADS" not in os.environ


def test_without_a_compiler_c_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(track.Missing, match="no C compiler was found"):
        compiled(Path(free.__file__).with_name("free.c"))


# ---------------------------------------------------------------------------------------------------- the workloads

FREE = partial(free.Problem, 300, substeps=32)
RK4 = partial(free.Problem, 300, solver="rk4", mu=2.0)
EMIT = partial(emit.Problem, 20_000)
STONE = partial(emit.Problem, 20_000, collider=Stone(parts=10))
SHOAL = partial(fish.shoal, 2)
CLOTH, MESH, HAIR = partial(cloth, 8), partial(irregular, 8), partial(hair.hair, 3)
TAUT, TAUT_MESH = partial(xpbd.taut, cloth, 17, 5), partial(xpbd.taut, irregular, 8, 1)
HERE = [
    *((free, FREE, kind) for kind in (free.Pointmass, free.PointmassDiscrete, free.NumPy, free.NumPyBlocks)),
    *((free, FREE, kind) for kind in (free.C, free.CFused)),
    *((free, RK4, kind) for kind in (free.Pointmass, free.NumPy, free.C, free.CFused)),
    *((springs, p, kind) for p in (CLOTH, MESH, HAIR) for kind in (springs.Pointmass, springs.NumPy, springs.C)),
    (springs, HAIR, hair.NumPyStrands),
    *((fish, SHOAL, kind) for kind in (fish.Pointmass, fish.NumPy)),
    *((pairs, partial(pairs.Bodies, 200), kind) for kind in (pairs.Pointmass, pairs.NumPy, pairs.C)),
    *((implicit, partial(implicit.drum, 8), kind) for kind in implicit.CONTESTANTS),
    *((xpbd, p, xpbd.NumPy) for p in (TAUT, TAUT_MESH)),
    (xpbd, TAUT_MESH, xpbd.Pointmass),
    *(
        (emit, p, kind)
        for p in (EMIT, STONE)
        for kind in (emit.Pointmass, emit.PointmassDiscrete, emit.NumPy, emit.NumPyBlocks)
    ),
]


@pytest.mark.parametrize(
    ("workload", "make", "kind"), HERE, ids=[f"{m.__name__[21:]}-{make.func.__name__}-{k.name}" for m, make, k in HERE]
)
def test_contestants_that_need_no_peer_are_right(workload: ModuleType, make: partial, kind: type) -> None:
    problem = make()
    judge = workload.judge(problem, kind.scheme)
    try:
        contestant = kind(problem)
    except track.Missing as reason:
        pytest.skip(str(reason))
    contestant.frame()
    result = np.asarray(contestant.result(), np.float64)
    assert judge.error(result if judge.rows is None else result[judge.rows]) <= judge.most


def test_hair_on_a_head_is_judged_by_some_of_its_strands() -> None:
    head = hair.Head(12, 6, "wavy")
    contestant = hair.OnAHead(head)
    contestant.frame()
    judge = hair.judge_head(head, "")
    result = np.asarray(contestant.result(), np.float64)
    assert judge.error(result[judge.rows]) <= judge.most
    contestant.sim.step()  # one step too many
    assert judge.error(np.asarray(contestant.result(), np.float64)[judge.rows]) > judge.most


def test_the_melt_follows_newtons_law() -> None:
    liquid = pairs.Liquid(3)
    assert len(liquid.x) == 108
    assert np.isclose((liquid.v**2).sum() / (3 * 107), 1.44)
    judge = pairs.judge_melt(liquid, "")
    assert judge.error(liquid.x) > 0.01  # they do move
    try:
        contestant = pairs.Melt64(liquid)
    except track.Missing as reason:
        pytest.skip(str(reason))
    contestant.frame()
    assert judge.error(np.asarray(contestant.result())) < 1e-10


def test_the_lists_of_the_stone_have_the_nearest_triangles() -> None:
    stone = STONE.keywords["collider"]
    x = STONE().x.astype(np.float64)
    gap, normal = stone.distance(x)
    near = np.isfinite(gap)
    ours = stone.ours()
    assert near.sum() > 50
    np.testing.assert_allclose(gap[near], ours.distance(x[near], 0.0), atol=1e-14)
    np.testing.assert_allclose(normal[near], ours.normal(x[near], 0.0), atol=1e-12)
    assert (ours.distance(x[~near], 0.0) > DEEP).all()


def test_the_air_of_the_race_of_births_is_that_of_curl_noise() -> None:
    p = EMIT()
    x = p.x[:300].astype(np.float64)
    air = pm.CurlNoise(p.length, p.speed, rate=0.0, octaves=1, seed=p.seed)
    particles = pm.Particles(x)
    air.bind(particles)
    air.add_forces(particles, 0.0, particles.x, particles.v, particles.f)
    np.testing.assert_allclose(emit.flow(p, x), particles.f, atol=1e-12)


WRONG = [
    (free, FREE, {"k": 0.0}),
    (free, FREE, {"g": -9.5}),
    (free, FREE, {"restitution": 0.79}),
    (free, RK4, {"mu": 1.9}),
    (free, RK4, {"solver": "symplectic_euler"}),
    (springs, CLOTH, {"k_d": 0.0}),
    (springs, CLOTH, {"g": 0.0}),
    (springs, MESH, {"k_s": 0.0}),
    (springs, HAIR, {"substeps": 15}),
    (pairs, partial(pairs.Bodies, 200), {"eps": 0.03}),
    (implicit, partial(implicit.drum, 8), {"k_s": 9.9}),
    (xpbd, TAUT, {"iterations": 6}),
    (xpbd, TAUT_MESH, {"k_s": 1.0}),
    (fish, SHOAL, {"upright": 8.0}),
    (emit, EMIT, {"k": 3.9}),
    (emit, EMIT, {"restitution": 0.45}),
    (emit, STONE, {"restitution": 0.45}),
    (emit, EMIT, {"seed": 4}),
    (emit, EMIT, {"speed": 1.45}),
]


@pytest.mark.parametrize(("workload", "make", "change"), WRONG, ids=[str(w[2]) for w in WRONG])
def test_a_wrong_contestant_is_caught(workload: ModuleType, make: partial, change: dict[str, float]) -> None:
    """The right program with a wrong number in it."""
    from dataclasses import replace

    problem = make()
    judge = workload.judge(problem, "")
    kind = implicit.SciPy if workload is implicit else workload.NumPy
    contestant = kind(replace(problem, **change))
    contestant.frame()
    result = np.asarray(contestant.result(), np.float64)
    assert judge.error(result if judge.rows is None else result[judge.rows]) > judge.most


@pytest.mark.parametrize("name", [w for w in race.WORKLOADS if w != "start"])
def test_every_workload_begins_with_pointmass(name: str) -> None:
    for held in importlib.import_module(f"benchmarks.workloads.{name}").races(quick=True):
        assert held.contestants[0].name.startswith("pointmass")
        assert len({kind.name for kind in held.contestants}) == len(held.contestants)
        assert MACHINE.limit(held.slots, held.traffic, held.double) > 0


# ---------------------------------------------------------------------------------------------------- the tables


def result_of(held: track.Race, name: str, seconds: list[float], out: str = "") -> track.Result:
    return track.Result(held, name, seconds, first=1.0, memory=96.0, error=2e-7, out=out)


def test_a_table_has_the_fastest_first_and_compares_with_ours(toys: ModuleType) -> None:
    held = toys.toy_race([toys.Right, toys.Wrong])
    ours, peer = result_of(held, "right", [2e-9, 1e-8, 3e-9]), result_of(held, "peer", [1.5e-9])
    (table,) = page.tables([ours, peer, result_of(held, "gone", [], "left out: gone is not installed")], MACHINE)
    # 40e9 bytes/s over 1 byte a step: less than 128e9 multiply-adds/s over 2 a step.
    assert table.notes == ["roofline: 40.0e9 steps/s", "gone: left out: gone is not installed"]
    assert table.columns[5] == "time over right"
    assert table.rows == [
        ["peer", "0.00000150", "0.00000150", "66.7e9", "166.7 %", "0.50", "2e-07"],
        ["right", "0.00000200", "0.00000300", "33.3e9", "83.3 %", "1.00", "2e-07"],
    ]
    assert "| peer | 0.00000150 |" in table.markdown()


def test_races_with_one_contestant_share_a_table(toys: ModuleType) -> None:
    small, large = (toys.toy_race([toys.Right], case) for case in ("small", "large"))
    results = [result_of(small, "right", [1e-6]), result_of(large, "right", [], "failed: it did")]
    (table,) = page.tables(results, MACHINE)
    assert [row[0] for row in table.rows] == ["small", "large"]
    assert table.rows[0][-1] == "24"  # bytes a particle
    assert table.rows[1][1] == "failed: it did"


def test_a_section_is_put_in_its_place(tmp_path: Path) -> None:
    target = tmp_path / "page.md"
    target.write_text("# Title\n\n<!-- race free -->\nold\n<!-- end free -->\n\nThe end.\n", encoding="utf-8")
    page.write(target, "free", r"new \1")
    page.write(target, "hair", "hair")
    assert target.read_text(encoding="utf-8") == (
        "# Title\n\n<!-- race free -->\nnew \\1\n<!-- end free -->\n\nThe end.\n\n"
        "<!-- race hair -->\nhair\n<!-- end hair -->\n"
    )
    page.write(tmp_path / "fresh.md", "free", "text")
    assert (tmp_path / "fresh.md").read_text(encoding="utf-8").startswith("# Performance\n\n<!-- race free -->\ntext")


def test_the_command_writes_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(race, "probe", lambda threads: MACHINE)
    target = tmp_path / "page.md"
    arguments = ["hair", "--quick", "--turns", "2", "--threads", "1", "--only", "NumPy, slices", "--write", str(target)]
    done = CliRunner().invoke(race.main, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    text = target.read_text(encoding="utf-8")
    assert "a machine, 2 threads, clock 4.00 GHz" in done.output
    assert "### Hair\n\n**100 strands of 16 masses**" in text
    assert "| NumPy, slices |" in text
    assert "numpy " in text


def test_the_roofline_is_the_lower_of_its_two_sides() -> None:
    assert MACHINE.limit(2, 0) == 64e9
    assert MACHINE.limit(2, 0, double=True) == 32e9
    assert MACHINE.limit(2, 4) == 10e9
    assert np.isnan(MACHINE.limit(0, 0))


@pytest.mark.full
def test_the_probe_measures_something() -> None:
    machine = probe(1)
    assert 1e8 < machine.clock < 1e10
    assert machine.fma["float32"][0] > machine.fma["float64"][0] > 1e8
    assert machine.triad[0] > 1e8
