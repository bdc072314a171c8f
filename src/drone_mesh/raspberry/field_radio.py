"""FieldRadio: one radio without a mesh, for the field tools. One thread uses it."""

from __future__ import annotations

import contextlib
import itertools
from typing import NamedTuple

from drone_mesh.channel.runtime import Runtime
from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.link import ChipLink
from drone_mesh.nrf24.pins import CePin, SpiDevice
from drone_mesh.nrf24.registers import (
    ARC,
    ARC_CNT,
    ARD,
    ERX,
    MAX_RT,
    RX_EMPTY,
    STATUS_FLAGS,
    TX_DS,
    Command,
    Register,
    ard_s,
)
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.nrf24.transceiver import POWER_UP_S

TEST_TYPE = 255  # type of the field tools' packets; no node processes it
RPD_VALID_S = 250e-6  # settling 130 us and 40 us of signal [DS 6.4], plus a margin
SWITCH_S = 505e-6  # an acknowledgement that is being sent must not be cut off
SEND_WITHIN_S = 95e-3  # the longest transaction takes 87.1 ms
LEAST_POLLS = 50  # on a busy machine the time may pass while this process is paused
_POLL_S = 100e-6


class Sent(NamedTuple):
    """The outcome of one packet."""

    acknowledged: bool
    retransmits: int


class FieldRadio:
    """A radio with the registers of a node, from `set_up` to `close`."""

    def __init__(
        self, spi: SpiDevice, ce: CePin, node_id: int, settings: RadioSettings, runtime: Runtime
    ) -> None:
        self.link = ChipLink(spi)
        self.settings = settings
        self.node_id = node_id
        self.runtime = runtime
        self._spi, self._ce = spi, ce
        self._registers = settings.registers(node_id)

    def set_up(self) -> None:
        """Write and verify all registers, then listen. RadioError if the chip does not answer."""
        self._ce.value = False
        self.link.write_byte(Register.CONFIG, self.settings.config_power_down)
        self.link.write_and_verify(self._registers)
        for command in (Command.FLUSH_TX, Command.FLUSH_RX):
            self.link.command(command)
        self.link.write_byte(Register.STATUS, STATUS_FLAGS)
        self.link.write_byte(Register.CONFIG, self.settings.config_listening)
        self.runtime.sleep(POWER_UP_S)
        self._ce.value = True

    def stand_by(self) -> None:
        """Neither send nor listen, until the next `set_up`."""
        self._ce.value = False

    def close(self) -> None:
        """Power the radio down and release the devices."""
        self._ce.value = False
        with contextlib.suppress(RadioError):  # the chip is gone: nothing is left to power down
            self.link.write_byte(Register.CONFIG, self.settings.config_power_down)
        self._ce.close()
        self._spi.close()

    def changed_register(self) -> str:
        """The name of a register that lost its setting; empty: none."""
        wrong = self.link.first_difference(self._registers)
        return wrong[0].name if wrong is not None else ""

    def hears_carrier(self, channel: int) -> bool:
        """Whether a signal of more than -64 dBm is on a channel now (RPD)."""
        self._ce.value = False
        self.link.write_byte(Register.RF_CH, channel)
        self._ce.value = True
        self.runtime.sleep(RPD_VALID_S)
        self._ce.value = False  # latches RPD
        return bool(self.link.read_byte(Register.RPD) & 1)

    def back_to_channel(self) -> None:
        """Listen on the channel of the settings again."""
        self._ce.value = False
        self.link.write_byte(Register.RF_CH, self.settings.channel)
        self._ce.value = True

    def use(self, settings: RadioSettings) -> None:
        """Use these settings from now on. Raises RadioError if the chip does not support them."""
        self.settings = settings
        self._registers = settings.registers(self.node_id)
        self.set_up()

    def send(self, to: bytes, payload: bytes, retransmits: int = 0) -> Sent:
        """Send with acknowledgement. Raises RadioError if the chip keeps the packet."""
        return self._transmit(Command.W_TX_PAYLOAD, to, payload, retransmits)

    def broadcast(self, payload: bytes, *, keep_flags: bool = False) -> None:
        """Send without acknowledgement. Raises RadioError if the chip keeps the packet.

        `keep_flags` leaves TX_DS set, and so the IRQ pin low, until `clear_flags`.
        """
        address = self.settings.broadcast_address
        self._transmit(Command.W_TX_PAYLOAD_NO_ACK, address, payload, 0, keep_flags)

    def clear_flags(self) -> None:
        """Clear all flags, which releases the IRQ pin."""
        self.link.write_byte(Register.STATUS, STATUS_FLAGS)

    def receive(self) -> bytes | None:
        """The oldest payload, or None."""
        if self.link.read_byte(Register.FIFO_STATUS) & RX_EMPTY.mask:
            return None
        payload = self.link.command(Command.R_RX_PAYLOAD, bytes(PAYLOAD_BYTES))
        self.link.write_byte(Register.STATUS, STATUS_FLAGS)
        return payload

    def _transmit(
        self,
        command: Command,
        to: bytes,
        payload: bytes,
        retransmits: int,
        keep_flags: bool = False,
    ) -> Sent:
        link = self.link
        self._ce.value = False
        self.runtime.sleep(SWITCH_S)
        delay = ARD.put(self.settings.retransmit_delay)
        link.write_byte(Register.SETUP_RETR, ARC.put(retransmits, delay))
        link.write_byte(Register.CONFIG, self.settings.config_sending)
        link.write(Register.TX_ADDR, to)
        link.write(Register.RX_ADDR_P0, to)
        link.write_byte(Register.EN_RXADDR, self.settings.listening_pipes | ERX[0].mask)
        link.command(command, payload)
        self._ce.value = True
        try:
            flags = self._wait_for_end(ard_s(self.settings.retransmit_delay) * retransmits)
        finally:
            self._ce.value = False
            link.command(Command.FLUSH_TX)
        tries = ARC_CNT.get(link.read_byte(Register.OBSERVE_TX))
        if not keep_flags:
            self.clear_flags()
        link.write_byte(Register.EN_RXADDR, self.settings.listening_pipes)
        link.write(Register.SETUP_RETR, self._registers[Register.SETUP_RETR])
        link.write_byte(Register.CONFIG, self.settings.config_listening)
        self._ce.value = True
        return Sent(bool(flags & TX_DS.mask), tries)

    def _wait_for_end(self, retransmits_s: float) -> int:
        until_s = self.runtime.now_s() + SEND_WITHIN_S + retransmits_s
        for polls in itertools.count(1):
            is_over = polls > LEAST_POLLS and self.runtime.now_s() >= until_s
            self.link.command(Command.NOP)
            if self.link.status & (TX_DS.mask | MAX_RT.mask):
                return self.link.status
            if is_over:
                break
            self.runtime.sleep(_POLL_S)
        raise RadioError(
            "the radio reported a packet neither sent nor failed: is CE wired, and --ce right?"
        )
