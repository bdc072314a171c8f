"""Desk: what ground stations ask of the vehicles, and what they order."""

from __future__ import annotations

import functools
import math
import struct
from dataclasses import dataclass
from typing import Callable, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.timing import Throttle
from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import px4_mode
from drone_mesh.errors import MeshError
from drone_mesh.ground_station.reports import (
    COMPONENT,
    HOLD,
    LAND,
    PARAMETER,
    PROVIDED,
    RETURN,
    Fleet,
    Message,
)
from drone_mesh.ground_station.vehicles import Vehicle
from drone_mesh.state.model import EventRecord
from drone_mesh.state.orders import OrderProgress
from drone_mesh.web.access import Allowance

MOST_ORDERS_AT_ONCE, ORDER_PERIOD_S = 300, 0.05  # as over HTTP

SAY_PERIOD_S = 10.0  # of why a stream of targets is not followed

OrderDrone = Callable[[int, Location, Callable[[str], None]], None]
"""Order a drone to a place, and return at once; later call the function: empty, or why not."""

Post = Callable[[int, Message, object], None]
"""Send a message of this node to a station; None: to all."""

_ACCEPTED, _DENIED, _UNSUPPORTED, _IN_PROGRESS, _CANCELLED = (
    mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED,
    mavlink.MAV_RESULT_IN_PROGRESS, 6,  # MAV_RESULT_CANCELLED; ArduPilot's dialect lacks it
)  # fmt: skip
_UNKNOWN_PROGRESS = 255
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
_UNDER_WAY = (_IN_PROGRESS, _ACCEPTED)
_UNSET = 2**31 - 1  # in a coordinate of COMMAND_INT
_ASKED = {  # by command: the message that it asks for; None: its first parameter
    mavlink.MAV_CMD_REQUEST_MESSAGE: None,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
}
_DEEDS = {
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: HOLD,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: RETURN,
    mavlink.MAV_CMD_NAV_LAND: LAND,
}
_NOT_ALLOWED = "ground stations may give no orders here (--ground-station-may-order)"
_NOT_KNOWN = "its place is not known"
_ABOVE_SEA = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_ABOVE_HOME = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_ONLY_POSITION = 0b111  # of a type mask: bits of the coordinates that are ignored


# MAVLink FTP: number, session, operation; and of an answer also size, what was asked, error
_FTP, _FTP_ANSWER = struct.Struct("<HBB"), struct.Struct("<HBBBB6xB")
_FTP_ACK, _FTP_NAK, _FTP_NO_FILE = 128, 129, 10


class _NotOrdered(MeshError):
    """The text says why."""

    def __init__(self, why: str, result: int = _DENIED) -> None:
        super().__init__(why)
        self.result = result


class _Asker(NamedTuple):
    station: object
    system: int
    component: int

    @classmethod
    def of(cls, message: Message, station: object) -> _Asker:
        return cls(station, message.get_srcSystem(), message.get_srcComponent())


@dataclass
class _Order:
    node: int
    goal: Location
    mode: int
    asker: _Asker
    command: int | None  # None: it is not acknowledged
    is_item: bool  # of a mission, which has an acknowledgement of its own
    progress: OrderProgress
    given_s: float
    result: int = _IN_PROGRESS


