"""FieldRadio: one radio without a mesh, for the field tools. One thread uses it."""

from __future__ import annotations

import contextlib

from drone_mesh.channel.radio import Try
from drone_mesh.channel.runtime import Runtime
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.link import ChipLink
from drone_mesh.nrf24.pins import CePin, SpiDevice
from drone_mesh.nrf24.registers import Command, Register
from drone_mesh.nrf24.settings import BroadcastMode, RadioSettings
from drone_mesh.nrf24.transceiver import Transceiver

TEST_TYPE = 255  # type of the field tools' packets; no node processes it
RPD_VALID_S = 250e-6  # settling 130 us and 40 us of signal [DS 6.4], plus a margin
SWITCH_S = 505e-6  # an acknowledgement that is being sent must not be cut off


class FieldRadio:
    """A radio with the registers of a node, from `set_up` to `close`."""

    def __init__(
        self, spi: SpiDevice, ce: CePin, node_id: int, settings: RadioSettings, runtime: Runtime
    ) -> None:
        self.link = ChipLink(spi)
        self.node_id = node_id
        self.runtime = runtime
        self._spi, self._ce = spi, ce
        self._drive_with(settings)

    def _drive_with(self, settings: RadioSettings) -> None:
        self.settings = settings
        self._chip = Transceiver(
            self._spi, self._ce, self.node_id, settings, self.runtime, RadioStatistics()
        )

    def use(self, settings: RadioSettings) -> None:
        """Use these settings from now on. Raises RadioError if the chip does not support them."""
        self._drive_with(settings)
        self.set_up()

    def set_up(self) -> None:
        """Write and verify all registers, then listen. RadioError if the chip does not answer."""
        self._chip.set_up()

    def stand_by(self) -> None:
        """Neither send nor listen, until the next `set_up`."""
        self._ce.value = False

    def close(self) -> None:
        with contextlib.suppress(RadioError):  # the chip is gone: nothing is left to power down
            self._chip.power_down()
        self._ce.close()
        self._spi.close()

    def changed_register(self) -> str:
        """The name of a register that lost its setting; empty: none."""
        wrong = self.link.first_difference(self.settings.registers(self.node_id))
        return wrong[0].name if wrong is not None else ""

    def hears_carrier(self, channel: int) -> bool:
        """Whether a signal of more than -64 dBm is on a channel now (RPD)."""
        self._ce.value = False
        self.link.write_byte(Register.RF_CH, channel)
        self._ce.value = True
        self.runtime.sleep(RPD_VALID_S)
        self._ce.value = False  # latches RPD
        return self._chip.received_power()

    def back_to_channel(self) -> None:
        """Listen on the channel of the settings again."""
        self._ce.value = False
        self.link.write_byte(Register.RF_CH, self.settings.channel)
        self._ce.value = True

    def send(self, to: bytes, payload: bytes, retransmits: int = 0) -> Try:
        """Send with acknowledgement. Raises RadioError if the chip keeps the packet."""
        self._chip.become_transmitter(to)
        self._chip.load(to, payload)
        self._chip.set_retries(self.settings.retransmit_delay, retransmits)
        sent = self._chip.transmit()
        self._chip.listen()
        return sent

    def broadcast(self, payload: bytes) -> None:
        """Send without acknowledgement. Raises RadioError if the chip keeps the packet."""
        self._chip.transmit_to_all(payload)

    def raise_flag(self) -> None:
        """Send a packet and leave its flag set, and so the IRQ pin low, until `set_up`."""
        self._chip.become_transmitter(self.settings.broadcast_address)
        # A chip without "+" knows no packets without acknowledgement; it raises MAX_RT soon after.
        plain = self.settings.broadcast_mode is BroadcastMode.SHOCKBURST
        command = Command.W_TX_PAYLOAD if plain else Command.W_TX_PAYLOAD_NO_ACK
        self.link.command(command, bytes(PAYLOAD_BYTES))
        self._ce.value = True
        self.runtime.sleep(2 * self.settings.broadcast_s)
        self._ce.value = False

    def receive(self) -> bytes | None:
        """The oldest payload, or None."""
        inbox = self._chip.inbox
        return inbox.popleft().payload if inbox or self._chip.drain() else None
