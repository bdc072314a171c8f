"""UploadedMission: way points from a ground station, and how far the vehicle has come."""

from __future__ import annotations

import math
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.telemetry import Message, sender_of

MOST_ITEMS = 500
ASK_AGAIN_S = 1.0  # MAVLink recommends 0.25 to 1.5 s
MOST_TRIES = 5  # as MAVLink recommends

_WAY_POINTS = frozenset(
    (
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
    )
)


class UploadedMission:
    """MAVLink's mission protocol, from the vehicle's side. Kinds other than flights are refused."""

    def __init__(
        self,
        send: Callable[[Message], None],
        place_of: Callable[[int, int, float, int], Location | None],
        now_s: Callable[[], float],
        first: int,
    ) -> None:
        """`place_of` converts a place of an item; items before `first` are not flown."""
        self._send = send
        self._place_of = place_of
        self._now_s = now_s
        self._first = first
        self._items: list[Message] = []
        self.current = 0  # the item that it flies to, or begins with
        self._reached_s = math.nan  # when it came there
        self._loading: list[Message] | None = None
        self._expected = 0
        self._from = (0, 0)
        self._asked_s = -math.inf
        self._tries = 0

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to fly."""
        return len(self._items) <= self._first

    # Flight ----------------------------------------------------------------------------------

    def begin(self) -> None:
        """From the first item, if it was at its end."""
        if not self._first <= self.current < len(self._items):
            self.current = self._first
        self._reached_s = math.nan

    def item(self) -> Message | None:
        """What to do now; None: it is over. Items that do not move the vehicle are passed over."""
        while self.current < len(self._items):
            item = self._items[self.current]
            if item.command in _WAY_POINTS or item.command in (
                mavlink.MAV_CMD_NAV_LAND,
                mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
            ):
                return item
            self._advance()
        return None

    def target(self, item: Message, here: Location) -> Location:
        """Where a way point is; a take-off without a place is straight up."""
        place = self._place_of(item.x, item.y, item.z, item.frame)
        assert place is not None  # checked when it was loaded
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF and not (item.x or item.y):
            return here._replace(height=place.height)
        return place

    def arrived(self) -> None:
        """It is at its way point: wait there as long as the item says, then go on."""
        if math.isnan(self._reached_s):
            self._reached_s = self._now_s()
        item = self._items[self.current]
        waits_s = item.param1 if item.command == mavlink.MAV_CMD_NAV_WAYPOINT else 0.0
        if self._now_s() - self._reached_s >= waits_s:
            self._advance()

    def _advance(self) -> None:
        self._send(mavlink.MAVLink_mission_item_reached_message(self.current))
        self.current += 1
        self._reached_s = math.nan
        self._send(self.report())

    def report(self) -> Message:
        """MISSION_CURRENT."""
        last = max(0, len(self._items) - 1)
        return mavlink.MAVLink_mission_current_message(min(self.current, last))

    # Messages --------------------------------------------------------------------------------

    def tick(self) -> None:
        """Ask again for an item that did not come."""
        if self._loading is None or self._now_s() < self._asked_s + ASK_AGAIN_S:
            return
        if self._tries >= MOST_TRIES:
            self._loading = None
        else:
            self._ask()

    def take_list_request(self, message: Message) -> None:
        """MISSION_REQUEST_LIST."""
        count = len(self._items) if _is_flight(message) else 0
        kind = message.mission_type
        self._send(mavlink.MAVLink_mission_count_message(*sender_of(message), count, kind))

    def take_request(self, message: Message) -> None:
        """MISSION_REQUEST_INT and MISSION_REQUEST."""
        if not _is_flight(message) or message.seq >= len(self._items):
            self._acknowledge(message, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        item = self._items[message.seq]
        item.target_system, item.target_component = sender_of(message)
        self._send(item)

    def take_count(self, message: Message) -> None:
        """MISSION_COUNT: a new mission begins to come."""
        if not _is_flight(message):
            self._acknowledge(message, mavlink.MAV_MISSION_UNSUPPORTED)
        elif message.count > MOST_ITEMS:
            self._acknowledge(message, mavlink.MAV_MISSION_NO_SPACE)
        elif message.count == 0:
            self.take_clear(message)
        else:
            self._from = sender_of(message)
            self._loading, self._expected, self._tries = [], message.count, 0
            self._ask()

    def take_item(self, message: Message) -> None:
        """MISSION_ITEM_INT."""
        loading = self._loading
        if loading is None or sender_of(message) != self._from:
            return
        if message.seq != len(loading):
            self._ask()
            return
        place = self._place_of(message.x, message.y, message.z, message.frame)
        if message.command in _WAY_POINTS and (place is None or not math.isfinite(message.z)):
            self._loading = None
            self._acknowledge(message, mavlink.MAV_MISSION_INVALID)
            return
        loading.append(_to_send(message))
        self._tries = 0
        if len(loading) < self._expected:
            self._ask()
            return
        self._items, self._loading, self.current = loading, None, 0
        self._acknowledge(message, mavlink.MAV_MISSION_ACCEPTED)

    def take_clear(self, message: Message) -> None:
        """MISSION_CLEAR_ALL."""
        if _is_flight(message):
            self._items, self._loading, self.current = [], None, 0
        self._acknowledge(message, mavlink.MAV_MISSION_ACCEPTED)

    def take_current(self, message: Message) -> None:
        """MISSION_SET_CURRENT."""
        if message.seq < len(self._items):
            self.current = message.seq
            self._reached_s = math.nan
        self._send(self.report())

    def _ask(self) -> None:
        assert self._loading is not None
        self._asked_s = self._now_s()
        self._tries += 1
        self._send(mavlink.MAVLink_mission_request_int_message(*self._from, len(self._loading)))

    def _acknowledge(self, message: Message, result: int) -> None:
        kind = message.mission_type
        self._send(mavlink.MAVLink_mission_ack_message(*sender_of(message), result, kind))


def _is_flight(message: Message) -> bool:
    return bool(message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION)


def _to_send(item: Message) -> Message:
    """The same as a message of this vehicle's."""
    return mavlink.MAVLink_mission_item_int_message(
        *(0, 0, item.seq, item.frame, item.command, 0, item.autocontinue),
        *(item.param1, item.param2, item.param3, item.param4),
        *(item.x, item.y, item.z),
    )
