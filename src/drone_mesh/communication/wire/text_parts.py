"""Short texts in several packets: each part carries its index and that of the last part."""

from __future__ import annotations

MOST_PARTS = 8  # 80 bytes and more; the rest is cut off


def split(text: str, room: int) -> list[tuple[int, bytes]]:
    """(part byte, text) for each packet with `room` bytes for text; at least one.

    The part byte holds the index from 0 in its lower four bits, the last index in the upper four.
    """
    encoded = text.encode()[: room * MOST_PARTS]
    parts = [encoded[at : at + room] for at in range(0, len(encoded), room)] or [b""]
    last = len(parts) - 1
    return [(index | last << 4, part) for index, part in enumerate(parts)]


class TextAssembly:
    """Reassembles a text from parts in any order."""

    def __init__(self) -> None:
        self._parts: dict[int, bytes] = {}
        self._last = 0

    def add(self, part_byte: int, text: bytes) -> str | None:
        """The whole text if this part completes it, else None."""
        index, last = part_byte & 0x0F, part_byte >> 4
        if not is_valid(part_byte):
            return None
        if last != self._last:  # of another text
            self._parts.clear()
            self._last = last
        self._parts[index] = text
        if len(self._parts) <= last:
            return None
        whole = b"".join(self._parts[part] for part in range(last + 1))
        self._parts.clear()
        return whole.rstrip(b"\0").decode(errors="replace")


def is_valid(part_byte: int) -> bool:
    """Whether this part byte is possible."""
    return part_byte & 0x0F <= part_byte >> 4 < MOST_PARTS
