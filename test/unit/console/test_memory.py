"""What a console remembers for its next start."""

from __future__ import annotations

import base64
import json
import zlib

import pytest

from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.memory import MOST_BYTES, Memory, pack, unpack


def text_of(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content)).decode()


def test_a_memory_comes_back_as_it_was():
    memory = Memory("a1b2", FrameStore().saved())
    assert unpack(pack(memory)) == memory


@pytest.mark.parametrize(
    "text",
    [
        "no base64 \u00fc",
        base64.b64encode(b"not compressed").decode(),
        pack(Memory("a1b2", {}))[:12],
        text_of(b"{"),
        text_of(b"[1]"),
        text_of(b"3"),
        text_of(b'["a1b2", 3]'),
        text_of(b"[" * 100_000),
        text_of(json.dumps(["a1b2", {"events": " " * MOST_BYTES}]).encode()),
    ],
)
def test_a_damaged_or_endless_memory_is_a_value_error(text):
    with pytest.raises(ValueError, match="."):
        unpack(text)


@pytest.mark.parametrize("part", ["events", "samples", "alarms", "orders"])
@pytest.mark.parametrize("damage", [None, 3, [3], [{}], [["x"]]])
def test_a_store_takes_no_damaged_memory(part, damage):
    with pytest.raises((KeyError, TypeError, ValueError)):
        FrameStore().restore({**FrameStore().saved(), part: damage})
