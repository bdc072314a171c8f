"""The receiving side of the protocol engine: Enhanced ShockBurst PRX [DS 7.5.2, Fig. 11]."""

from __future__ import annotations

from drone_mesh.nrf24.airtime import SETTLING_NS
from drone_mesh.nrf24.emulator.chip_core import ChipCore, State
from drone_mesh.nrf24.emulator.fifos import Incoming, TxPayload
from drone_mesh.nrf24.emulator.frames import Frame, Packet
from drone_mesh.nrf24.registers import PIPES, RX_DR, TX_DS

_NOTHING_YET = (-1, -1)


class Receiver:
    """Accepts frames addressed to its pipes, and acknowledges them."""

    def __init__(self, chip: ChipCore) -> None:
        self._chip = chip
        self._last: list[tuple[int, int]] = [_NOTHING_YET] * PIPES  # PID and CRC

    def frame_arrived(self, frame: Frame) -> bool:
        """A frame with the address of an open pipe arrived; returns whether it was valid there."""
        chip, registers = self._chip, self._chip.registers
        pipe = registers.pipe_of_address[frame.address(registers.address_bytes)]
        form = registers.formats[pipe]
        if form.payload_bytes == 0:
            return False  # RX_PW_Pn = 0: the pipe is not used
        packet = frame.decode(form)
        if packet is None:
            return False
        if chip.rx_fifo.full:
            return True  # ignored, and not acknowledged
        if self._is_new(pipe, packet):
            self._store(pipe, packet)
        wants_answer = packet.no_ack_bit != chip.variant.no_ack_bit
        if registers.auto_ack[pipe] and wants_answer:
            chip.overtake()
            chip.stop_listening()
            chip.state = State.ANSWER_SETTLING
            address = registers.pipe_addresses[pipe]  # the one that the packet came to [DS 7.4.1]
            chip.after(SETTLING_NS, lambda: self._answer(pipe, address, packet.pid))
        return True

    def _is_new(self, pipe: int, packet: Packet) -> bool:
        """Whether PID or CRC differ from the last packet; frames without PCF are always new."""
        if not self._chip.registers.formats[pipe].enhanced:
            return True
        memory = pipe if self._chip.variant.duplicates_by_pipe else 0
        identity = (packet.pid, packet.crc)
        if self._last[memory] == identity:
            return False
        self._last[memory] = identity
        return True

    def _store(self, pipe: int, packet: Packet) -> None:
        chip = self._chip
        flags = RX_DR.mask
        answered = chip.tx_fifo.for_pipe(pipe)
        if answered is not None and answered.was_sent:
            # The other side sends a new packet, so it received the acknowledgement with this
            # payload.
            chip.tx_fifo.remove(answered)
            flags |= TX_DS.mask
        width = len(packet.payload)
        if chip.faults.next_width is not None:
            width, chip.faults.next_width = chip.faults.next_width, None
        chip.rx_fifo.push(Incoming(pipe, packet.payload, width))
        chip.set_flags(flags)

    def _answer(self, pipe: int, address: bytes, pid: int) -> None:
        chip, registers = self._chip, self._chip.registers
        payload: TxPayload | None = None
        if registers.ack_payloads and registers.dynamic[pipe]:
            payload = chip.tx_fifo.for_pipe(pipe)
        if payload is not None:
            payload.was_sent = True
        frame = Frame.encode(
            address,
            b"" if payload is None else payload.payload,
            registers.ack_formats[pipe],
            pid,
            1 - chip.variant.no_ack_bit,
        )
        chip.state = State.ANSWER
        chip.transmit(frame, None)
