"""Scene files that are damaged or hostile: one clear sentence, or a scene that begins to run."""

from __future__ import annotations

import copy
import tomllib
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pointmass.cli.memory import limited
from pointmass.errors import Diverged, InvalidInput
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.toml import dumps
from tests.fuzz.mutations import FULL, QUICK, damages, refused_or_right
from tests.small import SMALL

FEW = ("pendulum", "bounce", "fountain", "flow", "springs", "orbit", "smoke", "drape", "hair", "net", "flock")
NUMBERS = (0, -1, 1e-300, 1e300, 2**63, -(2**63), 10**30, 10**12, float("nan"), float("inf"))
TEXTS = ("", "x", "9**9**9**9", "../../x", "t/0", "log(-1)", "(" * 200)
LISTS: tuple[Any, ...] = ([], {}, [[]], [1, 2], [1, 2, 3], [1e300, 0, 0], [[0, 0, 0]] * 3, True)
HOSTILE = st.one_of(
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS),
    st.sampled_from(LISTS),
    st.integers(-3, 3),
    st.floats(-10, 10),
    st.text(max_size=8),
)


@pytest.fixture(scope="module")
def documents() -> list[dict[str, Any]]:
    built = [SCENES[name].with_settings(SMALL.get(name, {})).build().document() for name in (*FEW, "fireworks")]
    return [*built, tomllib.loads(Path("examples/fountain.toml").read_text())]


def begin(text: str) -> None:
    """Read a scene and make its first step, if it can."""
    with limited(), warnings.catch_warnings(), suppress(MemoryError):  # a command has a sentence for that
        warnings.simplefilter("ignore")
        with refused_or_right():
            scene = Scene.from_toml(text)
            if sum(len(body.particles) for body in scene.bodies) > 2000:
                return
            try:
                sim = scene.simulation()
                sim.frame(0)
                if sim.dt < 0.1 and not any(_crowded(e) for e in scene.emitters):
                    sim.step(1)
            except Diverged as error:
                if "\n" in str(error):
                    pytest.fail(str(error))


def _crowded(emitter: Any) -> bool:
    rate = emitter.arguments.get("rate", 0)
    return not isinstance(rate, (int, float)) or rate > 1e4


def places(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Ways to all that a document holds."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [*([way] if way else []), *(found for key, item in list(items)[:40] for found in places(item, (*way, key)))]


def a_hostile_document(data: Any, documents: list[dict[str, Any]]) -> None:
    document = copy.deepcopy(data.draw(st.sampled_from(documents)))
    for _ in range(data.draw(st.integers(1, 2))):
        *way, last = data.draw(st.sampled_from(places(document)))
        here: Any = document
        for key in way:
            here = here[key]
        match data.draw(st.sampled_from(("replace", "replace", "replace", "remove", "rename", "twice"))):
            case "remove":
                del here[last]
            case "rename" if isinstance(here, dict):
                here[data.draw(st.text(max_size=6))] = here.pop(last)
            case "twice" if isinstance(here, list):
                here.append(here[last])
            case _:
                here[last] = copy.deepcopy(data.draw(HOSTILE))
    try:
        text = dumps(document)
    except (TypeError, ValueError):
        return
    begin(text)


@QUICK
@given(data=st.data())
def test_a_hostile_document(data: Any, documents: list[dict[str, Any]]) -> None:
    a_hostile_document(data, documents)


@pytest.mark.full
@FULL
@given(data=st.data())
def test_ten_thousand_hostile_documents(data: Any, documents: list[dict[str, Any]]) -> None:
    a_hostile_document(data, documents)


@pytest.mark.parametrize("examples", [pytest.param(100), pytest.param(10_000, marks=pytest.mark.full)])
def test_damaged_text(examples: int, documents: list[dict[str, Any]]) -> None:
    texts = [dumps(document).encode() for document in documents]

    @settings(QUICK, max_examples=examples)
    @given(data=st.data())
    def damaged(data: Any) -> None:
        begin(data.draw(damages(data.draw(st.sampled_from(texts)))).decode("utf-8", errors="replace"))

    damaged()


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInput, match="it is not text in UTF-8"):
        Scene.load(tmp_path / "a.toml")
