"""Desk: what ground stations ask of the vehicles, and what they order."""

from __future__ import annotations

import functools
import math
import struct
from dataclasses import dataclass
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.timing import Throttle
from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import px4_mode
from drone_mesh.errors import GoalRefused, MeshError
from drone_mesh.ground_station.reports import (
    COMPONENT,
    HOLD,
    LAND,
    PARAMETER,
    PROVIDED,
    RETURN,
    Fleet,
    Message,
)  # fmt: skip
from drone_mesh.ground_station.vehicles import Vehicle
from drone_mesh.state.model import EventRecord
from drone_mesh.state.orders import CLOCKS_DIFFER_S, OrderProgress
from drone_mesh.web.access import Allowance

STREAM_PERIOD_S = 1.0  # least time between two orders from a stream of targets
SAY_PERIOD_S = 10.0  # of why a stream of targets is not followed

OrderDrone = Callable[[int, Location, Callable[[str], None]], None]
"""Order a drone to a place, and return at once; later call the function: empty, or why not."""

Post = Callable[[int, Message, object], None]
"""Send a message of this node to a station; None: to all."""

_ACCEPTED, _DENIED, _UNSUPPORTED, _IN_PROGRESS, _CANCELLED = (
    mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED,
    mavlink.MAV_RESULT_IN_PROGRESS, 6,  # MAV_RESULT_CANCELLED; ArduPilot's dialect lacks it
)  # fmt: skip
_RESULTS = {
    OrderState.SENT: _IN_PROGRESS,
    OrderState.ACCEPTED: _ACCEPTED,
    OrderState.ARRIVED: _ACCEPTED,
    OrderState.REPLACED: _CANCELLED,
    OrderState.REFUSED: _DENIED,
    OrderState.NO_ROUTE: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    OrderState.LOST_CONTACT: mavlink.MAV_RESULT_FAILED,
    OrderState.GIVEN_UP: mavlink.MAV_RESULT_FAILED,
}
_ASKED = {  # by command: the message that it asks for; 0: its first parameter
    mavlink.MAV_CMD_REQUEST_MESSAGE: 0,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
}
_DEEDS = {
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: HOLD,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: RETURN,
    mavlink.MAV_CMD_NAV_LAND: LAND,
}
_UNSET = 2**31 - 1  # in a coordinate of COMMAND_INT
_NO_POSITION = 0b111  # of a type mask: bits of the coordinates that are ignored
_ABOVE_SEA = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_ABOVE_HOME = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
# MAVLink FTP: number, session, operation; an answer also has size, what was asked, error
_FTP, _FTP_ANSWER = struct.Struct("<HBB"), struct.Struct("<HBBBB6xB")
_FTP_ENDS, _FTP_ACK, _FTP_NAK, _FTP_NO_FILE = (1, 2), 128, 129, 10


class _NotOrdered(MeshError):
    """The text says why; without one, there is nothing to say."""

    def __init__(self, why: str, result: int = _DENIED) -> None:
        super().__init__(why)
        self.result = result


@dataclass
class _Order:
    goal: Location
    mode: int
    acknowledge: Callable[[int], None]
    progress: OrderProgress
    given_s: float
    result: int = _IN_PROGRESS

    def end(self, result: int) -> None:
        """Tell who ordered it how it ended; only once."""
        if self.result == _IN_PROGRESS != result:
            self.result = result
            self.acknowledge(result)


