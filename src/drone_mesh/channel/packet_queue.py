"""PacketQueue: the packets that wait for the radio, in one line per receiver."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from drone_mesh.communication.wire.packet_types import Priority

ALL_NODES: Final = -1  # receiver of a broadcast


class OutgoingPacket:
    """One packet on its way out."""

    __slots__ = (
        "frames",
        "not_before_s",
        "once",
        "payload",
        "priority",
        "queued_s",
        "receiver",
        "tries",
    )

    def __init__(
        self,
        receiver: int,
        payload: bytes,
        priority: Priority,
        now_s: float,
        not_before_s: float,
        once: bool = False,
    ) -> None:
        self.receiver = receiver
        self.payload = payload
        self.priority = priority
        self.queued_s = now_s
        self.not_before_s = not_before_s
        self.once = once
        self.tries = 0
        self.frames = 0  # in all tries, those included that the radio repeated by itself


class PacketQueue:
    """Packets by receiver, so that waiting for one receiver does not delay the others."""

    def __init__(self) -> None:
        self._lines: dict[int, deque[OutgoingPacket]] = {}  # by receiver; none is empty
        self._length = 0
        self.data = 0  # packets of priority DATA

    def __len__(self) -> int:
        return self._length

    def has(self, receiver: int, payload: bytes) -> bool:
        """Whether these bytes already wait for that receiver."""
        line = self._lines.get(receiver)
        return line is not None and any(waiting.payload == payload for waiting in line)

    def add(self, packet: OutgoingPacket) -> None:
        """Add a packet to its receiver's line; control goes before data that was not tried yet."""
        line = self._lines.setdefault(packet.receiver, deque())
        if packet.priority is Priority.DATA:
            self.data += 1
            line.append(packet)
        else:
            line.insert(_before_untried_data(line), packet)
        self._length += 1

    def remove(self, packet: OutgoingPacket) -> None:
        """Remove a packet, if it is still there."""
        line = self._lines.get(packet.receiver)
        if line is None or packet not in line:
            return  # all packets were given up meanwhile
        line.remove(packet)
        self._length -= 1
        self.data -= packet.priority is Priority.DATA
        if not line:
            del self._lines[packet.receiver]

    def clear(self) -> None:
        self._lines.clear()
        self._length = self.data = 0

    def hurry(self, receiver: int, now_s: float) -> None:
        """End the wait of the first packet for this receiver."""
        line = self._lines.get(receiver)
        if line is not None:
            line[0].not_before_s = min(line[0].not_before_s, now_s)

    def first_s(self) -> float:
        """When the first packet of a line may be tried; infinity if there is none."""
        return min((line[0].not_before_s for line in self._lines.values()), default=math.inf)

    def ready(self, now_s: float) -> list[OutgoingPacket]:
        """The first packets of all lines that may be tried now."""
        return [line[0] for line in self._lines.values() if line[0].not_before_s <= now_s]

    def after(self, packet: OutgoingPacket) -> OutgoingPacket | None:
        """The first other packet for the same receiver."""
        line = self._lines.get(packet.receiver, ())
        return next((other for other in line if other is not packet), None)


def _before_untried_data(line: deque[OutgoingPacket]) -> int:
    """The place in a line for a packet of the mesh: before all data that was not tried yet."""
    place = len(line)
    while place and line[place - 1].priority is Priority.DATA and not line[place - 1].tries:
        place -= 1
    return place
