"""What a console remembers for its next start, as text: bounded, compressed, of one run."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any, Mapping, NamedTuple

MOST_BYTES = 4_000_000  # unpacked; 1000 events with 60 peers each of 254 drones: 0.34 MB


class Memory(NamedTuple):
    """What a console of this run had saved (FrameStore.saved)."""

    run: str
    saved: Mapping[str, Any]


def pack(memory: Memory) -> str:
    """The memory as ASCII text."""
    return base64.b64encode(zlib.compress(json.dumps(memory).encode(), 1)).decode()


def unpack(text: str) -> Memory:
    """The content of such a text. Raises ValueError if it is damaged or too long."""
    try:
        unpacker = zlib.decompressobj()
        content = unpacker.decompress(base64.b64decode(text, validate=True), MOST_BYTES)
        run, saved = json.loads(content)
        return Memory(str(run), dict(saved))
    except (TypeError, zlib.error, RecursionError) as error:
        raise ValueError(str(error)) from error
