"""OwnFence: the fence that an autopilot keeps by itself, read over MAVLink.

Its areas come by the mission protocol (https://mavlink.io/en/services/mission.html), the circle and
the ceiling around home from parameters. Neither says when it changes: it is read again and again.
"""

from __future__ import annotations

import logging
import math
from typing import Callable, Iterator, Sequence, Tuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.fence import OF_AUTOPILOT, Fence, Rule, Zone
from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.mavlink.autopilots import PX4, US
from drone_mesh.drone.mavlink.telemetry import Message, Telemetry
from drone_mesh.errors import ConfigurationError

FENCE = mavlink.MAV_MISSION_TYPE_FENCE
ASK_AGAIN_S = 1.0  # what got lost; a telemetry port needs 0.1 s for an item and its request
TRIES = 5  # without any answer, or that ended in an error
LOOK_AGAIN_S = 10.0  # after the last answer
MOST_ITEMS = 500
FAR_M = 20_000.0  # the circle of a fence that only has a ceiling; no goal is so far from home
_RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
_ITEMS = {  # whether it is one of the corners of an area, and whether to stay inside
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: (True, True),
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: (True, False),
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: (False, True),
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: (False, False),
    _RETURN_POINT: (False, False),
}
_CEILING, _CIRCLE, _AREAS = 1, 2, 4  # bits of ArduPilot's FENCE_TYPE
_ANY_AREA = 2  # bit of its FENCE_OPTIONS
_LIST = ""  # among the open questions: the areas; the others are names of parameters

_Item = Tuple[int, float, int, int]  # command; corners or radius, m; 1e-7 degrees

_log = logging.getLogger(__name__)


