"""The in-process radio: an ideal disc that can lose, delay and cut."""

from __future__ import annotations

import random
from typing import Callable

from drone_mesh.communication import messages
from drone_mesh.communication.interfaces import (
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.inprocess.clock import VirtualClock

HOP_DELAY_S = 0.002  # an acknowledged packet takes 1.9 ms on the air (nRF24L01+, 250 kbit/s)

Deliver = Callable[[bytes], None]
"""Hands a packet to the mesh component of one node, and looks after what it wants next."""


class InProcessAir:
    """Who hears whom, and what becomes of packets on their way."""

    def __init__(
        self,
        clock: VirtualClock,
        rng: random.Random,
        max_distance_m: float = 9.0,
        loss: float = 0.0,
        delay_s: float = HOP_DELAY_S,
        jitter_s: float = 0.0,
    ) -> None:
        """`loss`: share of packets that do not arrive, and whose sender knows it.

        A packet arrives after `delay_s` and a random part of `jitter_s`.
        """
        self._clock = clock
        self._rng = rng
        self._max_distance_m = max_distance_m
        self.loss = loss
        self._delay_s = delay_s
        self._jitter_s = jitter_s
        self._antennas: dict[int, InProcessAntenna] = {}
        self._cut: set[frozenset[int]] = set()
        self._flying = 0
        # Remembered while everybody stands still.
        self._in_range: dict[int, dict[int, InProcessAntenna]] = {}
        self.delivered = 0

    def add(self, antenna: InProcessAntenna) -> None:
        """An antenna comes into reach of the others."""
        self._antennas[antenna.node_id] = antenna
        self._in_range.clear()

    def remove(self, antenna: InProcessAntenna) -> None:
        """An antenna is gone."""
        self._antennas.pop(antenna.node_id, None)
        self._in_range.clear()

    def flight(self, started: bool) -> None:
        """A drone took off (True) or came to a stop."""
        self._flying += 1 if started else -1
        self._in_range.clear()

    def cut(self, one: int, other: int, off: bool = True) -> None:
        """Cut the link between two nodes, or mend it."""
        pair = frozenset((one, other))
        (self._cut.add if off else self._cut.discard)(pair)
        self._in_range.clear()

    def in_range(self, node: int) -> dict[int, InProcessAntenna]:
        """The antennas that `node` could reach if they were on, by id. Do not change it."""
        found = self._in_range.get(node)
        if found is None:
            found = {
                other: antenna
                for other, antenna in self._antennas.items()
                if other != node and self._hears(node, other)
            }
            if not self._flying:
                self._in_range[node] = found
        return found

    def _hears(self, one: int, other: int) -> bool:
        if self._cut and frozenset((one, other)) in self._cut:
            return False
        here = self._antennas[one].drone.get_location()
        there = self._antennas[other].drone.get_location()
        return here.distance_m(there) < self._max_distance_m

    def send(self, payload: bytes) -> bool:
        """Hand a packet over; True when the receiver has it, or will in a moment."""
        sender, to = payload[messages.FROM], payload[messages.TO]
        if self._flying:
            receiver = self._antennas.get(to)
            if receiver is None or not self._hears(sender, to):
                return False
        else:
            receiver = (self._in_range.get(sender) or self.in_range(sender)).get(to)
        if receiver is None or not receiver.powered:
            return False
        if self.loss and self._rng.random() < self.loss:
            return False
        self.delivered += 1
        at_s = self._clock.now_s + self._delay_s
        if self._jitter_s:
            at_s += self._rng.random() * self._jitter_s
        self._clock.call_at(at_s, receiver.receive, payload)
        return True


class InProcessAntenna(IWirelessCommunication):
    """One node's radio."""

    def __init__(
        self, air: InProcessAir, node_id: int, drone: IDroneEngine, deliver: Deliver
    ) -> None:
        self.node_id = node_id
        self.drone = drone
        self.powered = True
        self._air = air
        self._deliver = deliver
        self._started = False

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Be reachable."""
        self._started = True
        self._air.add(self)

    def stop_antenna(self) -> None:
        """Be gone."""
        self._started = False
        self._air.remove(self)

    def send_message_to(self, payload: bytes) -> bool:
        """Send to the node in byte 3."""
        return self.powered and self._air.send(payload)

    def broadcast_message(self, payload: bytes) -> None:
        """Send to each node in range."""
        if self.powered:
            before, after = payload[: messages.TO], payload[messages.TO + 1 :]
            for other in self._air.in_range(self.node_id):
                self._air.send(before + bytes((other,)) + after)

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Nothing: whoever has the network has its nodes."""

    def on(self) -> bool:
        """Whether it has power."""
        return self.powered

    def receive(self, payload: bytes) -> None:
        """A packet arrives; a node that is off hears nothing."""
        if self.powered and self._started:
            self._deliver(payload)
