"""NRF24LowLevelInterface: the driver of the nRF24L01+ (docs/radio.md, "Driver rules")."""

from __future__ import annotations

import contextlib
import logging
import random
from typing import Callable, Iterator

from drone_mesh.channel.medium_access import Fate, MediumAccess
from drone_mesh.channel.packet_queue import OutgoingPacket
from drone_mesh.channel.radio import Try
from drone_mesh.channel.runtime import Runtime, SystemRuntime
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.communication.wire.packet_types import Priority
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.pins import CePin, IrqPin, SpiDevice
from drone_mesh.nrf24.registers import FIFO_DEPTH
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.nrf24.transceiver import PipePayload, Transceiver

__all__ = ["NRF24LowLevelInterface"]  # for users; see docs/architecture.md

logger = logging.getLogger(__name__)

LONGEST_POLL_S = 5e-3  # between two looks at a chip without IRQ, however slow the rate
POLL_SHARE = 0.9  # of the time in which packets one after the other fill the FIFO
VERIFY_PERIOD_S = 1.0  # how long a brown-out may stay unnoticed while listening
IRQ_PATIENCE = 3  # contradictions between pin and chip; a single one may be a race
RESTART_PERIOD_S = 1.0  # shortest time between two attempts to find a lost chip


class IrqWatch:
    """Decides whether the IRQ pin works, or the chip must be polled. For the receiving thread."""

    def __init__(self) -> None:
        self.trusted = True
        self.said: bool | None = None  # whether the pin was low after the wait; None: not read
        self._contradictions = 0

    def polled(self, found: bool, low_for_nothing: bool) -> bool:
        """The chip was read after the wait; returns whether the pin is now considered broken.

        `found`: there were payloads, so the pin should have been low. `low_for_nothing`: all flags
        are clear, but the pin is low.
        """
        said, self.said = self.said, None
        if low_for_nothing or (found and said is False):
            self._contradictions += 1
        elif found and said:
            self._contradictions = 0
        if self._contradictions < IRQ_PATIENCE or not self.trusted:
            return False
        self.trusted = False
        return True