class Desk:
    """Answers and orders. One thread, which is also that of the fleet."""

    def __init__(self, fleet: Fleet, order: OrderDrone, post: Post, limit: Allowance) -> None:
        """`limit`: of orders."""
        self._fleet = fleet
        self._order = order
        self._post = post
        self._limit = limit
        self._orders: dict[int, _Order] = {}  # the latest of each drone
        self._said = Throttle(SAY_PERIOD_S)

    def received(self, message: Message, station: object) -> None:
        """Any message. What is for a vehicle of which there is no proof has no answer."""
        answer = _ANSWERS.get(message.get_type())
        if answer is None or getattr(message, "target_component", 0) not in (0, COMPONENT):
            return
        vehicle = self._fleet.alive(message.target_system - 1)
        if vehicle is not None:
            answer(self, vehicle, message, station)

    def event(self, event: EventRecord) -> None:
        """An event of the mesh: how orders fare."""
        if event.kind == MeshEventKind.FLIGHT_DECIDED.value:  # it repairs the mesh
            self._fleet.modes.pop(event.node, None)
        elif event.kind == MeshEventKind.ORDER_ACCEPTED.value:  # which others may have given
            self._fleet.modes.pop(event.peers[0] if event.peers else -1, None)
        for node, order in self._orders.items():
            progress = order.progress
            before = progress.was_sent, progress.state
            progress.on_event(event)
            if (progress.was_sent, progress.state) == before:
                continue
            if progress.state in (OrderState.ACCEPTED, OrderState.ARRIVED):
                self._fleet.modes[node] = order.mode
            elif not progress.state.is_open:
                self._fleet.modes.pop(node, None)
            order.end(_RESULTS[progress.state])

    # Questions ---------------------------------------------------------------------------------

    def _parameters(self, vehicle: Vehicle, message: Message, station: object) -> None:
        number, name = getattr(message, "param_index", -1), getattr(message, "param_id", PARAMETER)
        if number == 0 or (number < 0 and name == PARAMETER):
            self._post(vehicle.node, self._fleet.parameter(vehicle), station)

    def _missions(self, vehicle: Vehicle, message: Message, station: object) -> None:
        to, kind = _sender(message), message.get_type()
        is_empty = kind == "MISSION_CLEAR_ALL" or getattr(message, "count", 1) == 0
        result = mavlink.MAV_MISSION_ACCEPTED if is_empty else mavlink.MAV_MISSION_UNSUPPORTED
        answer = mavlink.MAVLink_mission_ack_message(*to, result, message.mission_type)
        if kind == "MISSION_REQUEST_LIST":
            answer = mavlink.MAVLink_mission_count_message(*to, 0, message.mission_type)
        self._post(vehicle.node, answer, station)

    def _files(self, vehicle: Vehicle, message: Message, station: object) -> None:
        number, session, asked = _FTP.unpack_from(bytes(message.payload))
        head = (number + 1) % 2**16, session
        payload = _FTP_ANSWER.pack(*head, _FTP_NAK, 1, asked, _FTP_NO_FILE)
        if asked in _FTP_ENDS:
            payload = _FTP_ANSWER.pack(*head, _FTP_ACK, 0, asked, 0)
        answer = mavlink.MAVLink_file_transfer_protocol_message
        post = answer(0, *_sender(message), list(payload.ljust(251, b"\0")))
        self._post(vehicle.node, post, station)

    def _command(self, vehicle: Vehicle, message: Message, station: object) -> None:
        if message.command not in _ASKED:
            self._give(vehicle, message, station)
            return
        kind = _ASKED[message.command] or _whole(message.param1)
        made = PROVIDED[kind](self._fleet, vehicle) if kind in PROVIDED else None
        is_known = made is not None and made.get_msgId() == kind
        acknowledge = self._acknowledge(vehicle.node, message, station)
        acknowledge(_ACCEPTED if is_known else _UNSUPPORTED)
        if is_known:
            self._post(vehicle.node, made, station)

    # Orders ------------------------------------------------------------------------------------

    def _item(self, vehicle: Vehicle, message: Message, station: object) -> None:
        """A mission item that is a guided "go to"; any other belongs to a mission."""
        is_guided = message.current == 2 and message.command == mavlink.MAV_CMD_NAV_WAYPOINT
        (self._give if is_guided else self._missions)(vehicle, message, station)

    def _goal(self, vehicle: Vehicle, message: Message) -> tuple[Location, int]:
        """Where the drone is to fly, and in which mode. Raises _NotOrdered."""
        kind, m = message.get_type(), message
        if kind == "SET_MODE":
            return self._deed(vehicle, m.custom_mode), m.custom_mode
        if kind == "SET_POSITION_TARGET_GLOBAL_INT":
            if m.type_mask & _NO_POSITION:
                raise _NotOrdered("only places can be targets, no speeds", _UNSUPPORTED)
            place = m.coordinate_frame, m.lat_int / 1e7, m.lon_int / 1e7, m.alt
        elif kind == "MISSION_ITEM":
            place = m.frame, m.x, m.y, m.z
        elif kind == "MISSION_ITEM_INT":
            place = m.frame, m.x / 1e7, m.y / 1e7, m.z
        elif m.command != mavlink.MAV_CMD_DO_REPOSITION:
            mode = _DEEDS.get(m.command, -1)
            if m.command == mavlink.MAV_CMD_DO_SET_MODE:
                mode = px4_mode(_whole(m.param2), _whole(m.param3))
            elif m.command == mavlink.MAV_CMD_DO_PAUSE_CONTINUE and m.param1 == 0:
                mode = HOLD
            if mode < 0:
                raise _NotOrdered("", _UNSUPPORTED)
            return self._deed(vehicle, mode), mode
        elif kind == "COMMAND_INT":
            place = m.frame, *(math.nan if v == _UNSET else v / 1e7 for v in (m.x, m.y)), m.z
        else:
            place = mavlink.MAV_FRAME_GLOBAL, m.param5, m.param6, m.param7
        return self._place(vehicle, *place), HOLD

    def _deed(self, vehicle: Vehicle, mode: int) -> Location:
        """Where it is to go to hold, return or land. An order to height 0 lands."""
        if mode not in (HOLD, RETURN, LAND):
            raise _NotOrdered("of the modes only Hold, Return and Land exist here", _UNSUPPORTED)
        place = self._fleet.homes.get(vehicle.node) if mode == RETURN else vehicle.place
        if place is None:
            raise _NotOrdered(f"its {'home' if mode == RETURN else 'place'} is not known")
        return place._replace(height=max(0.0, place.height) if mode == HOLD else 0.0)

    def _place(
        self, vehicle: Vehicle, frame: int, north_deg: float, east_deg: float, height_m: float
    ) -> Location:
        """The place in the common frame; what is not a number stays as it is."""
        is_across, is_up = math.isfinite(north_deg + east_deg), math.isfinite(height_m)
        here, origin = vehicle.place, self._fleet.origin
        if frame not in (*_ABOVE_SEA, *_ABOVE_HOME):
            raise _NotOrdered("heights must be above sea level or above home", _UNSUPPORTED)
        if here is None and not (is_across and is_up):
            raise _NotOrdered("its place is not known")
        if origin is None and (is_across or is_up):
            raise _NotOrdered("this mesh has no place on the earth (--origin)")
        place = here or Location(0.0, 0.0, 0.0)
        if is_across and origin is not None:
            if not (abs(north_deg) <= 90.0 and abs(east_deg) <= 180.0):
                raise _NotOrdered(f"{north_deg:g}, {east_deg:g} is no place on the earth")
            there = origin.to_frame(EarthPlace(north_deg, east_deg, origin.altitude_m))
            place = there._replace(height=place.height)
        if is_up and origin is not None:
            home_m = self._fleet.home_height_m(vehicle.node)
            above_m = home_m if frame in _ABOVE_HOME else -origin.altitude_m
            place = place._replace(height=height_m + above_m)
        return place

    def _give(self, vehicle: Vehicle, message: Message, station: object) -> None:
        node, now_s, latest = vehicle.node, self._fleet.now_s, self._orders.get(vehicle.node)
        is_stream = message.get_type().startswith("SET_POSITION")
        if is_stream and latest is not None and now_s < latest.given_s + STREAM_PERIOD_S:
            return
        acknowledge = self._acknowledge(node, message, station)
        try:
            goal, mode = self._goal(vehicle, message)
            if not self._fleet.may_order:
                raise _NotOrdered("no orders are taken here (--ground-station-may-order)")
            goal = goal.as_ordered()
            check_goal(*goal)
            is_same = latest is not None and latest.mode == mode  # it may fly on meanwhile
            if latest is not None and is_same and (mode != HOLD or latest.goal == goal):
                is_open = latest.progress.state.is_open
                if is_stream or (is_open and latest.result in (_IN_PROGRESS, _ACCEPTED)):
                    acknowledge(latest.result)  # it came again, as that may be lost
                    return
            if self._limit.is_over():
                raise _NotOrdered("too many orders at once")
        except (_NotOrdered, GoalRefused) as error:
            acknowledge(getattr(error, "result", _DENIED))
            if str(error) and (not is_stream or self._said.count(str(node), now_s)):
                self._say(node, str(error))
            return
        self._limit.note()
        if latest is not None:
            latest.end(_CANCELLED)
        progress = OrderProgress(node, goal, now_s - CLOCKS_DIFFER_S)
        order = _Order(goal, mode, acknowledge, progress, now_s)
        self._orders[node] = order
        acknowledge(_IN_PROGRESS)
        self._order(node, goal, functools.partial(self._answered, node, order))

    def _answered(self, node: int, order: _Order, why_not: str) -> None:
        if why_not:
            order.end(_DENIED)
            self._say(node, why_not)

    def _say(self, node: int, why_not: str) -> None:
        warning = mavlink.MAV_SEVERITY_WARNING
        for told in self._fleet.texts(node, warning, f"not ordered: {why_not}"):
            self._post(*told, None)

    def _acknowledge(self, node: int, message: Message, station: object) -> Callable[[int], None]:
        """What tells its sender the result of an order, in the way of its kind, if it has one."""
        to, kind = _sender(message), message.get_type()

        def acknowledge(result: int) -> None:
            if kind in ("COMMAND_LONG", "COMMAND_INT"):
                progress = 255 * (result == _IN_PROGRESS)  # not known
                ack = mavlink.MAVLink_command_ack_message(message.command, result, progress, 0, *to)
                self._post(node, ack, station)
            elif kind.startswith("MISSION_ITEM") and result != _IN_PROGRESS:
                denied, accepted = mavlink.MAV_MISSION_DENIED, mavlink.MAV_MISSION_ACCEPTED
                done = accepted if result == _ACCEPTED else denied
                self._post(node, mavlink.MAVLink_mission_ack_message(*to, done), station)

        return acknowledge


def _sender(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


def _whole(number: float) -> int:
    return int(number) if 0.0 <= number < 2**24 else 0


_ANSWERS: dict[str, Callable[[Desk, Vehicle, Message, object], None]] = {
    **dict.fromkeys(("COMMAND_LONG", "COMMAND_INT"), Desk._command),
    **dict.fromkeys(("SET_MODE", "SET_POSITION_TARGET_GLOBAL_INT"), Desk._give),
    **dict.fromkeys(("MISSION_ITEM", "MISSION_ITEM_INT"), Desk._item),
    **dict.fromkeys(("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"), Desk._parameters),
    **dict.fromkeys(("MISSION_REQUEST_LIST", "MISSION_REQUEST", "MISSION_COUNT"), Desk._missions),
    **dict.fromkeys(("MISSION_REQUEST_INT", "MISSION_CLEAR_ALL"), Desk._missions),
    "FILE_TRANSFER_PROTOCOL": Desk._files,
}
