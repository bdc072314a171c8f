"""Announcements: registers the antennas of a process with the simulator."""

from __future__ import annotations

import threading
from typing import Callable, Protocol

import rospy

from drone_mesh.communication.wire.messages import packet
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.flight_path import Vector
from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph import names

PlaceOf = Callable[[int], Vector]
"""The position that the engine of this drone reported last, metres; NO_POSITION if none did."""


class AnnouncedAntenna(Protocol):
    """An antenna as the simulator sees it."""

    node_id: int

    def on(self) -> bool:
        """Whether it has power."""


def probe_of(node_id: int) -> bytes:
    """The packet that an antenna sends to itself; it returns once a simulator has registered it."""
    return packet(MessageType.NOTDEFINED, node_id, node_id, node_id, node_id)


class Announcements:
    """Announces antennas to the simulator until their own probes return.

    Registered antennas are announced again in turn, because another DroneInfo with their id may
    have redirected their packets.

    Any thread. `_lock` guards all fields. `_announcing` keeps announcements in the order in which
    the power of the antennas changed; publishing only appends to a queue.
    """

    def __init__(self, publish: Callable[[DroneInfo], None], place_of: PlaceOf) -> None:
        self._publish = publish
        self._place_of = place_of
        self._lock = threading.Lock()
        self._announcing = threading.Lock()
        self._antennas: dict[int, AnnouncedAntenna] = {}  # least recently announced first
        self._on_registered: dict[int, Callable[[], None]] = {}
        self._unregistered: set[int] = set()

    def __len__(self) -> int:
        return len(self._antennas)

    def add(self, antenna: AnnouncedAntenna, on_registered: Callable[[], None]) -> None:
        """Announce this antenna; call `on_registered` each time a simulator registers it."""
        with self._lock:
            self._antennas[antenna.node_id] = antenna
            self._on_registered[antenna.node_id] = on_registered
            self._unregistered.add(antenna.node_id)
        self.announce(antenna)

    def remove(self, antenna: AnnouncedAntenna) -> None:
        """Forget this antenna; an unknown one is ignored."""
        with self._lock:
            self._antennas.pop(antenna.node_id, None)
            self._on_registered.pop(antenna.node_id, None)
            self._unregistered.discard(antenna.node_id)

    def announce(self, antenna: AnnouncedAntenna) -> None:
        """Publish where this antenna listens and is, and whether it has power."""
        node_id = antenna.node_id
        place = self._place_of(node_id)
        topic = rospy.resolve_name(names.node_topic(node_id))
        with self._announcing:
            self._publish(DroneInfo(node_id, place, topic, antenna.on()))

    def announce_all_to_new_simulator(self) -> None:
        """Announce all antennas: a new simulator has not registered any."""
        with self._lock:
            self._unregistered.update(self._antennas)
        self.announce_unregistered()

    def announce_unregistered(self) -> None:
        """Repeat the announcement of each antenna whose probe has not returned."""
        for antenna in self.unregistered():
            self.announce(antenna)

    def announce_next(self, count: int) -> None:
        """Announce up to `count` antennas again, least recently announced first."""
        with self._lock:
            antennas = list(self._antennas.values())[:count]
            for antenna in antennas:  # to the end
                self._antennas[antenna.node_id] = self._antennas.pop(antenna.node_id)
        for antenna in antennas:
            self.announce(antenna)

    def unregistered(self) -> list[AnnouncedAntenna]:
        """Antennas whose probe has not returned from the current simulator."""
        with self._lock:
            return [self._antennas[node_id] for node_id in self._unregistered]

    def probe_returned(self, node_id: int) -> None:
        """An antenna received its own probe, so it is registered. Repeated calls change nothing."""
        with self._lock:
            if node_id not in self._unregistered:
                return
            self._unregistered.discard(node_id)
            on_registered = self._on_registered[node_id]
        on_registered()
