"""The areas of the simulated vehicle's fence; its mission protocol is as strict as that of PX4."""

from __future__ import annotations

from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.own_fence import FENCE
from drone_mesh.drone.mavlink.telemetry import Message, sender_of

FENCE_MESSAGES = ("MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK")


class FenceStore:
    """Hands out `items`: command, corners or radius in m, latitude and longitude in degrees."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self.items: list[tuple[int, float, float, float]] = []
        self.result: int | None = mavlink.MAV_MISSION_ACCEPTED  # else: it refuses; None: silent
        self.unreadable = -1  # the number of an item that it cannot read
        self.is_busy = False  # a transfer was begun and not ended
        self.next, self._to = 0, (0, 0)  # its next item, and to whom

    def take(self, message: Message) -> None:
        """A request for the list, for its next item or for the last one again; or an ack."""
        kind, to, result = message.get_type(), sender_of(message), self.result
        if message.mission_type != FENCE or result is None or self.is_busy and to != self._to:
            return
        if kind == "MISSION_ACK":
            self.is_busy = False
        elif kind == "MISSION_REQUEST_LIST" and not result:
            self.is_busy, self.next, self._to = True, 0, to
            self._send(mavlink.MAVLink_mission_count_message(*to, len(self.items), FENCE))
        elif (
            self.is_busy
            and message.seq in (self.next - 1, self.next)
            and message.seq != self.unreadable
        ):
            self.next = message.seq + 1
            command, size, *degrees = self.items[message.seq]
            head = (*to, message.seq, mavlink.MAV_FRAME_GLOBAL, command, 0, 1, size, 0.0, 0.0, 0.0)
            place = (*(round(one * 1e7) for one in degrees), 0.0)
            self._send(mavlink.MAVLink_mission_item_int_message(*head, *place, FENCE))
        else:
            self.is_busy, result = False, result or mavlink.MAV_MISSION_ERROR
            self._send(mavlink.MAVLink_mission_ack_message(*to, result, FENCE))