class OwnFence:
    """Asks for all parameters at once, and for one item after the other. One thread uses it."""

    def __init__(
        self, telemetry: Telemetry, origin: Origin, send: Callable[[Message], None]
    ) -> None:
        self.fence = Fence()  # as far as it was read
        self.trouble = "the autopilot's fence is not read yet"  # empty: it is, or never will be
        self._telemetry, self._origin, self._send = telemetry, origin, send
        self._values: dict[str, float] = {}  # of parameters
        self._areas: tuple[_Item, ...] | None = None  # None: not read
        self._made_of: object = False
        self._open: set[str] = set()  # questions without an answer yet
        self._count: int | None = None  # of the items that are being read
        self._items: list[_Item] = []
        self._unclear: tuple[_Item, ...] = ()  # read once, and not whole
        self._tries = self._errors = 0
        self._due_s = -math.inf

    def tick(self, now_s: float) -> None:
        """Ask for what is missing, and for everything again when it is time."""
        autopilot, to = self._telemetry.autopilot, self._telemetry.sender
        if autopilot is None or self._telemetry.link_trouble(now_s):
            return
        self._make()
        if now_s < self._due_s:
            return
        if not self._open:
            self._open, self._tries, self._errors = {_LIST, *autopilot.fence_parameters}, 0, 0
        elif self._tries == TRIES:
            self._open = {_LIST}
            self._finish(None, now_s)
            return
        self._tries += 1
        self._due_s = now_s + ASK_AGAIN_S
        if self._count is not None:
            self._send(mavlink.MAVLink_mission_request_int_message(*to, len(self._items), FENCE))
            return
        for name in sorted(self._open):
            self._send(
                mavlink.MAVLink_mission_request_list_message(*to, FENCE)
                if name == _LIST
                else mavlink.MAVLink_param_request_read_message(*to, name.encode(), -1)
            )

    def on_value(self, message: Message, now_s: float) -> None:
        """PARAM_VALUE: the answer, or a ground station has just set it."""
        autopilot = self._telemetry.autopilot
        if autopilot is None or message.param_id not in autopilot.fence_parameters:
            return
        value = autopilot.parameter_value(message.param_value, message.param_type)
        if math.isfinite(value):
            self._values[message.param_id] = value
            self._answered(message.param_id, now_s)

    def on_mission(self, message: Message, now_s: float) -> None:
        """MISSION_COUNT, MISSION_ITEM_INT or MISSION_ACK, also of others' transfers."""
        kind = message.get_type()
        is_ours = (message.target_system, message.target_component) == US
        if kind == "MISSION_ITEM_INT":
            # PX4 before 1.14.1 leaves out the mission type of items (PX4-Autopilot#22069).
            if is_ours and self._count is not None:
                self._take_item(message, now_s)
        elif message.mission_type != FENCE:
            return
        elif kind == "MISSION_COUNT":
            if is_ours and self._count is None and _LIST in self._open:
                self._count, self._tries, self._due_s = message.count, 0, now_s
                if not 0 < message.count <= MOST_ITEMS:
                    self._finish(None if message.count else (), now_s)
        elif is_ours and (message.type == mavlink.MAV_MISSION_UNSUPPORTED or self._errors == TRIES):
            self._finish(None, now_s)
        else:  # somebody else is changing it, or has just done so: begin anew
            self._errors += is_ours
            self._count, self._items, self._due_s = None, [], now_s + ASK_AGAIN_S

    def _take_item(self, message: Message, now_s: float) -> None:
        if (
            message.seq != len(self._items)  # asked for twice
            or message.command not in _ITEMS
            or not math.isfinite(message.param1)
            or not (abs(message.x) <= 90e7 and abs(message.y) <= 180e7)
        ):
            return
        self._items.append((message.command, message.param1, message.x, message.y))
        self._tries, self._due_s = 0, now_s
        if len(self._items) == self._count:
            read = tuple(self._items)
            if _is_whole(read) or read == self._unclear:
                self._finish(read, now_s)
            else:  # it has changed while it was read, unless it is read the same again
                self._unclear, self._count, self._items = read, None, []

    def _finish(self, areas: tuple[_Item, ...] | None, now_s: float) -> None:
        """End the transfer, or PX4 would be busy for 5 s and then tell ground stations so."""
        result = mavlink.MAV_MISSION_ACCEPTED
        if areas is None:
            areas, result = self._areas, mavlink.MAV_MISSION_OPERATION_CANCELLED
        if self._count is not None:
            self._send(mavlink.MAVLink_mission_ack_message(*self._telemetry.sender, result, FENCE))
        self._areas, self._count, self._items = areas, None, []
        self._answered(_LIST, now_s)

    def _answered(self, question: str, now_s: float) -> None:
        if self._open == {question}:  # the last one
            self._due_s = now_s + LOOK_AGAIN_S
            self._make()
            if self.trouble and (self._areas is None or not self._values):
                _log.warning("autopilot: it does not tell its fence; see docs/flying.md")
            self.trouble = ""
        self._open.discard(question)

    def _make(self) -> None:
        """Make the fence anew if anything that it depends on has changed."""
        telemetry, home = self._telemetry, self._telemetry.home

        def value(name: str) -> float:
            return self._values.get(name, 0.0)

        if telemetry.autopilot is PX4:
            is_kept, kinds, options = bool(value("GF_ACTION")), _CEILING | _CIRCLE | _AREAS, 0
            radius_m, top_m = value("GF_MAX_HOR_DIST"), value("GF_MAX_VER_DIST")
        else:  # it may also be switched on in flight
            is_kept = telemetry.keeps_fence or any(map(value, ("FENCE_ENABLE", "FENCE_AUTOENABLE")))
            kinds, options = int(value("FENCE_TYPE")), int(value("FENCE_OPTIONS"))
            radius_m, top_m = value("FENCE_RADIUS"), value("FENCE_ALT_MAX")
        areas = (self._areas or ()) if kinds & _AREAS else ()
        radius_m, top_m = radius_m * bool(kinds & _CIRCLE), top_m * bool(kinds & _CEILING)
        made_of = is_kept and (areas, options & _ANY_AREA, radius_m, top_m, home)
        if made_of == self._made_of:
            return
        self._made_of, rules = made_of, []
        if made_of:
            zones = list(self._zones(areas))
            inside = [zone for zone, is_inside in zones if is_inside]
            # Inside all of them for ArduPilot and PX4 since 1.15; older PX4: a goal there suits it.
            together = [inside] if options & _ANY_AREA else [[zone] for zone in inside]
            rules = [Rule(tuple(one), True) for one in together if one]
            rules += [Rule((zone,), False) for zone, is_inside in zones if not is_inside]
            if home is not None and (radius_m > 0.0 or top_m > 0.0):
                x, y, height_m = self._origin.to_frame(home).to_vector()
                heights = (-math.inf, height_m + top_m if top_m > 0.0 else math.inf)
                wide_m = radius_m if 0.0 < radius_m < FAR_M else FAR_M
                name = f"{OF_AUTOPILOT}, around home"
                rules.append(Rule((Zone.circle(name, (x, y), wide_m, True, heights),), True))
        before, self.fence = self.fence, Fence(tuple(rules))
        if self.fence != before:
            _log.info("autopilot: its fence: %s", self.fence.names or "none any more")

    def _zones(self, items: tuple[_Item, ...]) -> Iterator[tuple[Zone, bool]]:
        """Each area, and whether to stay inside; what is no area is named in the log."""
        number = at = 0
        while at < len(items):
            command, size = items[at][:2]
            corner, inside = _ITEMS[command]
            end = at + (max(1, int(size)) if corner else 1)
            places = (EarthPlace(x / 1e7, y / 1e7, 0.0) for _kind, _size, x, y in items[at:end])
            ring = tuple(self._origin.to_frame(place).to_vector()[:2] for place in places)
            at = end
            if command == _RETURN_POINT:
                continue
            number += 1
            name = f"{OF_AUTOPILOT}, area {number}"
            try:
                zone = Zone(name, (ring,)) if corner else Zone.circle(name, ring[0], size, inside)
                yield zone, inside
            except ConfigurationError as error:
                _log.warning("%s, is left out: %s", name, error)


def _is_whole(items: Sequence[_Item]) -> bool:
    """Whether each area has the corners that each of them says it has."""
    at = 0
    while at < len(items):
        command, size = items[at][:2]
        corners = max(1, int(size)) if _ITEMS[command][0] else 1
        if [one[:2] for one in items[at : at + corners]] != [(command, size)] * corners:
            return False
        at += corners
    return True
