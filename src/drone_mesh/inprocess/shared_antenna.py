"""The antenna of one node on the shared channel: the driver's behaviour in virtual time."""

from __future__ import annotations

import math
import random
from typing import Final

from drone_mesh.channel.medium_access import Fate, MediumAccess
from drone_mesh.channel.packet_queue import ALL_NODES, OutgoingPacket
from drone_mesh.channel.statistics import ChannelMeter, RadioStatistics
from drone_mesh.channel.trains import place_in_train
from drone_mesh.communication.interfaces import MAX_NODE_ID, IMeshDebugInfo, IMeshNetwork
from drone_mesh.communication.timing import ChannelUse, Medium
from drone_mesh.communication.wire.messages import (
    goes_once,
    is_answered,
    is_jittered,
    priority,
    readdressed,
    receiver,
)
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.interfaces import Host
from drone_mesh.inprocess.shared_air import SharedAir, SharedRadio, Transmission
from drone_mesh.nrf24.registers import FIFO_DEPTH, NS_PER_S, SETTLING_NS, ard_s
from drone_mesh.nrf24.transceiver import CE_PULSE_S, TX_DELAY_S

SETTLING_S: Final = SETTLING_NS / NS_PER_S
# Durations of the driver's SPI transfers at 8 MHz, as counted by the emulator.
PREPARE_S: Final = 60e-6  # from a listening chip to the rise of CE, without the pause of TX_DELAY_S
FINISH_S: Final = 20e-6  # from TX_DS or MAX_RT to CE high again
LOAD_S: Final = 50e-6  # from TX_DS to the rise of CE for the next packet of a train
READ_S: Final = 80e-6  # from the end of a frame until its payload is in the driver


