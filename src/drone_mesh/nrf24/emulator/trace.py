"""A trace of every frame on the air, and pcapng files of frames and payloads for Wireshark.

The writer (IETF draft-ietf-opsawg-pcapng) is our own because it is short and the libraries mainly
read (docs/decisions.md).
"""

from __future__ import annotations

import contextlib
import struct
from collections import deque
from pathlib import Path
from typing import Iterable, NamedTuple

from drone_mesh.nrf24.emulator.air import Transmission
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.registers import PREAMBLE_BITS

# There is no link type for this radio; user 0..15 are for private use.
LINKTYPE_FRAMES = 147  # USER0: bits on the air
LINKTYPE_PAYLOADS = 148  # USER1: payloads of 32 bytes
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


class PcapngWriter:
    """A file with one section and one interface; `write` returns once its packet is in the file."""

    def __init__(self, path: Path, link_type: int, interface: str) -> None:
        """Raises OSError."""
        self._file = path.open("wb", buffering=0)
        section = struct.pack("<IHHq", _BYTE_ORDER_MAGIC, 1, 0, _LENGTH_NOT_KNOWN)
        application = _options((_OPT_APPLICATION, b"drone_mesh"))
        name = _options((_OPT_NAME, interface.encode()), (_OPT_RESOLUTION, _NANOSECONDS))
        self._file.write(
            _block(_SECTION_HEADER, section + application)
            + _block(_INTERFACE, struct.pack("<HHI", link_type, 0, 0) + name)
        )

    def write(self, packet: CapturedPacket) -> None:
        """Append a packet. Raises OSError."""
        length = len(packet.data)
        high, low = divmod(packet.time_ns, 1 << 32)
        head = struct.pack("<IIIII", 0, high, low, length, length)
        comment = _options((_OPT_COMMENT, packet.comment.encode()))
        self._file.write(_block(_ENHANCED_PACKET, head + _padded(packet.data) + comment))

    def close(self) -> None:
        self._file.close()


def write_pcapng(path: Path, packets: Iterable[CapturedPacket]) -> None:
    """Write a file of frames on the emulated air. Raises OSError."""
    with contextlib.closing(PcapngWriter(path, LINKTYPE_FRAMES, "emulated air")) as writer:
        for packet in packets:
            writer.write(packet)


class TracedFrame(NamedTuple):
    """One frame as it was sent; damage happens at the receivers."""

    start_ns: int
    end_ns: int
    sender: str
    channel: int
    bits_per_s: int
    is_answer: bool  # an acknowledgement
    is_aborted: bool
    listeners: tuple[str, ...]  # the chips that listened on the channel when it began
    frame: Frame

    def __str__(self) -> str:
        kind = "acknowledgement" if self.is_answer else "frame"
        bits = self.frame.bit_count - PREAMBLE_BITS
        text = (
            f"{kind} from {self.sender}, {bits} bits after the preamble, channel {self.channel}, "
            f"{self.bits_per_s // 1000} kbit/s, {(self.end_ns - self.start_ns) / 1000:g} us"
        )
        return text + ", broken off" if self.is_aborted else text


class FrameTrace:
    """Pass `see` to Air.observe. Keeps the last `limit` frames."""

    def __init__(self, limit: int = 100_000) -> None:
        self._frames: deque[TracedFrame] = deque(maxlen=limit)

    def see(self, transmission: Transmission) -> None:
        self._frames.append(
            TracedFrame(
                transmission.start_ns,
                transmission.end_ns,
                transmission.sender.name,
                transmission.channel,
                transmission.bits_per_s,
                transmission.packet is None,
                transmission.aborted,
                tuple(antenna.name for antenna in transmission.listeners),
                transmission.frame,
            )
        )

    @property
    def frames(self) -> tuple[TracedFrame, ...]:
        """The recorded frames, oldest first."""
        return tuple(self._frames)

    def write(self, path: Path) -> int:
        """Write a pcapng file; returns the number of frames in it. Raises OSError.

        Each packet holds the bits from the preamble to the CRC, padded to whole bytes, and a
        comment. Times are relative to the start of the air.
        """
        frames = self.frames
        write_pcapng(
            path,
            (CapturedPacket(one.start_ns, one.frame.to_bytes(), str(one)) for one in frames),
        )
        return len(frames)
