"""The SPI sequences of the driver, without threads and retries."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from drone_mesh.channel.radio import Try
from drone_mesh.channel.runtime import Runtime
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.link import ChipLink
from drone_mesh.nrf24.pins import CePin, SpiDevice
from drone_mesh.nrf24.registers import (
    ADDRESS_BYTES,
    ARC,
    ARC_CNT,
    ARD,
    ENAA,
    ERX,
    MAX_PAYLOAD_BYTES,
    MAX_RT,
    RESET_VALUES,
    RX_DR,
    RX_EMPTY,
    RX_FIFO_IS_EMPTY,
    RX_P_NO,
    STATUS_FLAGS,
    TX_DS,
    Command,
    Register,
    ard_s,
)
from drone_mesh.nrf24.settings import (
    BROADCAST_PIPE,
    OWN_PIPE,
    BroadcastMode,
    DataRate,
    RadioSettings,
)

POWER_UP_S = 5e-3  # Tpd2stby is up to 4.5 ms, depending on the crystal [DS Table 16]
CE_PULSE_S = 20e-6  # Thce is 10 us; a pulse sends one packet and does not keep the chip in TX
CE_TO_CSN_S = 5e-6  # Tpece2csn is 4 us
TIMEOUT_S = 95e-3  # the longest transaction takes 87.1 ms
_REMEMBERED = 64  # payloads whose PID is known; with others between, one may be lost
_DRAIN_LIMIT = 32  # payloads at a time; the FIFO holds three, more arrive only while we read
# How long an acknowledgement in progress may still take after CE went low.
TX_DELAY_S = {DataRate.KBPS_250: 505e-6, DataRate.MBPS_1: 280e-6, DataRate.MBPS_2: 240e-6}


class PipePayload(NamedTuple):
    """A payload and the pipe on which it arrived."""

    pipe: int
    payload: bytes

    @property
    def to_all(self) -> bool:
        """Whether it was broadcast."""
        return self.pipe == BROADCAST_PIPE


class Transceiver:
    """One chip. Every function raises RadioError if the chip does not answer as expected.

    Belongs to the thread that holds the driver's lock, except that another thread may empty
    `inbox`.
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
        self._retries = (settings.retransmit_delay, settings.retransmits)  # currently in the chip
        self.inbox: deque[PipePayload] = deque()
        self._loaded: tuple[bytes, bytes] | None = None  # address and payload in the TX FIFO
        self._pid = 0  # of the last payload written, relative to an unknown start
        self._pids: dict[tuple[bytes, bytes], int] = {}  # of the latest payloads to each address

    def set_up(self) -> None:
        """Write every register that matters, because only power resets the chip; then listen."""
        settings = self._settings
        self._ce.value = False
        self._retries = (settings.retransmit_delay, settings.retransmits)
        if self._link.read(Register.TX_ADDR, ADDRESS_BYTES) == RESET_VALUES[Register.TX_ADDR]:
            self._pid = 0  # the supply failed, or nothing was sent yet: the chip counts anew
        self._link.write_byte(Register.CONFIG, settings.config_power_down)
        self._link.write_and_verify(self._registers)
        self._link.command(Command.FLUSH_TX)
        self._loaded = None
        self._link.command(Command.FLUSH_RX)
        self._link.write_byte(Register.STATUS, STATUS_FLAGS)
        self._link.write_byte(Register.CONFIG, settings.config_listening)
        self._runtime.sleep(POWER_UP_S)
        self._link.write_and_verify({Register.CONFIG: bytes((settings.config_listening,))})
        self._raise_ce()

    def power_down(self) -> None:
        """Lowest current; registers and FIFOs keep their contents."""
        self._ce.value = False
        self._link.write_byte(Register.CONFIG, self._settings.config_power_down)

    def disable(self) -> None:
        """Set CE low, so that a failing chip does not send."""
        self._ce.value = False

    def check_config(self) -> None:
        """Raise RadioError unless the chip listens; after a supply failure it is in power down."""
        config = self._link.read_byte(Register.CONFIG)
        if config != self._settings.config_listening:
            raise RadioError(f"CONFIG reads 0x{config:02X}: was the supply interrupted?")

    def received_power(self) -> bool:
        """Whether it receives more than -64 dBm in its channel, from whatever sender (RPD)."""
        return bool(self._link.read_byte(Register.RPD) & 1)

    def check_registers(self) -> None:
        """Raise RadioError unless all registers hold their settings."""
        self.check_config()
        wrong = self._link.first_difference(self._registers)
        if wrong is not None:
            raise RadioError(f"{wrong[0].name} changed unexpectedly to {wrong[1].hex()}")

    def listen(self) -> None:
        """Receive on the broadcast pipe and the node's own; pipe 0 is closed."""
        self._ce.value = False
        self.set_retries(self._settings.retransmit_delay, self._settings.retransmits)
        self._link.write_byte(Register.EN_RXADDR, self._settings.listening_pipes)
        self._link.write_byte(Register.CONFIG, self._settings.config_listening)
        self._raise_ce()

    def become_transmitter(self, address: bytes) -> None:
        """Go to standby with pipe 0 open for the answer, after emptying the FIFO."""
        self._ce.value = False
        # Do not cut off an acknowledgement that the chip is sending.
        self._runtime.sleep(TX_DELAY_S[self._settings.data_rate])
        self.drain()
        self._link.write_byte(Register.CONFIG, self._settings.config_sending)
        self._link.write(Register.TX_ADDR, address)
        self._link.write(Register.RX_ADDR_P0, address)
        self._link.write_byte(Register.EN_RXADDR, self._settings.listening_pipes | ERX[0].mask)

    def load(
        self,
        address: bytes,
        payload: bytes,
        *,
        again: bool = False,
        command: Command = Command.W_TX_PAYLOAD,
    ) -> None:
        """Load the payload into the chip with the right packet number (PID).

        The receiver's chip treats a packet with the PID and CRC of the previous one that it
        received as a repetition: it drops it, although it acknowledges it if that was requested. So
        `again`, another try of a packet that may have arrived while its acknowledgement was lost,
        has the PID of the previous try, and any other packet has another PID than the same bytes
        had before, even if other packets were sent since: these may all be lost. The PID has two
        bits and counts written payloads: writing one and flushing it uses up a PID.
        """
        packet = (address, payload)
        if again and self._loaded == packet:
            return  # it is still loaded
        self.drop()
        pid = self._pid + 1 & 3
        before = self._pids.pop(packet, None)
        if before is not None:
            wanted = before if again else pid + (before == pid) & 3
            while pid != wanted:
                self._write_payload(payload)
                self._link.command(Command.FLUSH_TX)
                pid = self._pid + 1 & 3
        self._write_payload(payload, command)
        self._loaded = packet
        self._pids[packet] = pid
        if len(self._pids) > _REMEMBERED:
            del self._pids[next(iter(self._pids))]

    def transmit(self) -> Try:
        """Send the loaded payload to a node; without an acknowledgement it stays in the chip."""
        flags = self._pulse(self._settings.acknowledged_s)
        retransmits = ARC_CNT.get(self._link.read_byte(Register.OBSERVE_TX))
        self._statistics.retries += retransmits
        outcome = Try(bool(flags & TX_DS.mask), retransmits + 1)
        self._statistics.airtime_s += outcome.frames * self._settings.frame_s
        self._link.write_byte(Register.STATUS, TX_DS.mask | MAX_RT.mask)
        if outcome.acknowledged:
            self._loaded = None
        return outcome

    def transmit_to_all(self, payload: bytes) -> None:
        """Broadcast without acknowledgement, and listen again."""
        settings = self._settings
        plain = settings.broadcast_mode is BroadcastMode.SHOCKBURST
        self.become_transmitter(settings.broadcast_address)
        if plain:
            self._link.write_byte(Register.EN_AA, settings.auto_ack_pipes & ~ENAA[0].mask)
        # On a pipe without auto-acknowledgement an ordinary payload requests none.
        command = Command.W_TX_PAYLOAD if plain else Command.W_TX_PAYLOAD_NO_ACK
        self.load(settings.broadcast_address, payload, command=command)
        self._pulse(settings.broadcast_s)
        self._loaded = None
        self._statistics.airtime_s += settings.frame_s
        self._link.write_byte(Register.STATUS, TX_DS.mask)
        if plain:
            self._link.write_byte(Register.EN_AA, settings.auto_ack_pipes)
        self.listen()

    def drain(self) -> bool:
        """Move payloads from the FIFO to the inbox; returns whether there were any.

        In the order of the datasheet (8.4, footnote c): payload, RX_DR, then check for more.
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
            if RX_P_NO.get(self._link.status) == RX_FIFO_IS_EMPTY:
                raise RadioError(
                    f"FIFO_STATUS reads 0x{fifo:02X}, which means that a payload waits, and STATUS "
                    f"0x{self._link.status:02X}, which means that none does: check MISO"
                )
            if width > MAX_PAYLOAD_BYTES:
                self._statistics.corrupt += 1
                self._link.command(Command.FLUSH_RX)
            else:
                pipe = RX_P_NO.get(self._link.status)
                payload = self._link.command(Command.R_RX_PAYLOAD, bytes(PAYLOAD_BYTES))
                self.inbox.append(PipePayload(pipe, payload))
                self._statistics.received += 1
                if pipe == OWN_PIPE:
                    self._statistics.airtime_s += self._settings.answer_frame_s
            self._link.write_byte(Register.STATUS, RX_DR.mask)
        return found

    @property
    def flags_seen(self) -> int:
        """RX_DR, TX_DS and MAX_RT in the last transfer."""
        return self._link.status & STATUS_FLAGS

    def set_retries(self, delay: int, count: int) -> None:
        """Use other retransmit settings than the configured ones, until `listen`."""
        if (delay, count) != self._retries:
            self._retries = (delay, count)
            self._link.write_byte(Register.SETUP_RETR, ARD.put(delay) | ARC.put(count))

    def drop(self) -> None:
        """Discard the payload of a failed try: it was given up, or another one goes first."""
        if self._loaded is not None:
            self._loaded = None
            self._link.command(Command.FLUSH_TX)

    def _write_payload(self, payload: bytes, command: Command = Command.W_TX_PAYLOAD) -> None:
        self._link.command(command, payload)
        self._pid = self._pid + 1 & 3

    def _raise_ce(self) -> None:
        self._ce.value = True
        self._runtime.sleep(CE_TO_CSN_S)

    def _pulse(self, expected_s: float) -> int:
        """Send the payload; returns TX_DS or MAX_RT. RadioError if neither appears in time."""
        self._ce.value = True
        self._runtime.sleep(CE_PULSE_S)
        self._ce.value = False
        deadline_s = self._runtime.now_s() + TIMEOUT_S
        self._runtime.sleep(expected_s)
        while True:
            now_s = self._runtime.now_s()  # before the look: a busy machine may pause after it
            self._link.command(Command.NOP)
            flags = self._link.status & (TX_DS.mask | MAX_RT.mask)
            if flags:
                return flags
            if now_s > deadline_s:
                raise RadioError(
                    "the radio reported a packet neither sent nor failed: is CE wired, and --ce "
                    "right?"
                )
            # The chip's next attempt cannot end sooner.
            self._runtime.sleep(ard_s(self._retries[0]))
