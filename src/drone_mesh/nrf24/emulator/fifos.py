"""The two FIFOs, three payloads deep each [DS 7.5.2, Fig. 13]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from drone_mesh.nrf24.emulator.frames import Frame, FrameFormat
from drone_mesh.nrf24.registers import FIFO_DEPTH


@dataclass(eq=False)
class TxPayload:
    """A payload in the TX FIFO; object identity distinguishes packets."""

    payload: bytes
    pid: int = 0
    no_ack: bool = False
    ack_pipe: int | None = None  # to be sent in an acknowledgement on that pipe
    was_sent: bool = False  # an ack payload that was sent, perhaps without success
    _frame: Frame | None = None
    _made_for: object = None

    def frame(self, address: bytes, form: FrameFormat, no_ack_bit: int) -> Frame:
        """Its frame, encoded again only if something has changed since the last attempt."""
        key = (address, form, self.pid, no_ack_bit)
        if self._frame is None or self._made_for != key:
            self._frame = Frame.encode(address, self.payload, form, self.pid, no_ack_bit)
            self._made_for = key
        return self._frame


@dataclass(frozen=True)
class Incoming:
    """A payload in the RX FIFO."""

    pipe: int
    payload: bytes
    reported_width: int


Payload = TypeVar("Payload")


class _Fifo(Generic[Payload]):
    def __init__(self) -> None:
        self._payloads: list[Payload] = []

    def __len__(self) -> int:
        return len(self._payloads)

    @property
    def full(self) -> bool:
        return len(self._payloads) == FIFO_DEPTH

    @property
    def oldest(self) -> Payload | None:
        return self._payloads[0] if self._payloads else None

    def flush(self) -> None:
        self._payloads.clear()


class RxFifo(_Fifo[Incoming]):
    """Received payloads that were not read yet."""

    def __init__(self, partial_read_removes: bool) -> None:
        super().__init__()
        self._partial_read_removes = partial_read_removes
        self._last_byte = 0

    def push(self, incoming: Incoming) -> None:
        """The caller must check that it is not full."""
        self._payloads.append(incoming)

    def read(self, count: int) -> bytes:
        """R_RX_PAYLOAD: the bytes that leave the chip while `count` bytes are clocked.

        After the end of a payload the next one follows; an empty FIFO repeats the last byte.
        """
        out = b""
        while self._payloads and len(out) < count:
            payload = self._payloads[0].payload
            wanted = count - len(out)
            out += payload[:wanted]
            if wanted >= len(payload) or self._partial_read_removes:
                del self._payloads[0]
        if out:
            self._last_byte = out[-1]
        return out + bytes((self._last_byte,)) * (count - len(out))


class TxFifo(_Fifo[TxPayload]):
    """Payloads to send: those of a transmitter, or ack payloads of a receiver."""

    def push(self, outgoing: TxPayload) -> bool:
        """Add a payload. False: the FIFO is full, and the payload is lost."""
        if self.full:
            return False
        self._payloads.append(outgoing)
        return True

    def push_back(self, outgoing: TxPayload) -> None:
        """REUSE_TX_PL: put the payload that was sent last in front again."""
        self._payloads.insert(0, outgoing)

    def remove(self, outgoing: TxPayload) -> None:
        """Remove a sent payload; ignored if it was flushed meanwhile."""
        if outgoing in self._payloads:
            self._payloads.remove(outgoing)

    def for_pipe(self, pipe: int) -> TxPayload | None:
        """The oldest ack payload for a pipe, or None."""
        return next((out for out in self._payloads if out.ack_pipe == pipe), None)
