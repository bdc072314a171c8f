"""An nRF24L01+ in software: power states, CE and IRQ, and what its two engines share.

The transmitter (PTX), the receiver (PRX) and the SPI commands have modules of their own. Only the
holder of the clock's access may touch the chip. Misuse is never refused, only recorded in
`warnings`.
"""

from __future__ import annotations

from typing import Callable

from drone_mesh.nrf24.airtime import CE_PULSE_MIN_NS, CE_TO_CSN_NS, SETTLING_NS
from drone_mesh.nrf24.emulator.air import RPD_DBM, Air, Flight, Position
from drone_mesh.nrf24.emulator.commands import CommandDecoder
from drone_mesh.nrf24.emulator.fifos import RxFifo, TxFifo
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.emulator.pins import EmulatedCe, EmulatedIrq
from drone_mesh.nrf24.emulator.quirks import ChipVariant, Faults
from drone_mesh.nrf24.emulator.receiver import Receiver
from drone_mesh.nrf24.emulator.register_bank import RegisterBank
from drone_mesh.nrf24.emulator.spi import EmulatedSpiDev
from drone_mesh.nrf24.emulator.states import ANSWERING, IDLE, SENDING, State
from drone_mesh.nrf24.emulator.transmitter import Transmitter
from drone_mesh.nrf24.registers import RX_FIFO_IS_EMPTY, RX_P_NO


