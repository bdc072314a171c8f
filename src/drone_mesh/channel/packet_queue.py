"""PacketQueue: the packets that wait for the radio, in lines."""

from __future__ import annotations

import math
from collections import deque
from typing import Final, Tuple

from drone_mesh.communication.wire.messages import opens_others
from drone_mesh.communication.wire.packet_types import Priority

ALL_NODES: Final = -1  # receiver of a broadcast

_Line = Tuple[int, Priority]  # receiver, priority


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
    """Packets in lines, one per receiver and priority, each with pauses of its own.

    So waiting for one receiver does not delay the others, nor a packet of the mesh that keeps
    failing the users' data behind it (IEEE 802.11e: a queue and a back-off per access category).
    """

    def __init__(self) -> None:
        self._lines: dict[_Line, deque[OutgoingPacket]] = {}  # none is empty
        self._opening: dict[int, int] = {}  # by receiver: answers to challenges that wait
        self._length = 0
        self.data = 0  # packets of priority DATA

    def __len__(self) -> int:
        return self._length

    def has(self, receiver: int, priority: Priority, payload: bytes) -> bool:
        """Whether these bytes already wait for that receiver."""
        line = self._lines.get((receiver, priority))
        return line is not None and any(waiting.payload == payload for waiting in line)

    def add(self, packet: OutgoingPacket) -> None:
        """Add a packet at the end of its line."""
        receiver, priority = packet.receiver, packet.priority
        self._lines.setdefault((receiver, priority), deque()).append(packet)
        self._length += 1
        if priority is Priority.DATA:
            self.data += 1
        elif opens_others(packet.payload):
            self._opening[receiver] = self._opening.get(receiver, 0) + 1

    def remove(self, packet: OutgoingPacket) -> None:
        """Remove a packet, if it is still there."""
        receiver, priority = packet.receiver, packet.priority
        line = self._lines.get((receiver, priority))
        if line is None or packet not in line:
            return  # all packets were given up meanwhile
        line.remove(packet)
        self._length -= 1
        if priority is Priority.DATA:
            self.data -= 1
        elif opens_others(packet.payload):
            self._opening[receiver] -= 1
        if not line:
            del self._lines[receiver, priority]

    def clear(self) -> None:
        self._lines.clear()
        self._opening.clear()
        self._length = self.data = 0

    def hurry(self, receiver: int, now_s: float) -> None:
        """End the wait of the first packets for this receiver."""
        for priority in Priority:
            line = self._lines.get((receiver, priority))
            if line is not None:
                line[0].not_before_s = min(line[0].not_before_s, now_s)

    def first_s(self) -> float:
        """When the first packet of a line may be tried; infinity if there is none."""
        return min((first.not_before_s for first in self._firsts()), default=math.inf)

    def ready(self, now_s: float) -> list[OutgoingPacket]:
        """The first packets of all lines that may be tried now."""
        return [first for first in self._firsts() if first.not_before_s <= now_s]

    def after(self, packet: OutgoingPacket) -> OutgoingPacket | None:
        """The first other packet of the same line, if it may follow."""
        line = self._lines.get((packet.receiver, packet.priority), ())
        after = next((other for other in line if other is not packet), None)
        return None if after is None or self._is_held(after) else after

    def _firsts(self) -> list[OutgoingPacket]:
        """The first packets of all lines that are not held."""
        return [line[0] for line in self._lines.values() if not self._is_held(line[0])]

    def _is_held(self, packet: OutgoingPacket) -> bool:
        """Whether it is users' data that its receiver may be unable to open yet."""
        return packet.priority is Priority.DATA and self._opening.get(packet.receiver, 0) > 0
