"""An nRF24L01+ in software: its power states, SPI and CE, and its engines combined.

The transmitter (PTX), the receiver (PRX) and the SPI commands have their own modules and share
`chip_core.py`. Only the holder of the clock's access may touch the chip. Misuse is never refused,
only recorded in `warnings`.
"""

from __future__ import annotations

from typing import Sequence

from drone_mesh.nrf24.emulator.air import RPD_DBM, Air
from drone_mesh.nrf24.emulator.chip_core import (
    ANSWERING,
    IDLE,
    SENDING,
    ChipCore,
    ChipVariant,
    State,
)
from drone_mesh.nrf24.emulator.commands import CommandDecoder
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.emulator.shockburst import Receiver, Transmitter
from drone_mesh.nrf24.emulator.space import Position
from drone_mesh.nrf24.registers import CE_PULSE_MIN_NS, CE_TO_CSN_NS, SETTLING_NS

_FASTEST_HZ = 10_000_000  # of SPI [DS 8.3.2]
_BITS_PER_NS = 8 * 1_000_000_000


class EmulatedChip(ChipCore):
    """One chip at one position, powered long ago: in power down, registers as after reset."""

    def __init__(
        self,
        air: Air,
        name: str,
        position: Position = (0.0, 0.0, 0.0),
        variant: ChipVariant = ChipVariant(),  # noqa: B008 (frozen)
    ) -> None:
        super().__init__(air, name, position, variant)
        self.transmitter = Transmitter(self)
        self.receiver = Receiver(self)
        self.commands = CommandDecoder(self, self.transmitter)
        self.spi = EmulatedSpiDev(self)

    def brown_out(self) -> None:
        """The supply fails briefly: everything is as after power-on."""
        with self.clock.access():
            self.abort()
            self.registers.reset()
            self.rx_fifo.flush()
            self.tx_fifo.flush()
            self.flags = 0
            self.state = State.POWER_DOWN
            self.transmitter = Transmitter(self)
            self.receiver = Receiver(self)
            self.commands = CommandDecoder(self, self.transmitter)
            self.update_irq()

    # -- SPI ---------------------------------------------------------------------------------

    def chip_selected(self) -> int:
        """CSN falls; returns STATUS, the first byte sent."""
        stuck = self.faults.miso_stuck_at
        if stuck is not None:
            return stuck
        if self.ce.value and self.clock.now_ns - self.ce_rose_ns < CE_TO_CSN_NS:
            self.warn("CSN low less than 4 us after CE rose (Tpece2csn)")
        return self.status()

    def chip_deselected(self, mosi: bytes) -> bytes:
        """CSN rises and the command takes effect; returns the bytes after STATUS."""
        stuck = self.faults.miso_stuck_at
        if stuck is not None:
            return bytes((stuck,)) * (len(mosi) - 1)
        return self.commands.execute(mosi)

    # -- timers and states ---------------------------------------------------------------------

    def settle(self) -> None:
        self.overtake()
        self.stop_listening()
        if self.registers.receiver:
            if self.ce.value:
                self.state = State.RX_SETTLING
                self.after(SETTLING_NS, lambda: self.listen(State.RX))
            else:
                self.state = State.STANDBY_I
        elif not self.ce.value:
            self.state = State.STANDBY_I
        elif self.transmitter.has_work():
            self.transmitter.start(SETTLING_NS)
        else:
            self.state = State.STANDBY_II

    def config_written(self, was_powered: bool, was_receiver: bool) -> None:
        registers = self.registers
        self.update_irq()
        if not registers.powered:
            if was_powered:
                self.abort()
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
            self.ce_rose_ns = self.clock.now_ns
            if self.state is State.STARTING:
                self.warn("CE high before Tpd2stby was over")
            elif self.state is State.STANDBY_I:
                if not self.registers.receiver:
                    self.transmitter.ce_rose()
                self.settle()
        elif (
            self.state is State.TX_SETTLING
            and not self.transmitter.retransmits  # CE no longer matters then [DS Fig. 17]
            and self._ce_pulse_was_short()
        ):
            self.warn("CE pulse shorter than 10 us (Thce)")
            self.overtake()
            self.state = State.STANDBY_I
        elif self.state in IDLE:
            self.settle()

    def _ce_pulse_was_short(self) -> bool:
        return self.clock.now_ns - self.ce_rose_ns < CE_PULSE_MIN_NS

    # -- air -----------------------------------------------------------------------------------

    def frame_arrived(self, frame: Frame, power_dbm: float) -> None:
        if self.state is State.ACK_WAIT:
            taken = self.transmitter.answer_arrived(frame)
        else:
            taken = self.receiver.frame_arrived(frame)
        if taken:
            self.rpd_latched = power_dbm > RPD_DBM  # even if a stronger frame came before

    def frame_left(self) -> None:
        self.transmission = None
        if self.state is State.ANSWER:
            self.settle()
        else:
            self.transmitter.frame_left()


class EmulatedSpiDev:
    """The SPI device in front of the chip, as spidev.SpiDev shows it.

    One transfer is one period of CSN low; it takes as long as its bits.
    """

    def __init__(self, chip: EmulatedChip) -> None:
        self._chip = chip
        self._busy = False
        self.max_speed_hz = 8_000_000
        self.mode = 0
        self.no_cs = False

    def open(self, bus: int, device: int) -> None:
        """Any bus and device select the one chip of this object."""

    def close(self) -> None:
        """Nothing to release."""

    def xfer2(self, data: Sequence[int], speed_hz: int = 0) -> list[int]:
        """Clock out `data` and return the bytes received: STATUS, then the answer."""
        chip, clock = self._chip, self._chip.clock
        speed_hz = speed_hz or self.max_speed_hz
        with clock.access():
            if self._busy:
                chip.warn("two SPI transfers at once")
            if speed_hz > _FASTEST_HZ or self.mode != 0:
                chip.warn("SPI must be mode 0 with at most 10 MHz")
            self._busy = True
            status = chip.chip_selected()
        clock.elapse(len(data) * _BITS_PER_NS // speed_hz)
        with clock.access():
            answer = chip.chip_deselected(bytes(data))
            self._busy = False
        return [status, *answer]
