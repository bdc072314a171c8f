"""The sequences of SPI transfers that the driver is made of; no threads, no second tries."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.nrf24.airtime import ard_s
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.gpio import CePin
from drone_mesh.nrf24.link import ChipLink
from drone_mesh.nrf24.registers import (
    ARC,
    ARC_CNT,
    ARD,
    ENAA,
    ERX,
    MAX_PAYLOAD_BYTES,
    MAX_RT,
    RX_DR,
    RX_EMPTY,
    RX_P_NO,
    STATUS_FLAGS,
    TX_DS,
    Command,
    Register,
)
from drone_mesh.nrf24.runtime import Runtime
from drone_mesh.nrf24.settings import (
    BROADCAST_PIPE,
    BroadcastMode,
    DataRate,
    RadioSettings,
)
from drone_mesh.nrf24.spi import SpiDevice
from drone_mesh.nrf24.statistics import RadioStatistics

POWER_UP_S = 5e-3  # Tpd2stby is up to 4.5 ms, depending on the crystal [DS Table 16]
CE_PULSE_S = 20e-6  # Thce is 10 us; a pulse sends one packet, and cannot keep the chip in TX
CE_TO_CSN_S = 5e-6  # Tpece2csn is 4 us
TIMEOUT_S = 95e-3  # the longest transaction takes 87.1 ms
_DRAIN_LIMIT = 32  # payloads at a time; the FIFO holds three, more keep coming only while we read
# How long an acknowledgement that is being sent may still need after CE went low.
TX_DELAY_S = {DataRate.KBPS_250: 505e-6, DataRate.MBPS_1: 280e-6, DataRate.MBPS_2: 240e-6}


class Received(NamedTuple):
    """A payload, and the pipe it came through."""

    pipe: int
    payload: bytes


class Transceiver:
    """One chip. Everything raises RadioError when it does not answer as it should.

    Belongs to the thread that holds the driver's lock, except that `inbox` may be emptied by
    another one.
    """

    def __init__(
        self,
        spi: SpiDevice,
        ce: CePin,
        node_id: int,
        settings: RadioSettings,
        runtime: Runtime,
        statistics: RadioStatistics,
    ) -> None:
        self._link = ChipLink(spi)
        self._ce = ce
        self._settings = settings
        self._runtime = runtime
        self._statistics = statistics
        self._registers = settings.registers(node_id)
        self._retries = (settings.retransmit_delay, settings.retransmits)  # as the chip is set now
        self.inbox: deque[Received] = deque()
        self.broadcast_heard_s = -math.inf  # when the last one was taken from the chip
        self._pid = 0  # of the last payload written; counts from where the chip stood, not from 0
        self._last_sent: dict[bytes, tuple[int, bytes]] = {}  # address -> PID and payload

    def set_up(self) -> None:
        """Write every register that matters, for nothing but power resets the chip; then listen."""
        settings = self._settings
        self._ce.value = False
        self._retries = (settings.retransmit_delay, settings.retransmits)
        self._link.write_byte(Register.CONFIG, settings.config_power_down)
        self._link.write_and_verify(self._registers)
        self._link.command(Command.FLUSH_TX)
        self._link.command(Command.FLUSH_RX)
        self._link.write_byte(Register.STATUS, STATUS_FLAGS)
        self._link.write_byte(Register.CONFIG, settings.config_listening)
        self._runtime.sleep(POWER_UP_S)
        self._link.write_and_verify({Register.CONFIG: bytes((settings.config_listening,))})
        self._raise_ce()

    def power_down(self) -> None:
        """The least current; registers and FIFOs keep their content."""
        self._ce.value = False
        self._link.write_byte(Register.CONFIG, self._settings.config_power_down)

    def disable(self) -> None:
        """CE low: whatever is wrong with the chip, it shall not be on the air."""
        self._ce.value = False

    def check_config(self) -> None:
        """RadioError unless the chip listens; one whose supply failed is in power down."""
        config = self._link.read_byte(Register.CONFIG)
        if config != self._settings.config_listening:
            raise RadioError(f"CONFIG reads 0x{config:02X}: was the supply interrupted?")

    def check_registers(self) -> None:
        """RadioError unless all registers hold what they were set to."""
        self.check_config()
        wrong = self._link.first_difference(self._registers)
        if wrong is not None:
            raise RadioError(f"{wrong[0].name} has changed by itself to {wrong[1].hex()}")

    def listen(self) -> None:
        """Receive on the broadcast pipe and the own one; pipe 0 is closed."""
        self._ce.value = False
        self.set_retries(self._settings.retransmit_delay, self._settings.retransmits)
        self._link.write_byte(Register.EN_RXADDR, self._settings.listening_pipes)
        self._link.write_byte(Register.CONFIG, self._settings.config_listening)
        self._raise_ce()

    def become_transmitter(self, address: bytes) -> None:
        """Standby, with pipe 0 open for the answer; what had arrived is taken first."""
        self._ce.value = False
        # An acknowledgement that the chip is sending must not be cut off.
        self._runtime.sleep(TX_DELAY_S[self._settings.data_rate])
        self.drain()
        self._link.write_byte(Register.CONFIG, self._settings.config_sending)
        self._link.write(Register.TX_ADDR, address)
        self._link.write(Register.RX_ADDR_P0, address)
        self._link.write_byte(Register.EN_RXADDR, self._settings.listening_pipes | ERX[0].mask)

    def load(self, address: bytes, payload: bytes, *, no_ack: bool = False) -> None:
        """Write the payload, under another packet number than the same bytes had before.

        The receiver's chip takes a packet with the PID and CRC of the one before for a repetition:
        it acknowledges it, and throws it away. The PID has two bits, so a node that repeats itself
        (heartbeats do) would lose packets that were acknowledged. Writing a payload and dropping it
        uses up a PID.
        """
        command = Command.W_TX_PAYLOAD_NO_ACK if no_ack else Command.W_TX_PAYLOAD
        self._pid = self._pid + 1 & 3
        if self._last_sent.get(address) == (self._pid, payload):
            self._link.command(command, payload)
            self._link.command(Command.FLUSH_TX)
            self._pid = self._pid + 1 & 3
        self._last_sent[address] = (self._pid, payload)
        self._link.command(command, payload)

    def transmit(self) -> bool:
        """Have what was loaded sent to a node; whether that has acknowledged it.

        If not, it is still in the chip: sending it once more is the same packet, which cannot
        arrive twice; or `drop` it.
        """
        flags = self._pulse(self._settings.acknowledged_s)
        self._statistics.retries += ARC_CNT.get(self._link.read_byte(Register.OBSERVE_TX))
        self._link.write_byte(Register.STATUS, TX_DS.mask | MAX_RT.mask)
        return bool(flags & TX_DS.mask)

    def transmit_to_all(self, payload: bytes) -> None:
        """Broadcast, and listen again; nobody acknowledges."""
        settings = self._settings
        plain = settings.broadcast_mode is BroadcastMode.SHOCKBURST
        self.become_transmitter(settings.broadcast_address)
        if plain:
            self._link.write_byte(Register.EN_AA, settings.auto_ack_pipes & ~ENAA[0].mask)
        self.load(settings.broadcast_address, payload, no_ack=True)
        self._pulse(settings.broadcast_s)
        self._link.write_byte(Register.STATUS, TX_DS.mask)
        if plain:
            self._link.write_byte(Register.EN_AA, settings.auto_ack_pipes)
        self.listen()

    def drop(self) -> None:
        """Forget what was loaded."""
        self._link.command(Command.FLUSH_TX)

    def drain(self) -> bool:
        """Move payloads from the FIFO to the inbox; whether there were any.

        In the order of the datasheet (8.4, footnote c): payload, RX_DR, then look for more.
        """
        found = False
        for _ in range(_DRAIN_LIMIT):
            fifo = self._link.read_byte(Register.FIFO_STATUS)
            if RX_EMPTY.get(fifo):
                if not RX_DR.get(self._link.status):
                    break
                self._link.write_byte(Register.STATUS, RX_DR.mask)
                continue
            found = True
            width = self._link.command(Command.R_RX_PL_WID, b"\0")[0]
            if width > MAX_PAYLOAD_BYTES:
                self._statistics.corrupt += 1
                self._link.command(Command.FLUSH_RX)
            else:
                pipe = RX_P_NO.get(self._link.status)
                payload = self._link.command(Command.R_RX_PAYLOAD, bytes(PAYLOAD_BYTES))
                self.inbox.append(Received(pipe, payload))
                if pipe == BROADCAST_PIPE:
                    self.broadcast_heard_s = self._runtime.now_s()
                self._statistics.received += 1
            self._link.write_byte(Register.STATUS, RX_DR.mask)
        return found

    @property
    def flags_seen(self) -> int:
        """RX_DR, TX_DS and MAX_RT as of the last transfer."""
        return self._link.status & STATUS_FLAGS

    def set_retries(self, delay: int, count: int) -> None:
        """Other retransmits of the chip than those of the settings, until `listen`."""
        if (delay, count) != self._retries:
            self._retries = (delay, count)
            self._link.write_byte(Register.SETUP_RETR, ARD.put(delay) | ARC.put(count))

    def _raise_ce(self) -> None:
        self._ce.value = True
        self._runtime.sleep(CE_TO_CSN_S)

    def _pulse(self, expected_s: float) -> int:
        """Have the payload sent; TX_DS or MAX_RT. RadioError if the chip says neither in time."""
        self._ce.value = True
        self._runtime.sleep(CE_PULSE_S)
        self._ce.value = False
        deadline_s = self._runtime.now_s() + TIMEOUT_S
        self._runtime.sleep(expected_s)
        while True:
            self._link.command(Command.NOP)
            flags = self._link.status & (TX_DS.mask | MAX_RT.mask)
            if flags:
                return flags
            if self._runtime.now_s() > deadline_s:
                raise RadioError("the chip said neither sent nor failed within 95 ms")
            # The next attempt of the chip cannot be over any sooner.
            self._runtime.sleep(ard_s(self._retries[0]))
