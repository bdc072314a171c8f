"""The common part of the engines and SPI commands of an emulated chip.

Pins, variants, faults and states of chips; `ChipCore` with registers, FIFOs, flags, timers and the
antenna. `chip.py` decides on power states; receiver, transmitter and commands use ChipCore and do
not depend on the whole chip.
"""

from __future__ import annotations

import abc
import enum
from dataclasses import dataclass
from typing import Callable

from drone_mesh.nrf24.emulator.air import RPD_DBM, Air, Transmission
from drone_mesh.nrf24.emulator.clock import EmulatorClock
from drone_mesh.nrf24.emulator.fifos import RxFifo, TxFifo
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.emulator.register_bank import RegisterBank
from drone_mesh.nrf24.emulator.space import Position
from drone_mesh.nrf24.registers import (
    POWER_UP_NS,
    PREAMBLE_BITS,
    RX_FIFO_IS_EMPTY,
    RX_P_NO,
    SETTLING_NS,
)


class EmulatedCe:
    """Chip enable, an output of the host. Also usable as a DigitalInOut of CircuitPython."""

    def __init__(self, clock: EmulatorClock, changed: Callable[[bool], None]) -> None:
        self._clock = clock
        self._changed = changed
        self._value = False

    @property
    def value(self) -> bool:
        return self._value

    @value.setter
    def value(self, high: bool) -> None:
        with self._clock.access():
            if bool(high) != self._value:
                self._value = bool(high)
                self._changed(self._value)

    def switch_to_output(self, value: bool = False) -> None:
        """Called by CircuitPython drivers at the start."""
        self.value = value

    def close(self) -> None:
        """Does nothing; the level stays."""


class EmulatedIrq:
    """Interrupt request, an input of the host: low while an unmasked flag is set."""

    def __init__(self, clock: EmulatorClock) -> None:
        self._clock = clock
        self._signal = clock.runtime.signal()
        self.value = True  # the level of the pin
        self.fell_ns: int | None = None  # when it last went low

    def wait_low(self, timeout_s: float) -> bool:
        """Wait until the pin is low; returns False if it is still high after the time-out."""
        return self._signal.wait_for(lambda: not self.value, timeout_s)

    def set(self, high: bool) -> None:
        """Set the level, by the chip; called with access."""
        if high != self.value:
            self.value = high
            if not high:
                self.fell_ns = self._clock.now_ns
                self._signal.notify()

    def close(self) -> None:
        """Does nothing."""


@dataclass(frozen=True)
class ChipVariant:
    """Properties of a chip. The defaults are those of a genuine nRF24L01+.

    There is a switch for each behaviour that no source settles.
    """

    plus: bool = True  # False: no 250 kbit/s; ACTIVATE 0x73 must unlock FEATURE and DYNPD
    power_up_ns: int = POWER_UP_NS  # Tpd2stby, depends on the crystal
    no_ack_bit: int = 1  # on the air, for "do not acknowledge": 1 by the datasheet, 0 in nRF5 chips
    duplicates_by_pipe: bool = True  # False: one memory of the last PID and CRC for all pipes
    partial_read_removes: bool = False  # True: a payload that was read in part leaves the FIFO


@dataclass
class ChipFaults:
    """The current faults; may be changed at any time."""

    miso_stuck_at: int | None = None  # 0x00 or 0xFF: nothing answers, or nothing is connected
    irq_stuck_at: bool | None = None  # level of the pin
    dead_transmitter: bool = False
    dead_receiver: bool = False
    next_width: int | None = None  # R_RX_PL_WID, once: as for a broken frame that passed the CRC


class State(enum.Enum):
    """The current activity of the chip [DS 6.1, Fig. 4] and its engine [DS 7.5, Fig. 10, 11]."""

    POWER_DOWN = "power down"
    STARTING = "starting"  # Tpd2stby
    STANDBY_I = "standby-I"
    STANDBY_II = "standby-II"
    RX_SETTLING = "RX settling"
    RX = "RX"
    TX_SETTLING = "TX settling"
    TX = "TX"
    ACK_TURN = "turning to RX for the acknowledgement"
    ACK_WAIT = "waiting for the acknowledgement"
    RETRY_WAIT = "waiting to send again"
    ANSWER_SETTLING = "turning to TX for the acknowledgement"
    ANSWER = "sending the acknowledgement"


IDLE = frozenset((State.STANDBY_I, State.STANDBY_II, State.RX_SETTLING, State.RX))
SENDING = frozenset((State.TX_SETTLING, State.TX, State.ACK_TURN, State.ACK_WAIT, State.RETRY_WAIT))
ANSWERING = frozenset((State.ANSWER_SETTLING, State.ANSWER))


