"""Just enough of pcapng to write packets with comments (IETF draft-ietf-opsawg-pcapng).

Our own because it is short and the libraries mainly read (docs/decisions/own-code.md).
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Iterable, NamedTuple

LINKTYPE_USER0 = 147  # there is no link type for this radio; user 0..15 are for private use
_SECTION_HEADER, _INTERFACE, _ENHANCED_PACKET = 0x0A0D0D0A, 1, 6
_BYTE_ORDER_MAGIC = 0x1A2B3C4D
_LENGTH_NOT_KNOWN = -1
_OPT_COMMENT, _OPT_APPLICATION, _OPT_NAME, _OPT_RESOLUTION = 1, 4, 2, 9
_NANOSECONDS = b"\x09"  # 10^-9 s


class CapturedPacket(NamedTuple):
    """One packet of the file."""

    time_ns: int
    data: bytes
    comment: str


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _options(*options: tuple[int, bytes]) -> bytes:
    body = b""
    for code, value in options:
        body += struct.pack("<HH", code, len(value)) + _padded(value)
    return body + struct.pack("<HH", 0, 0)


def _block(kind: int, body: bytes) -> bytes:
    length = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + length + body + length


def write_pcapng(path: Path, packets: Iterable[CapturedPacket]) -> None:
    """One section with one interface."""
    with path.open("wb") as file:
        section = struct.pack("<IHHq", _BYTE_ORDER_MAGIC, 1, 0, _LENGTH_NOT_KNOWN)
        file.write(_block(_SECTION_HEADER, section + _options((_OPT_APPLICATION, b"drone_mesh"))))
        interface = struct.pack("<HHI", LINKTYPE_USER0, 0, 0)
        name = _options((_OPT_NAME, b"emulated air"), (_OPT_RESOLUTION, _NANOSECONDS))
        file.write(_block(_INTERFACE, interface + name))
        for packet in packets:
            length = len(packet.data)
            high, low = divmod(packet.time_ns, 1 << 32)
            head = struct.pack("<IIIII", 0, high, low, length, length)
            comment = _options((_OPT_COMMENT, packet.comment.encode()))
            file.write(_block(_ENHANCED_PACKET, head + _padded(packet.data) + comment))