class SharedAntenna(SharedRadio):
    """One node's radio."""

    def __init__(self, air: SharedAir, host: Host, rng: random.Random) -> None:
        self.node_id = host.node_id
        self.drone = host.drone
        self.listening_since_s: float | None = None
        self.access = MediumAccess(air.settings.access_rules, rng)
        self._air = air
        self._clock: VirtualClock = air.clock
        self._submit, self._hear = host.submit, host.hear
        self._settings = air.settings
        self._tx_delay_s = TX_DELAY_S[air.settings.data_rate]
        self._medium = air.settings.medium
        self._mesh: IMeshNetwork | None = None
        self.powered = True
        self._planned_s = math.inf
        self._trying: OutgoingPacket | None = None
        self._retransmits = 0
        self._ard_s = 0.0
        self._ce_rose_s = 0.0
        self._answered = False
        self._last_taken: OutgoingPacket | None = None  # the last packet to this node alone
        self._unread = 0  # payloads in the FIFO
        self._counters = self.access.counters
        self._meter = ChannelMeter(self._clock.now_s)

    # IWirelessCommunication ------------------------------------------------------------------

    @property
    def medium(self) -> Medium:
        return self._medium

    def channel_use(self) -> ChannelUse:
        return self._meter.read(self.statistics(), self._clock.now_s)

    def hears_power(self) -> bool | None:
        return self._air.hears_power(self)

    def patience(self) -> float:
        return self.access.patience

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        self._mesh = mesh
        self.listening_since_s = self._clock.now_s
        self._air.add(self)

    def stop_antenna(self) -> None:
        self._mesh = None
        self.listening_since_s = None
        self.access.clear()
        self._air.remove(self)

    def send_message_to(self, payload: bytes) -> bool:
        self._air.on_packet(payload)
        to = receiver(payload)
        if not self.powered or to > MAX_NODE_ID or to == self.node_id:
            return False
        taken = self.access.offer(
            to,
            payload,
            self._clock.now_s,
            priority(payload),
            is_jittered(payload),
            goes_once(payload),
        )
        self._plan()
        return taken

    def broadcast_message(self, payload: bytes) -> None:
        self._air.on_packet(payload)
        if self.powered:
            self.access.offer(
                ALL_NODES, payload, self._clock.now_s, priority(payload), is_jittered(payload)
            )
            self._plan()

    def limit_tries(self, most: int) -> None:
        self.access.limit_tries(most)

    def data_room(self) -> int:
        return self.access.data_room()

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Does nothing: the owner of the network can read its nodes."""

    def statistics(self) -> RadioStatistics:
        """The current counters."""
        return self.access.statistics()

    def switch_power(self, on: bool) -> None:
        """Power on or off, and inform the mesh software; waiting packets are dropped."""
        self.powered = on
        self.access.clear()
        self.listening_since_s = self._clock.now_s if on and self._trying is None else None
        mesh = self._mesh
        if mesh is not None:
            self._submit(lambda now_s: mesh.on_antenna_power(on, now_s))

    # Sending ---------------------------------------------------------------------------------

    def _plan(self) -> None:
        if self._trying is not None:
            return
        at_s = max(self.access.next_try_s, self._clock.now_s)
        if at_s < self._planned_s:
            self._planned_s = at_s
            self._clock.call_at(at_s, self._try, at_s)

    def _try(self, planned_s: float) -> None:
        if planned_s != self._planned_s:
            return
        self._planned_s = math.inf
        packet = self.access.due(self._clock.now_s)
        if packet is None or not self.powered:
            self._plan()
            return
        self._trying, self._answered = packet, False
        self.listening_since_s = None
        self._retransmits, delay = self.access.retransmits()
        self._ard_s = ard_s(delay)
        self._ce_rose_s = self._clock.now_s + self._tx_delay_s + PREPARE_S
        self._clock.call_at(self._ce_rose_s + SETTLING_S, self._send_frame, packet)

    def _send_frame(self, packet: OutgoingPacket) -> None:
        if packet is self._trying:
            packet.frames += 1
            self._counters.airtime_s += self._settings.frame_s
            self._air.transmit(self, packet)

    def frame_left(self, frame: Transmission) -> None:
        now_s = self._clock.now_s
        if frame.answers is not None:
            if self._trying is None and self.powered:
                self.listening_since_s = now_s + SETTLING_S
        elif frame.packet.receiver == ALL_NODES:
            self._finish(True)
        else:
            self.listening_since_s = now_s + SETTLING_S  # for the acknowledgement
            self._clock.call_at(now_s + self._ard_s, self._no_answer, frame)

    def _no_answer(self, frame: Transmission) -> None:
        if self._answered or frame.packet is not self._trying:
            return
        self.listening_since_s = None
        if self._retransmits > 0:
            self._retransmits -= 1
            self._counters.retries += 1
            self._clock.call_at(self._clock.now_s + SETTLING_S, self._send_frame, frame.packet)
        else:
            self._finish(False)

    def _finish(self, acknowledged: bool) -> None:
        """TX_DS or MAX_RT; the driver notices it at its next check."""
        self.listening_since_s = None
        now_s, packet = self._clock.now_s, self._trying
        broadcast = packet is not None and packet.receiver == ALL_NODES
        expected_s = self._settings.broadcast_s if broadcast else self._settings.acknowledged_s
        looks_s = self._ce_rose_s + CE_PULSE_S + expected_s
        if now_s > looks_s:
            looks_s += math.ceil((now_s - looks_s) / self._ard_s) * self._ard_s
        self._clock.call_at(max(looks_s, now_s) + FINISH_S, self._listen_again, acknowledged)

    def _listen_again(self, acknowledged: bool) -> None:
        packet, self._trying = self._trying, None
        now_s = self._clock.now_s
        if packet is not None and acknowledged and self.powered:
            self._trying = self.access.following(packet, now_s)
        if self._trying is not None:
            self._ce_rose_s = now_s + LOAD_S
            self._answered = False
            self._retransmits, delay = self.access.train_retransmits()
            self._ard_s = ard_s(delay)
            self._clock.call_at(self._ce_rose_s + SETTLING_S, self._send_frame, self._trying)
        elif self.powered and self._mesh is not None:
            self.listening_since_s = now_s + SETTLING_S
        if packet is None:
            return
        fate = self.access.tried(packet, acknowledged, now_s)
        mesh, frames = self._mesh, packet.frames
        if mesh is None or packet.receiver == ALL_NODES:
            pass
        elif fate is Fate.GIVEN_UP:
            self._submit(lambda now_s: mesh.on_undelivered(packet.payload, frames, now_s))
        elif fate is Fate.DELIVERED:
            self._submit(lambda now_s: mesh.on_delivered(packet.payload, frames, now_s))
        self._plan()

    # Receiving -------------------------------------------------------------------------------

    def recognises(self, frame: Transmission) -> bool:
        if self._trying is None:
            return frame.answers is None
        return frame.answers is self and frame.packet is self._trying  # pipe 0, and no other

    def frame_arrived(self, frame: Transmission) -> None:
        if frame.answers is self:
            if not self._answered:
                self._answered = True
                self._finish(True)
            return
        if self._unread == FIFO_DEPTH:
            return
        packet, now_s = frame.packet, self._clock.now_s
        broadcast = packet.receiver == ALL_NODES
        if broadcast or packet is not self._last_taken:
            self._unread += 1
            if not frame.readers:  # one event of the clock for all
                self._clock.call_at(now_s + READ_S, _read, frame)
            frame.readers.append(self)
        if not broadcast:
            self._last_taken = packet
            self.listening_since_s = None
            self._clock.call_at(now_s + SETTLING_S, self._answer, frame)

    def _answer(self, frame: Transmission) -> None:
        self._counters.airtime_s += self._settings.answer_frame_s
        self._air.transmit(self, frame.packet, answers=frame.sender)

    def read(self, frame: Transmission) -> None:
        self._unread -= 1
        self._counters.received += 1
        packet = frame.packet
        if self._mesh is None or not self.powered:
            return
        broadcast = packet.receiver == ALL_NODES
        train = place_in_train(packet.payload, self.node_id)
        answers = packet.priority if broadcast and is_answered(packet.payload) else None
        sender_id, now_s = frame.sender.node_id, self._clock.now_s
        self.access.heard(sender_id, now_s, broadcast=answers, train=train)
        payload = readdressed(packet.payload, self.node_id) if broadcast else packet.payload
        self._air.delivered += 1
        self._hear(payload)


def _read(frame: Transmission) -> None:
    for radio in frame.readers:
        radio.read(frame)


class SharedChannel(SharedAir):
    """The air of a network on the fast model."""

    def antenna(self, host: Host, rng: random.Random) -> SharedAntenna:
        return SharedAntenna(self, host, rng)