class ChipCore(abc.ABC):
    """The part of a chip that its engines need. An `air.Antenna`."""

    def __init__(self, air: Air, name: str, position: Position, variant: ChipVariant) -> None:
        self.air = air
        self.clock = air.clock
        self.name = name
        self.variant = variant
        self.faults = ChipFaults()
        self.warnings: list[str] = []
        self._warned: set[str] = set()
        self._position = position
        self.registers = RegisterBank(variant.plus)
        self.rx_fifo = RxFifo(variant.partial_read_removes)
        self.tx_fifo = TxFifo()
        self.flags = 0  # RX_DR, TX_DS and MAX_RT, at their positions in STATUS
        self.state = State.POWER_DOWN
        self.listening_since_ns: int | None = None
        self._listening_to = (0, 0)  # channel and rate
        self.transmission: Transmission | None = None  # its own frame on the air
        self.ce_rose_ns = -SETTLING_NS
        self._epoch = 0  # timers of an earlier epoch are void
        # RPD as a valid packet or the end of listening left it; None: the state of the channel.
        self.rpd_latched: bool | None = False
        self.ce = EmulatedCe(self.clock, self._ce_changed)
        self.irq = EmulatedIrq(self.clock)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}: {self.state.value}>"

    @property
    def position(self) -> Position:
        """The position of its antenna, in metres."""
        return self._position

    @position.setter
    def position(self, position: Position) -> None:
        with self.clock.access():
            if position != self._position:
                self._position = position
                self.air.moved()

    def warn(self, text: str) -> None:
        """Record a misuse once."""
        if text not in self._warned:
            self._warned.add(text)
            self.warnings.append(text)

    # -- decided by the whole chip --------------------------------------------------------------

    @abc.abstractmethod
    def settle(self) -> None:
        """Start what CONFIG and CE request, now that the chip is idle."""

    @abc.abstractmethod
    def config_written(self, was_powered: bool, was_receiver: bool) -> None:
        """CONFIG has changed."""

    @abc.abstractmethod
    def frame_arrived(self, frame: Frame, power_dbm: float) -> None:
        """A recognised frame has ended; its bits may be damaged."""

    @abc.abstractmethod
    def frame_left(self) -> None:
        """The chip's own frame has ended."""

    @abc.abstractmethod
    def _ce_changed(self, high: bool) -> None:
        """The level of the CE pin has changed."""

    # -- flags ---------------------------------------------------------------------------------

    def status(self) -> int:
        oldest = self.rx_fifo.oldest
        pipe = RX_FIFO_IS_EMPTY if oldest is None else oldest.pipe
        return self.flags | pipe << RX_P_NO.lsb | self.tx_fifo.full

    def set_flags(self, flags: int) -> None:
        """Raise some of RX_DR, TX_DS, MAX_RT."""
        self.flags |= flags
        self.update_irq()

    def clear_flags(self, flags: int) -> None:
        self.flags &= ~flags
        self.update_irq()

    def update_irq(self) -> None:
        """The pin is low while a flag is set that CONFIG does not mask."""
        stuck = self.faults.irq_stuck_at
        high = not self.flags & self.registers.irq_sources if stuck is None else stuck
        self.irq.set(high)

    # -- timers ------------------------------------------------------------------------------

    def after(self, delay_ns: int, step: Callable[[], None]) -> None:
        """Schedule the next step of the current activity, unless it is cancelled before."""
        self.clock.call_at(self.clock.now_ns + delay_ns, self._step, self._epoch, step)

    def _step(self, epoch: int, step: Callable[[], None]) -> None:
        if epoch == self._epoch:
            step()

    def overtake(self) -> None:
        """Void all pending steps."""
        self._epoch += 1

    # -- air -----------------------------------------------------------------------------------

    def listen(self, state: State) -> None:
        """The receiver has settled."""
        self.state = state
        self.rpd_latched = None
        self._listening_to = (self.registers.channel, self.registers.bits_per_s)
        self.air.listen(self, *self._listening_to)

    def stop_listening(self) -> None:
        """The receiver is switched off; RPD keeps its last value."""
        if self.listening_since_ns is not None:
            self.rpd_latched = self.rpd()
            self.air.stop_listening(self, *self._listening_to)

    def retune(self) -> None:
        """Channel or rate changed: frames on the air now are lost."""
        if self.listening_since_ns is not None:
            self.stop_listening()
            self.listen(self.state)

    def rpd(self) -> bool:
        """Received power detector: above -64 dBm now, when a packet arrived, or at the end."""
        if self.rpd_latched is not None:
            return self.rpd_latched
        if self.listening_since_ns is None:
            return False
        channel, bits_per_s = self._listening_to
        return self.air.energy_dbm(self, channel, bits_per_s, self.listening_since_ns) > RPD_DBM

    def transmit(self, frame: Frame, packet: object) -> None:
        """Send a frame; `frame_left` is called at its end."""
        registers = self.registers
        power_dbm = -300.0 if self.faults.dead_transmitter else float(registers.tx_dbm)
        radio = (registers.channel, registers.bits_per_s, power_dbm)
        self.transmission = self.air.transmit(self, frame, radio, packet)
        if self.faults.dead_transmitter:
            self.transmission.listeners = ()

    def recognises(self, frame: Frame) -> bool:
        registers = self.registers
        if self.faults.dead_receiver:
            return False
        address = frame.address(registers.address_bytes)
        if self.state is State.ACK_WAIT:
            return registers.pipe_of_address.get(address) == 0  # acknowledgements
        return address in registers.pipe_of_address

    def abort(self) -> None:
        """Stop all activity, including a frame on the air."""
        self.overtake()
        self.stop_listening()
        if self.transmission is not None:
            self.air.abort(self.transmission)
            self.transmission = None

    def recognised_until_ns(self) -> int | None:
        """End of the incoming recognised frame, or None."""
        registers = self.registers
        address_bits = PREAMBLE_BITS + 8 * registers.address_bytes
        return self.air.recognised_until_ns(self, registers.channel, address_bits)