class NRF24LowLevelInterface:
    """One radio: sends with and without acknowledgement, and receives.

    `spi`, `ce` and `irq` are passed in, so anything that behaves like a chip works; without `irq`
    it is polled. One thread may send and one may call `receive`; a lock, held for one try at most,
    makes each sequence of SPI transfers atomic. While sending, a node cannot receive: for 1.9 ms at
    250 kbit/s if all goes well, and for two to four times as long without an answer.

    Use it as a context manager, or call `begin` and `close`. Every function except `begin`
    tolerates a failing chip: it is set up again, at most once a second; until then sends fail.
    """

    def __init__(
        self,
        spi: SpiDevice,
        ce: CePin,
        irq: IrqPin | None = None,
        *,
        node_id: int,
        settings: RadioSettings = RadioSettings(),  # noqa: B008 (frozen)
        runtime: Runtime | None = None,
        rng: random.Random | None = None,
    ) -> None:
        self.node_id = node_id
        self.settings = settings
        self.medium = settings.medium
        self._poll_s = min(LONGEST_POLL_S, POLL_SHARE * FIFO_DEPTH * settings.acknowledged_s)
        self._spi, self._ce, self._irq = spi, ce, irq
        self._runtime = runtime or SystemRuntime()
        self.access = MediumAccess(settings.access_rules, rng or random.Random())
        self._lock = self._runtime.lock()  # guards the chip and all fields below
        self._chip = Transceiver(spi, ce, node_id, settings, self._runtime, self.access.counters)
        self._irq_watch = IrqWatch()
        self._powered = False
        self.working = False  # the chip answered and held its settings when it was last used
        self._next_restart_s = 0.0
        self._next_verify_s = 0.0

    def __enter__(self) -> NRF24LowLevelInterface:
        self.begin()
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def begin(self) -> None:
        """Set up the chip and listen. Raises RadioError without a working chip."""
        with self._lock:
            self._set_up()
            self._powered = True

    def power_down(self) -> None:
        """Neither send nor receive until `begin`. Ignores a missing chip."""
        with self._lock:
            self._powered = self.working = False
            try:
                self._chip.power_down()
            except RadioError as error:
                logger.debug("node %d: power down: %s", self.node_id, error)

    def close(self) -> None:
        """Power the chip down and release pins and SPI."""
        self.power_down()
        self._ce.close()
        if self._irq is not None:
            self._irq.close()
        self._spi.close()

    def statistics(self) -> RadioStatistics:
        return self.access.statistics()

    def send(self, node_id: int, payload: bytes) -> bool:
        """Send 32 bytes to a node, and wait; True once its chip has acknowledged them.

        Follows the rules of access, one packet at a time; `Sender` serves several receivers at
        once. It listens in the random pauses between tries, so that two nodes that send to each
        other succeed. Each try sends the very same packet, which cannot be received twice.
        """
        _check(payload)
        access = self.access
        packet = OutgoingPacket(node_id, payload, Priority.CONTROL, self._runtime.now_s(), 0.0)
        while True:
            retransmits, delay = access.retransmits()
            done = self.try_once(node_id, payload, packet.tries > 0, retransmits, delay)
            fate = access.tried(packet, done.acknowledged, self._runtime.now_s())
            if fate is Fate.GIVEN_UP:
                self.drop()
            if fate is not Fate.WAITS:
                return done.acknowledged
            self._pause(packet.not_before_s - self._runtime.now_s())

    def try_once(
        self,
        node_id: int,
        payload: bytes,
        again: bool,
        retransmits: int,
        delay: int,
        following: Callable[[int], bytes | None] = lambda _frames: None,
    ) -> Try:
        """Try once to send a packet to a node: see PacketRadio.

        `retransmits`, `delay`: the chip's own. It does not listen between the packets of a train.
        A chip that fails sends no frames.

        The acknowledgement returns to pipe 0, which has the receiver's address for this time. The
        program of 2019 opened pipe 3 for it, at the address of another node, so the sender received
        and acknowledged packets of that node. Therefore pipe 3 stays closed.
        """
        chip, address = self._chip, self.settings.node_address(node_id)
        with self._noting_failure():
            if self._ready():
                chip.become_transmitter(address)
                chip.load(address, payload, again=again)
                chip.set_retries(delay, retransmits)
                outcome = chip.transmit()
                while outcome.acknowledged:
                    more = following(outcome.frames)
                    if more is None:
                        break
                    chip.load(address, more)
                    retransmits, delay = self.access.train_retransmits()
                    chip.set_retries(delay, retransmits)
                    outcome = chip.transmit()
                chip.listen()
                return outcome
        return Try(False, 0)

    def drop(self) -> None:
        """Give up the packet that was tried last: remove it from the chip."""
        with self._noting_failure():
            if self.working:
                self._chip.drop()

    def broadcast(self, payload: bytes) -> bool:
        """Send 32 bytes to every node in range; True if they were sent."""
        _check(payload)
        with self._noting_failure():
            if self._ready():
                self._chip.transmit_to_all(payload)
                return True
        return False

    def receive(self, timeout_s: float) -> list[PipePayload]:
        """Received payloads, oldest first; waits up to `timeout_s` for one. For one thread."""
        until_s = self._runtime.now_s() + timeout_s
        inbox = self._chip.inbox
        while True:
            with self._lock:
                self._poll()
            if inbox:
                return [inbox.popleft() for _ in range(len(inbox))]
            left_s = until_s - self._runtime.now_s()
            if left_s <= 0:
                return []
            if self._irq is None or not self._irq_watch.trusted or not self.working:
                self._runtime.sleep(min(left_s, self._poll_s))
            else:
                self._irq_watch.said = self._irq.wait_low(left_s)

    def hears_power(self) -> bool | None:
        """Whether more than -64 dBm were in the channel for 40 us (RPD); None: it fails now."""
        with self._noting_failure():
            if self._ready():
                return self._chip.received_power()
        return None

    def _pause(self, duration_s: float) -> None:
        """Wait, and keep receiving."""
        until_s = self._runtime.now_s() + duration_s
        while True:
            left_s = until_s - self._runtime.now_s()
            if left_s <= 0:
                return
            self._runtime.sleep(min(left_s, self._poll_s))
            with self._lock:
                self._poll()

    def _poll(self) -> None:
        """Empty the FIFO, and periodically check that the chip still holds its settings."""
        if not self._powered or (not self.working and not self._ready()):
            return
        chip = self._chip
        try:
            found = chip.drain()
            if self._irq is not None and self._irq_watch.trusted:
                low_for_nothing = not chip.flags_seen and self._irq.wait_low(0.0)
                if self._irq_watch.polled(found, low_for_nothing):
                    self.access.counters.irq_fallbacks += 1
                    logger.warning("node %d: the IRQ pin does not work; polling", self.node_id)
            now_s = self._runtime.now_s()
            if now_s >= self._next_verify_s:
                self._next_verify_s = now_s + VERIFY_PERIOD_S
                chip.check_registers()
        except RadioError as error:
            self._failed(error)
            self._ready()

    def _set_up(self) -> None:
        self.working = False
        self._chip.set_up()
        self.working = True
        self._next_verify_s = self._runtime.now_s() + VERIFY_PERIOD_S

    def _ready(self) -> bool:
        """Whether the chip can be used; sets it up again after it lost its settings."""
        if not self._powered:
            return False
        if self.working:
            try:
                self._chip.check_config()
                return True
            except RadioError as error:
                self._failed(error)
        now_s = self._runtime.now_s()
        if now_s < self._next_restart_s:
            return False
        self._next_restart_s = now_s + RESTART_PERIOD_S
        try:
            self._set_up()
        except RadioError as error:
            self._failed(error)
            return False
        logger.warning("node %d: the radio works again", self.node_id)
        return True

    @contextlib.contextmanager
    def _noting_failure(self) -> Iterator[None]:
        """Hold the lock in this block; if the chip fails in it, note that and go on after it."""
        with self._lock:
            try:
                yield
            except RadioError as error:
                self._failed(error)

    def _failed(self, error: RadioError) -> None:
        """Note that the chip must be set up again before use."""
        if self.working:
            self.access.counters.restarts += 1
            logger.warning("node %d: %s", self.node_id, error)
        self.working = False
        self._chip.disable()


def _check(payload: bytes) -> None:
    if len(payload) != PAYLOAD_BYTES:
        raise ValueError(f"invalid payload of {len(payload)} bytes: must have {PAYLOAD_BYTES}")
