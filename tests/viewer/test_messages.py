from __future__ import annotations

import contextlib
import json
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pointmass.errors import InvalidInput
from pointmass.viewer import messages
from pointmass.viewer.messages import (
    Ack,
    AddParticle,
    Arrange,
    Change,
    Choose,
    ChooseCurveSolver,
    Clear,
    ClearCurves,
    Dismiss,
    Drag,
    Grab,
    Inspect,
    JoinPicked,
    Lens,
    Loop,
    Pick,
    PinPicked,
    Play,
    Plot,
    PushAt,
    Redo,
    Release,
    Reset,
    Resume,
    Seek,
    SetCurveStep,
    SetSolver,
    SetSwitch,
    SetWind,
    ShootBall,
    Speed,
    StartCurve,
    Step,
    Undo,
    Vectors,
    decode,
    encode,
)
from pointmass.viewer.typescript import generated

ROOT = Path(__file__).parents[2]
SOME = [
    Ack(sequence=7),
    Play(on=False),
    Step(),
    Reset(),
    Speed(factor=0.25),
    Change(name="gravity", value=1.5),
    Change(name="held", value="top edge"),
    Change(name="open", value=True),
    Choose(preset=""),
    Grab(sequence=3, row=0, target=(0.5, -1.0, 2e3)),
    Drag(target=(0.0, 0.0, 0.0)),
    Release(),
    Seek(frame=12),
    Loop(on=True, first=3, last=9),
    Resume(frame=0),
    SetSolver(name="rk4", dt=0.0),
    SetSwitch(name="forces.0", on=False),
    SetWind(direction=(0.0, 0.0, 1.0)),
    Undo(),
    Redo(),
    Pick(sequence=3, row=1),
    PinPicked(),
    JoinPicked(),
    AddParticle(place=(0.0, 1.0, 0.0)),
    ShootBall(place=(0.0, 1.0, 4.0), velocity=(0.0, 0.0, -8.0), radius=0.1),
    PushAt(place=(0.0, 1.0, 0.0), radius=0.1),
    Clear(),
    Plot(text="mean(y)", on=True),
    StartCurve(place=(1.0, 0.0, 0.0)),
    ChooseCurveSolver(name="euler", on=False),
    SetCurveStep(dt=0.1, span=5.0),
    ClearCurves(),
    Inspect(sequence=3, row=0),
    Dismiss(),
    Lens(name="speed"),
    Vectors(name="force", on=True),
    Arrange(beside=False),
]


@pytest.mark.parametrize("message", SOME, ids=lambda m: m.kind)
def test_a_message_comes_back_as_it_was(message):
    back = decode(encode(message))
    assert back == message
    assert [type(getattr(back, f.name)) for f in fields(back)] == [
        type(getattr(message, f.name)) for f in fields(message)
    ]


def test_every_inbound_message_is_tried():
    assert {type(m).kind for m in SOME} == set(messages.INBOUND)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        '"ack"',
        "{",
        "[" * 10000,
        '{"kind": "no such"}',
        '{"kind": ["ack"]}',
        '{"kind": "ack"}',
        '{"kind": "ack", "sequence": -1}',
        '{"kind": "ack", "sequence": 1.5}',
        '{"kind": "ack", "sequence": true}',
        '{"kind": "ack", "sequence": "1"}',
        '{"kind": "ack", "sequence": 1e300}',
        '{"kind": "ack", "sequence": 1, "more": 2}',
        '{"kind": "speed", "factor": 0}',
        '{"kind": "speed", "factor": NaN}',
        '{"kind": "speed", "factor": Infinity}',
        '{"kind": "speed", "factor": 1e4}',
        '{"kind": "drag", "target": [0, 1]}',
        '{"kind": "drag", "target": [0, 1, NaN]}',
        '{"kind": "drag", "target": [0, 1, "2"]}',
        '{"kind": "drag", "target": {"0": 1}}',
        '{"kind": "change", "name": "k", "value": null}',
        '{"kind": "change", "name": "k", "value": [1]}',
        '{"kind": "change", "name": 3, "value": 1}',
        '{"kind": "change", "name": "k", "value": "' + "x" * 5000 + '"}',
        '{"kind": "play", "on": 1}',
        '{"kind": "step", "x": "' + "x" * 20000 + '"}',
        '{"kind": "ack", "sequence": ' + "9" * 5000 + "}",
        b"\xff\xfe\x00",
    ],
)
def test_what_is_malformed_is_refused_in_a_sentence(text):
    with pytest.raises(InvalidInput, match="message"):
        decode(text)


PLAIN = st.sampled_from([None, True, 0, 3, -1, 0.5, 1e300, float("nan"), float("inf"), "", "x"])
JSON = PLAIN | st.lists(PLAIN, max_size=4) | st.dictionaries(st.just("a"), PLAIN)
NAMES = sorted({f.name for kind in messages.INBOUND.values() for f in fields(kind)})


@given(st.sampled_from(sorted(messages.INBOUND)), st.dictionaries(st.sampled_from(NAMES), JSON, max_size=4))
@example("grab", {"sequence": 1, "row": 2, "target": [0, 0, 10**400]})
def test_any_object_is_a_message_with_fields_of_its_types_or_refused(kind, document):
    try:
        message = decode(json.dumps({"kind": kind, **document}))
    except InvalidInput:
        return
    assert message == decode(encode(message))


@given(st.text(max_size=200) | st.binary(max_size=200))
def test_any_text_is_refused_or_a_message(text):
    with contextlib.suppress(InvalidInput):
        decode(text)


def test_numbers_that_are_not_finite_are_null():
    assert encode(messages.Note(level="info", text="ä")) == '{"kind":"note","level":"info","text":"\\u00e4"}'
    assert messages.plain({"a": float("nan"), "b": (1.0, float("inf"))}) == {"a": None, "b": [1.0, None]}


def test_the_pages_types_are_those_of_the_messages():
    text = (ROOT / "viewer" / "src" / "messages.ts").read_text(encoding="utf-8")
    assert text == generated(), "run: python -m pointmass.viewer.typescript > viewer/src/messages.ts"
