"""PacketAntenna: the antenna of the mesh on a packet radio that shares its channel."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import Callable, Mapping

from drone_mesh.channel.packet_queue import ALL_NODES
from drone_mesh.channel.radio import PacketRadio, Received
from drone_mesh.channel.runtime import Runtime, SystemRuntime, Task
from drone_mesh.channel.sender import Sender
from drone_mesh.channel.statistics import ChannelMeter, LinkQuality, Quality, RadioStatistics
from drone_mesh.channel.trains import place_in_train
from drone_mesh.communication.events.observer import in_hops
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    NO_ROUTE,
    PAYLOAD_BYTES,
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.communication.timing import ChannelUse, Medium
from drone_mesh.communication.wire.messages import (
    goes_once,
    is_answered,
    is_jittered,
    priority,
    readdressed,
    receiver,
    sender,
)
from drone_mesh.errors import ConfigurationError
from drone_mesh.execution import PacketInbox, Submit

logger = logging.getLogger(__name__)

RECEIVE_TIMEOUT_S = 0.1  # how soon the receiving thread notices its end
DEBUG_PERIOD_S = 10.0  # one line per check period
POWER_WANTED_S = 1.0  # longer than the pause between two questions of a repair
DUPLICATE_S = 0.5  # the same bytes again within this time are a duplicate


class PacketAntenna(IWirelessCommunication):
    """Queues what the mesh sends, and hands on what arrives.

    Threads: `start_antenna` starts one that receives, which owns the memory for duplicates, and one
    that sends. No call of the mesh waits for the radio. What arrives, and what could not be
    delivered, reaches the mesh through `submit`.
    """

    def __init__(
        self,
        radio: PacketRadio,
        submit: Submit,
        *,
        runtime: Runtime | None = None,
        on_payload: Callable[[bytes], None] | None = None,
        debug_period_s: float = DEBUG_PERIOD_S,
    ) -> None:
        """`on_payload` is called with each payload as the mesh gets it, in the receiving thread."""
        self._debug_period_s = debug_period_s
        self._radio = radio
        self._submit = submit
        self._inbox = PacketInbox(submit)
        self._runtime = runtime or SystemRuntime()
        self._sender = Sender(radio, self._runtime, self._delivered, self._given_up)
        self._meter = ChannelMeter(self._runtime.now_s())
        self._quality = LinkQuality()
        self._on_payload = on_payload
        self._mesh: IMeshNetwork | None = None
        self._receiving: Task | None = None
        self._ending = False  # the receiving thread must end
        self._info: IMeshDebugInfo | None = None
        self.powered = False  # read it from any thread
        self._silent = False  # set by any thread
        self._seen: dict[int, tuple[bytes, float]] = {}  # node -> its last payload, and when
        self._duplicates = 0
        self._power: bool | None = False  # in the channel; the receiving thread samples it
        self._power_until_s = -math.inf  # as long as it is wanted

    @property
    def medium(self) -> Medium:
        return self._radio.medium

    def channel_use(self) -> ChannelUse:
        return self._meter.read(self.statistics(), self._runtime.now_s())

    def hears_power(self) -> bool | None:
        """The latest sample; the first call of several makes the receiving thread take some."""
        self._power_until_s = self._runtime.now_s() + POWER_WANTED_S
        return self._power

    def works(self) -> bool:
        return self._radio.working or not self.powered

    def patience(self) -> float:
        return self._sender.patience

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Set the radio up and listen. Raises what the radio raises if it does not work."""
        if mesh.get_node_id() != self._radio.node_id:
            raise ConfigurationError(
                f"the radio is set up as node {self._radio.node_id}, "
                f"but the mesh component is node {mesh.get_node_id()}"
            )
        if self._receiving is not None:
            return
        self._radio.begin()
        self._mesh = mesh
        self.powered = True
        self._ending = False
        self._receiving = self._runtime.start(self._receive, f"radio {self._radio.node_id}")
        self._sender.start()

    def stop_antenna(self) -> None:
        receiving, self._receiving = self._receiving, None
        if receiving is None:
            return
        self.powered = False
        self._ending = True
        self._sender.stop()
        receiving.join()
        self._radio.close()
        self._mesh = None

    def switch_power(self, on: bool) -> None:
        """Switch the antenna of a running node off or on, and inform the mesh.

        Raises what the radio raises if it is switched on and does not work.
        """
        mesh = self._mesh
        if mesh is None or on == self.powered:
            return
        if on:
            self._radio.begin()
        else:
            self._sender.clear()
            self._radio.power_down()
        self.powered = on
        self._submit(lambda now_s: mesh.on_antenna_power(on, now_s))

    def fall_silent(self) -> None:
        """Send nothing more; every send fails at once from now on. Any thread.

        For a quick shutdown: on a busy channel a node may have seconds of sends queued.
        """
        self._silent = True
        self._sender.clear()

    def send_message_to(self, payload: bytes) -> bool:
        """Queue a packet for the node in byte 3. False: invalid, no power, or too many wait."""
        if self._silent or not self.powered or len(payload) != PAYLOAD_BYTES:
            return False
        to = receiver(payload)
        if to > MAX_NODE_ID or to == self._radio.node_id:
            return False
        return self._sender.offer(
            to, bytes(payload), priority(payload), is_jittered(payload), goes_once(payload)
        )

    def broadcast_message(self, payload: bytes) -> None:
        """Queue one frame for all; each receiver's antenna puts its own id into byte 3."""
        if self.powered and not self._silent and len(payload) == PAYLOAD_BYTES:
            packet = readdressed(payload, BROADCAST)
            self._sender.offer(ALL_NODES, packet, priority(payload), is_jittered(payload))

    def limit_tries(self, most: int) -> None:
        self._sender.limit_tries(most)

    def data_room(self) -> int:
        return self._sender.data_room()

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Log one line about the node and the channel every `debug_period_s`, or stop."""
        self._info = info if on else None

    def on(self) -> bool:
        return self.powered

    def statistics(self) -> RadioStatistics:
        """Counters of the radio, and the duplicates that were seen."""
        return replace(self._radio.statistics(), duplicates=self._duplicates)

    def link_quality(self) -> Mapping[int, Quality]:
        """How well packets reach each neighbour. Any thread."""
        return self._quality.figures

    def _delivered(self, payload: bytes, frames: int) -> None:
        self._quality.packet(receiver(payload), frames, delivered=True)
        mesh = self._mesh
        if mesh is not None and self.powered and not self._silent:
            self._submit(lambda now_s: mesh.on_delivered(payload, frames, now_s))

    def _given_up(self, payload: bytes, frames: int) -> None:
        if receiver(payload) <= MAX_NODE_ID:
            self._quality.packet(receiver(payload), frames, delivered=False)
        mesh = self._mesh
        if mesh is not None and self.powered and not self._silent:
            self._submit(lambda now_s: mesh.on_undelivered(payload, frames, now_s))

    def _show(self, info: IMeshDebugInfo) -> None:
        use = self.channel_use()
        place_of, connection = info.get_last_good_known_location_id(), "not connected"
        if info.get_connected_to_gateway():
            hops = in_hops(info.get_hops_from_gateway_away())
            connection = f"connected, gateway {info.get_preferred_gateway()}, {hops}"
        logger.info(
            "node %d: %s, %s, %d nodes known, %d messages sent, steps back to "
            "%s; airtime %.1f %%, %.2f tries per packet, %d waiting, %d given up",
            info.get_node_id(),
            "on" if self.powered else "off",
            connection,
            info.get_router_tech_table_size(),
            info.get_total_message_sent(),
            "none" if place_of == NO_ROUTE else f"node {place_of}",
            100 * use.airtime,
            use.tries,
            use.waiting,
            use.given_up,
        )

    def _receive(self) -> None:
        show_s = self._runtime.now_s() + self._debug_period_s
        while not self._ending:
            info, late_s = self._info, self._runtime.now_s() - show_s
            if late_s >= 0.0:
                show_s += self._debug_period_s * (late_s // self._debug_period_s + 1.0)
                if info is not None:
                    self._show(info)
            for received in self._radio.receive(RECEIVE_TIMEOUT_S):
                self._hand_on(received)
            wanted = self._runtime.now_s() < self._power_until_s
            self._power = self._radio.hears_power() if wanted else False

    def _hand_on(self, received: Received) -> None:
        mesh, payload = self._mesh, received.payload
        if mesh is None or not self.powered:
            return
        self._note(payload)
        train = place_in_train(payload, self._radio.node_id)
        answers = priority(payload) if received.to_all and is_answered(payload) else None
        self._sender.heard(sender(payload), broadcast=answers, train=train)
        if received.to_all:
            payload = readdressed(payload, self._radio.node_id)
        if self._on_payload is not None:
            self._on_payload(payload)
        self._inbox.put(lambda now_s: mesh.on_msg(payload, now_s))

    def _note(self, payload: bytes) -> None:
        """Count duplicates; they are still delivered, since a repeated packet is normal."""
        now_s = self._runtime.now_s()
        before, then_s = self._seen.get(sender(payload), (b"", now_s))
        if before == payload and now_s - then_s < DUPLICATE_S:
            self._duplicates += 1
        self._seen[sender(payload)] = (payload, now_s)