class Desk:
    """Answers and orders. One thread, which is also that of the fleet."""

    def __init__(
        self, fleet: Fleet, order: OrderDrone, may_order: bool, post: Post, limit: Allowance
    ) -> None:
        self._fleet = fleet
        self._order = order
        self._may_order = may_order
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
            answer(self, vehicle, message, _Asker.of(message, station))

    def event(self, event: EventRecord) -> None:
        """An event of the mesh: how orders fare."""
        if event.kind == MeshEventKind.FLIGHT_DECIDED.value:  # it repairs the mesh
            self._fleet.modes.pop(event.node, None)
        elif event.kind == MeshEventKind.ORDER_ACCEPTED.value:  # which others may have given
            self._fleet.modes.pop(event.peers[0], None)
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
            self._result(order, _RESULTS[progress.state])

    # Questions ---------------------------------------------------------------------------------

    def _parameters(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        kind = message.get_type()
        name = getattr(message, "param_id", PARAMETER.decode())
        by_number = kind == "PARAM_REQUEST_READ" and message.param_index >= 0
        if message.param_index == 0 if by_number else name == PARAMETER.decode():
            self._post(vehicle.node, self._fleet.parameter(vehicle), asker.station)

    def _missions(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        to = asker.system, asker.component
        kind = message.get_type()
        if kind == "MISSION_REQUEST_LIST":
            answer = mavlink.MAVLink_mission_count_message(*to, 0, message.mission_type)
        else:
            is_empty = kind == "MISSION_CLEAR_ALL" or getattr(message, "count", 1) == 0
            result = mavlink.MAV_MISSION_ACCEPTED if is_empty else mavlink.MAV_MISSION_UNSUPPORTED
            answer = mavlink.MAVLink_mission_ack_message(*to, result, message.mission_type)
        self._post(vehicle.node, answer, asker.station)

    def _files(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        number, session, asked = _FTP.unpack_from(bytes(message.payload))
        is_end = asked in (1, 2)  # of one session, or of all
        head = (number + 1) % 2**16, session, _FTP_ACK if is_end else _FTP_NAK, not is_end, asked
        answer = _FTP_ANSWER.pack(*head, 0 if is_end else _FTP_NO_FILE)
        post = mavlink.MAVLink_file_transfer_protocol_message(
            0, asker.system, asker.component, list(answer.ljust(251, b"\0"))
        )
        self._post(vehicle.node, post, asker.station)

    # Orders ------------------------------------------------------------------------------------

    def _command(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        command = message.command
        if command in _ASKED:
            kind = _ASKED[command] or _whole(message.param1)
            make = PROVIDED.get(kind)
            made = None if make is None else make(self._fleet, vehicle)
            is_known = made is not None and made.get_msgId() == kind
            self._acknowledge(vehicle.node, asker, command, _ACCEPTED if is_known else _UNSUPPORTED)
            if is_known:
                self._post(vehicle.node, made, asker.station)
            return
        mode = _DEEDS.get(command)
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            mode = px4_mode(_whole(message.param2), _whole(message.param3))
        elif command == mavlink.MAV_CMD_DO_PAUSE_CONTINUE and message.param1 == 0:
            mode = HOLD
        elif command == mavlink.MAV_CMD_DO_REPOSITION:
            self._give(vehicle, lambda: self._reposition(vehicle, message), HOLD, asker, command)
            return
        if mode in (HOLD, RETURN, LAND):
            self._give(vehicle, lambda: self._deed(vehicle, mode), mode, asker, command)
        else:
            self._acknowledge(vehicle.node, asker, command, _UNSUPPORTED)

    def _mode(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        mode = message.custom_mode
        self._give(vehicle, lambda: self._deed(vehicle, mode), mode, asker)

    def _target(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        """One of a stream of targets; the same again says nothing new."""

        def goal() -> Location:
            if message.type_mask & _ONLY_POSITION:
                raise _NotOrdered("only places can be targets, no speeds", _UNSUPPORTED)
            if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                x, y, z = message.x, message.y, message.z
            else:
                x, y, z = message.lat_int / 1e7, message.lon_int / 1e7, message.alt
            return self._place(vehicle, message.coordinate_frame, x, y, z)

        self._give(vehicle, goal, HOLD, asker, is_stream=True)

    def _item(self, vehicle: Vehicle, message: Message, asker: _Asker) -> None:
        """A mission item that is a guided "go to"; any other belongs to a mission."""
        is_guided = message.current == 2 and message.command == mavlink.MAV_CMD_NAV_WAYPOINT
        if not is_guided:
            self._missions(vehicle, message, asker)
            return
        scale = 1e7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
        place = message.frame, message.x / scale, message.y / scale, message.z
        self._give(vehicle, lambda: self._place(vehicle, *place), HOLD, asker, is_item=True)

    def _reposition(self, vehicle: Vehicle, message: Message) -> Location:
        if message.get_type() == "COMMAND_LONG":
            frame, x, y = mavlink.MAV_FRAME_GLOBAL, message.param5, message.param6
            return self._place(vehicle, frame, x, y, message.param7)
        scale = 1e4 if message.frame == mavlink.MAV_FRAME_LOCAL_NED else 1e7
        x, y = (math.nan if v == _UNSET else v / scale for v in (message.x, message.y))
        return self._place(vehicle, message.frame, x, y, message.z)

    def _place(self, vehicle: Vehicle, frame: int, x: float, y: float, z: float) -> Location:
        """The place in the common frame; what is not a number stays as it is."""
        here, origin = vehicle.place, self._fleet.origin
        is_local = frame == mavlink.MAV_FRAME_LOCAL_NED
        is_across, is_up = math.isfinite(x) and math.isfinite(y), math.isfinite(z)
        if not is_local and frame not in (*_ABOVE_SEA, *_ABOVE_HOME):
            raise _NotOrdered("heights must be above sea level or above home", _UNSUPPORTED)
        if here is None:
            if not (is_across and is_up):
                raise _NotOrdered(_NOT_KNOWN)
            here = Location(0.0, 0.0, 0.0)  # both are replaced
        if is_local:
            place, height = Location(x, y, 0.0), -z
        elif not (is_across or is_up):  # to pause needs no origin
            return here
        elif origin is None:
            raise _NotOrdered("this mesh has no place on the earth (--origin)")
        else:
            above = frame in _ABOVE_HOME
            height = z + self._fleet.home_height_m(vehicle.node) if above else z - origin.altitude_m
            if is_across and not (abs(x) <= 90.0 and abs(y) <= 180.0):
                raise _NotOrdered(f"{x:g}, {y:g} is no place on the earth")
            place = origin.to_frame(EarthPlace(x, y, origin.altitude_m)) if is_across else here
        return (place if is_across else here)._replace(height=height if is_up else here.height)

    def _deed(self, vehicle: Vehicle, mode: int) -> Location:
        """Where it is to go to hold, return or land. An order to height 0 lands."""
        if mode not in (HOLD, RETURN, LAND):
            raise _NotOrdered("of the modes only Hold, Return and Land exist here", _UNSUPPORTED)
        if mode == RETURN:
            home = self._fleet.homes.get(vehicle.node)
            if home is None:
                raise _NotOrdered("its home is not known: it was first seen in flight")
            return home._replace(height=0.0)
        if vehicle.place is None:
            raise _NotOrdered(_NOT_KNOWN)
        return vehicle.place if mode == HOLD else vehicle.place._replace(height=0.0)

    def _give(
        self,
        vehicle: Vehicle,
        find_goal: Callable[[], Location],
        mode: int,
        asker: _Asker,
        command: int | None = None,
        is_stream: bool = False,
        is_item: bool = False,
    ) -> None:
        node, now_s, latest = vehicle.node, self._fleet.now_s, self._orders.get(vehicle.node)
        if is_stream and latest is not None and latest.given_s == now_s:
            return
        try:
            if not self._may_order:
                raise _NotOrdered(_NOT_ALLOWED)
            goal = find_goal()
            goal = goal._replace(height=max(0.0, goal.height)).as_ordered()
            is_same = latest is not None and (latest.goal, latest.mode) == (goal, mode)
            if latest is not None and is_same and not is_item:
                under_way = latest.progress.state.is_open and latest.result in _UNDER_WAY
                if is_stream or under_way:  # it came again, as its acknowledgement may be lost
                    self._acknowledge(node, asker, command, latest.result)
                    return
            if self._limit.is_over():
                raise _NotOrdered("too many orders at once")
        except _NotOrdered as error:
            self._acknowledge(node, asker, command, error.result)
            if not is_stream or self._said.count(str(node), now_s):
                self._say(node, f"not ordered: {error}")
            if is_item:
                self._acknowledge_item(node, asker, mavlink.MAV_MISSION_DENIED)
            return
        self._limit.note()
        if latest is not None:
            self._result(latest, _CANCELLED)
        progress = OrderProgress(node, goal, now_s)
        order = _Order(node, goal, mode, asker, command, is_item, progress, now_s)
        self._orders[node] = order
        self._acknowledge(node, asker, command, _IN_PROGRESS)
        self._order(node, goal, functools.partial(self._answered, order))

    def _answered(self, order: _Order, why_not: str) -> None:
        if order.is_item:
            result = mavlink.MAV_MISSION_DENIED if why_not else mavlink.MAV_MISSION_ACCEPTED
            self._acknowledge_item(order.node, order.asker, result)
        if why_not:
            self._result(order, _DENIED)
            self._say(order.node, f"not ordered: {why_not}")

    def _result(self, order: _Order, result: int) -> None:
        """Tell who ordered it how it ended; only once."""
        if order.result == _IN_PROGRESS and result != _IN_PROGRESS:
            order.result = result
            self._acknowledge(order.node, order.asker, order.command, result)

    def _acknowledge(self, node: int, asker: _Asker, command: int | None, result: int) -> None:
        if command is not None:
            ack = mavlink.MAVLink_command_ack_message(
                command, result, _UNKNOWN_PROGRESS * (result == _IN_PROGRESS), 0, *asker[1:]
            )
            self._post(node, ack, asker.station)

    def _acknowledge_item(self, node: int, asker: _Asker, result: int) -> None:
        ack = mavlink.MAVLink_mission_ack_message(asker.system, asker.component, result)
        self._post(node, ack, asker.station)

    def _say(self, node: int, words: str) -> None:
        for told in self._fleet.texts(node, mavlink.MAV_SEVERITY_WARNING, words):
            self._post(*told, None)


def _whole(number: float) -> int:
    return int(number) if 0.0 <= number < 2**24 else -1


_ANSWERS: dict[str, Callable[[Desk, Vehicle, Message, _Asker], None]] = {
    "COMMAND_LONG": Desk._command,
    "COMMAND_INT": Desk._command,
    "SET_MODE": Desk._mode,
    "SET_POSITION_TARGET_GLOBAL_INT": Desk._target,
    "SET_POSITION_TARGET_LOCAL_NED": Desk._target,
    "FILE_TRANSFER_PROTOCOL": Desk._files,
    "MISSION_ITEM": Desk._item,
    "MISSION_ITEM_INT": Desk._item,
    **dict.fromkeys(
        ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"), Desk._parameters
    ),
    **dict.fromkeys(
        (
            "MISSION_REQUEST_LIST", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_COUNT",
            "MISSION_CLEAR_ALL", "MISSION_WRITE_PARTIAL_LIST", "MISSION_SET_CURRENT",
        ),
        Desk._missions,
    ),
}  # fmt: skip
