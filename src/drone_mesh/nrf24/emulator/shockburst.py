"""The two sides of the protocol engine, Enhanced ShockBurst [DS 7.5].

The transmitter is the PTX of Fig. 10 and 17, the receiver the PRX of Fig. 11.
"""

from __future__ import annotations

from drone_mesh.nrf24.emulator.chip_core import ChipCore, State
from drone_mesh.nrf24.emulator.fifos import Incoming, TxPayload
from drone_mesh.nrf24.emulator.frames import Frame, Packet
from drone_mesh.nrf24.registers import MAX_RT, PIPES, RX_DR, SETTLING_NS, TX_DS

_COUNTER_MAX = 15  # PLOS_CNT saturates there
_LONGEST_TX_NS = 4_000_000  # [DS 6.1.5]
_ANSWER_WINDOW_NS = {250_000: 500_000, 1_000_000: 250_000, 2_000_000: 250_000}  # [DS 7.4.2]


class Transmitter:
    """Sends the payloads in the TX FIFO, waits for acknowledgements, and retransmits."""

    def __init__(self, chip: ChipCore) -> None:
        self._chip = chip
        self._pid = 0
        self._current: TxPayload | None = None
        self._last_sent: TxPayload | None = None
        self._in_tx_since_ns = 0
        self.reuse = False  # REUSE_TX_PL is active
        self.retransmits = 0  # ARC_CNT
        self.packets_lost = 0  # PLOS_CNT

    def next_pid(self) -> int:
        """The PID for each payload written over SPI, and for each reuse."""
        self._pid = self._pid + 1 & 3
        return self._pid

    def has_work(self) -> bool:
        """Whether there is something to send and MAX_RT is not set."""
        return self._chip.tx_fifo.oldest is not None and not self._chip.flags & MAX_RT.mask

    def payload_written(self) -> None:
        """A payload was written to the FIFO; with CE high it is sent at once."""
        self.reuse = False
        if self._chip.state is State.STANDBY_II and self.has_work():
            self.start(SETTLING_NS)

    def ce_rose(self) -> None:
        if self._chip.flags & MAX_RT.mask and self._chip.tx_fifo.oldest is not None:
            self._chip.warn("CE high while MAX_RT is set: nothing is sent")
        elif self.reuse:
            again = self._chip.tx_fifo.oldest
            if again is None and self._last_sent is not None:
                last = self._last_sent
                again = TxPayload(last.payload, no_ack=last.no_ack)
                self._chip.tx_fifo.push_back(again)
            if again is not None:
                again.pid = self.next_pid()

    def start(self, settling_ns: int) -> None:
        """Send the oldest payload, as a new packet."""
        chip = self._chip
        self._current = chip.tx_fifo.oldest
        self.retransmits = 0
        chip.overtake()
        chip.state = State.TX_SETTLING
        if settling_ns:
            self._in_tx_since_ns = chip.clock.now_ns + settling_ns
            chip.after(settling_ns, self._send_frame)
        else:
            self._send_frame()

    def _send_frame(self) -> None:
        chip, packet = self._chip, self._current
        if packet is None or packet is not chip.tx_fifo.oldest:
            chip.settle()  # flushed meanwhile
            return
        registers = chip.registers
        if registers.rate_reserved:
            chip.warn("RF_DR_LOW and RF_DR_HIGH are both set")
        form = registers.tx_format(len(packet.payload))
        no_ack_bit = chip.variant.no_ack_bit if packet.no_ack else 1 - chip.variant.no_ack_bit
        chip.state = State.TX
        chip.transmit(packet.frame(registers.tx_address, form, no_ack_bit), packet)

    def frame_left(self) -> None:
        """The frame has ended; wait for the acknowledgement if one is expected."""
        chip, packet = self._chip, self._current
        if packet is None or packet is not chip.tx_fifo.oldest:
            chip.settle()
            return
        registers = chip.registers
        if not registers.auto_ack[0] or packet.no_ack:
            self._sent(packet)
            self._chain()
            return
        if registers.bits_per_s == 250_000 and registers.ard_ns < 500_000:
            chip.warn("ARD below 500 us at 250 kbit/s: no acknowledgement can arrive in time")
        chip.state = State.ACK_TURN
        chip.after(SETTLING_NS, self._wait_for_answer)
        chip.after(registers.ard_ns, self._no_answer)

    def _wait_for_answer(self) -> None:
        chip = self._chip
        chip.listen(State.ACK_WAIT)
        chip.after(_ANSWER_WINDOW_NS[chip.registers.bits_per_s], self._window_over)

    def _window_over(self) -> None:
        chip = self._chip
        if chip.state is not State.ACK_WAIT:
            return
        until_ns = chip.recognised_until_ns()
        if until_ns is None or until_ns <= chip.clock.now_ns:
            chip.stop_listening()
            chip.state = State.RETRY_WAIT
        else:  # to the end of that frame; if it is broken, the wait is over [DS 7.5.1, Fig. 10]
            chip.after(until_ns - chip.clock.now_ns, self._window_over)

    def _no_answer(self) -> None:
        chip = self._chip
        chip.overtake()
        chip.stop_listening()
        if self._current is None or self._current is not chip.tx_fifo.oldest:
            chip.settle()
        elif self.retransmits < chip.registers.arc:
            self.retransmits += 1
            chip.state = State.TX_SETTLING
            chip.after(SETTLING_NS, self._send_frame)
        else:
            self.packets_lost = min(self.packets_lost + 1, _COUNTER_MAX)
            # Back to standby at any level of CE; continuing requires another rise of CE.
            chip.state = State.STANDBY_I
            chip.set_flags(MAX_RT.mask)
            if chip.registers.receiver:
                chip.settle()

    def answer_arrived(self, frame: Frame) -> bool:
        """A frame with the address of pipe 0 arrived in the wait; returns whether it was valid."""
        chip = self._chip
        answer = frame.decode(chip.registers.ack_formats[0])
        if answer is None:
            return False
        packet = self._current
        flags = 0
        if answer.payload and not chip.rx_fifo.full:
            chip.rx_fifo.push(Incoming(0, answer.payload, len(answer.payload)))
            flags = RX_DR.mask
        if packet is not None and packet is chip.tx_fifo.oldest:
            self._sent(packet)
        chip.set_flags(flags)
        chip.settle()
        return True

    def _sent(self, packet: TxPayload) -> None:
        self._last_sent = packet
        self._chip.tx_fifo.remove(packet)
        self._chip.set_flags(TX_DS.mask)

    def _chain(self) -> None:
        """After a frame without acknowledgement the next one needs no settling [Fig. 10]."""
        chip = self._chip
        if chip.clock.now_ns - self._in_tx_since_ns > _LONGEST_TX_NS:
            chip.warn("in TX for more than 4 ms")
        if chip.ce.value and not chip.registers.receiver and self.has_work():
            self.start(0)
        else:
            chip.settle()


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
