"""The constants of the messages are the numbers that the code publishes."""

from __future__ import annotations

import re
from pathlib import Path

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.state.model import REPAIR_STATES

MESSAGES = Path(__file__).resolve().parents[3] / "msg"


def constants(name: str) -> dict[str, int]:
    text = (MESSAGES / name).read_text(encoding="utf-8")
    return {key: int(value) for key, value in re.findall(r"^uint8 (\w+) = (\d+)", text, re.M)}


def test_each_kind_of_event_has_its_constant():
    expected = {kind.name: number for number, kind in enumerate(MeshEventKind)}
    assert constants("MeshEvent.msg") == expected


def test_each_state_of_a_repair_has_its_constant():
    known = constants("NodeState.msg")
    assert {state.name: known[state.name] for state in REPAIR_STATES} == {
        state.name: number for number, state in enumerate(REPAIR_STATES)
    }