class EmulatedChip:
    """One chip at one place, switched on long ago: in power down, registers as after reset."""

    def __init__(
        self,
        air: Air,
        name: str,
        position: Position = (0.0, 0.0, 0.0),
        variant: ChipVariant = ChipVariant(),  # noqa: B008 (frozen)
    ) -> None:
        self.air = air
        self.clock = air.clock
        self.name = name
        self.variant = variant
        self.faults = Faults()
        self.warnings: list[str] = []
        self._warned: set[str] = set()
        self._position = position
        self.registers = RegisterBank()
        self.rx_fifo = RxFifo(variant.partial_read_removes)
        self.tx_fifo = TxFifo()
        self.flags = 0  # RX_DR, TX_DS and MAX_RT, where they stand in STATUS
        self.state = State.POWER_DOWN
        self.listening_since_ns: int | None = None
        self._listening_to = (0, 0)  # channel and rate
        self.flight: Flight | None = None  # the own frame that is on the air
        self._ce_rose_ns = -SETTLING_NS
        self._epoch = 0  # timers of an earlier epoch are void
        self._rpd_latched = False
        self.ce = EmulatedCe(self.clock, self._ce_changed)
        self.irq = EmulatedIrq(self.clock)
        self.transmitter = Transmitter(self)
        self.receiver = Receiver(self)
        self.commands = CommandDecoder(self)
        self.spi = EmulatedSpiDev(self.clock, self)

    def __repr__(self) -> str:
        return f"<EmulatedChip {self.name}: {self.state.value}>"

    @property
    def position(self) -> Position:
        """Where its antenna is, in metres."""
        return self._position

    @position.setter
    def position(self, position: Position) -> None:
        with self.clock.access():
            if position != self._position:
                self._position = position
                self.air.moved()

    def brown_out(self) -> None:
        """The supply fails for a moment: everything is as after power-on."""
        with self.clock.access():
            self._abort()
            self.registers.reset()
            self.rx_fifo.flush()
            self.tx_fifo.flush()
            self.flags = 0
            self.state = State.POWER_DOWN
            self.transmitter = Transmitter(self)
            self.receiver = Receiver(self)
            self.commands = CommandDecoder(self)
            self.update_irq()

    def warn(self, text: str) -> None:
        """Record a misuse, once."""
        if text not in self._warned:
            self._warned.add(text)
            self.warnings.append(text)

    # -- SPI ---------------------------------------------------------------------------------

    def chip_selected(self) -> int:
        stuck = self.faults.miso_stuck_at
        if stuck is not None:
            return stuck
        if self.ce.value and self.clock.now_ns - self._ce_rose_ns < CE_TO_CSN_NS:
            self.warn("CSN low less than 4 us after CE rose (Tpece2csn)")
        return self.status()

    def chip_deselected(self, mosi: bytes) -> bytes:
        stuck = self.faults.miso_stuck_at
        if stuck is not None:
            return bytes((stuck,)) * (len(mosi) - 1)
        return self.commands.execute(mosi)

    def status(self) -> int:
        """The STATUS register as it is now."""
        oldest = self.rx_fifo.oldest
        pipe = RX_FIFO_IS_EMPTY if oldest is None else oldest.pipe
        return self.flags | pipe << RX_P_NO.lsb | self.tx_fifo.full

    def set_flags(self, flags: int) -> None:
        """Raise some of RX_DR, TX_DS, MAX_RT."""
        self.flags |= flags
        self.update_irq()

    def clear_flags(self, flags: int) -> None:
        """Clear some of them."""
        self.flags &= ~flags
        self.update_irq()

    def update_irq(self) -> None:
        """The pin is low while a flag is set that CONFIG does not mask."""
        stuck = self.faults.irq_stuck_at
        high = not self.flags & self.registers.irq_sources if stuck is None else stuck
        self.irq.set(high)

    # -- timers and states ---------------------------------------------------------------------

    def after(self, delay_ns: int, step: Callable[[], None]) -> None:
        """Schedule the next step of the current activity, unless it is overtaken."""
        self.clock.call_at(self.clock.now_ns + delay_ns, self._step, self._epoch, step)

    def _step(self, epoch: int, step: Callable[[], None]) -> None:
        if epoch == self._epoch:
            step()

    def overtake(self) -> None:
        """Void all pending steps."""
        self._epoch += 1

    def settle(self) -> None:
        """Start what CONFIG and CE request, now that the chip is idle."""
        self.overtake()
        self.stop_listening()
        if self.registers.receiver:
            if self.ce.value:
                self.state = State.RX_SETTLING
                self.after(SETTLING_NS, self.receiver.listen)
            else:
                self.state = State.STANDBY_I
        elif not self.ce.value:
            self.state = State.STANDBY_I
        elif self.transmitter.has_work():
            self.transmitter.start(SETTLING_NS)
        else:
            self.state = State.STANDBY_II

    def config_written(self, was_powered: bool, was_receiver: bool) -> None:
        """CONFIG has changed."""
        registers = self.registers
        self.update_irq()
        if not registers.powered:
            if was_powered:
                self._abort()
                self.state = State.POWER_DOWN
        elif not was_powered:
            self.state = State.STARTING
            if self.ce.value:
                self.warn("CE high before Tpd2stby was over")
            self.after(self.variant.power_up_ns, self.settle)
        elif registers.receiver != was_receiver:
            if self.state in IDLE:
                if self.ce.value:
                    self.warn("PRIM_RX changed while CE is high")
                self.settle()
            elif self.state in SENDING or self.state in ANSWERING:
                self.warn("PRIM_RX changed while a packet is under way")

    def _ce_changed(self, high: bool) -> None:
        if high:
            self._ce_rose_ns = self.clock.now_ns
            if self.state is State.STARTING:
                self.warn("CE high before Tpd2stby was over")
            elif self.state is State.STANDBY_I:
                if not self.registers.receiver:
                    self.transmitter.ce_rose()
                self.settle()
        elif self.state is State.TX_SETTLING and self._ce_pulse_was_short():
            self.warn("CE pulse shorter than 10 us (Thce)")
            self.overtake()
            self.state = State.STANDBY_I
        elif self.state in IDLE:
            self.settle()

    def _ce_pulse_was_short(self) -> bool:
        return self.clock.now_ns - self._ce_rose_ns < CE_PULSE_MIN_NS

    def _abort(self) -> None:
        self.overtake()
        self.stop_listening()
        if self.flight is not None:
            self.air.abort(self.flight)
            self.flight = None

    # -- air -----------------------------------------------------------------------------------

    def listen(self, state: State) -> None:
        """The receiver has settled."""
        self.state = state
        self._rpd_latched = False
        self._listening_to = (self.registers.channel, self.registers.bits_per_s)
        self.air.listen(self, *self._listening_to)

    def stop_listening(self) -> None:
        """The receiver is switched off; RPD keeps what it saw last."""
        if self.listening_since_ns is not None:
            self._rpd_latched = self.rpd()
            self.air.stop_listening(self, *self._listening_to)

    def retune(self) -> None:
        """Channel or rate changed: frames on the air now are lost."""
        if self.listening_since_ns is not None:
            self.stop_listening()
            self.listen(self.state)

    def rpd(self) -> bool:
        """Received power detector: more than -64 dBm now, or when a packet came, or at the end."""
        if self._rpd_latched or self.listening_since_ns is None:
            return self._rpd_latched
        channel = self._listening_to[0]
        return self.air.energy_dbm(self, channel, self.listening_since_ns) > RPD_DBM

    def transmit(self, frame: Frame, packet: object) -> None:
        """Put a frame on the air; `frame_left` is called at its end."""
        registers = self.registers
        power_dbm = -300.0 if self.faults.dead_transmitter else float(registers.tx_dbm)
        radio = (registers.channel, registers.bits_per_s, power_dbm)
        self.flight = self.air.transmit(self, frame, radio, packet)
        if self.faults.dead_transmitter:
            self.flight.listeners = ()

    def recognises(self, frame: Frame) -> bool:
        registers = self.registers
        if self.faults.dead_receiver:
            return False
        address = frame.address(registers.address_bytes)
        if self.state is State.ACK_WAIT:
            return registers.pipe_of_address.get(address) == 0  # acknowledgements
        return address in registers.pipe_of_address

    def frame_arrived(self, frame: Frame, power_dbm: float) -> None:
        if self.state is State.ACK_WAIT:
            taken = self.transmitter.answer_arrived(frame)
        else:
            taken = self.receiver.frame_arrived(frame)
        if taken and power_dbm > RPD_DBM:
            self._rpd_latched = True

    def frame_left(self) -> None:
        self.flight = None
        if self.state is State.ANSWER:
            self.settle()
        else:
            self.transmitter.frame_left()
