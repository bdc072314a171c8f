"""A trace of every frame on the air, in memory and as a file for Wireshark."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import NamedTuple

from drone_mesh.nrf24.airtime import PREAMBLE_BITS
from drone_mesh.nrf24.emulator.air import Transmission
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.emulator.pcapng import CapturedPacket, write_pcapng


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
        """Record a frame that has ended."""
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
