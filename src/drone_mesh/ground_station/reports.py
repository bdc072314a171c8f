"""Fleet: the nodes of a mesh as MAVLink vehicles, and what a ground station is told of them."""

from __future__ import annotations

import math
from typing import Any, Callable, Iterable, Iterator, Tuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.events.observer import MeshEventKind, told
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import px4_mode
from drone_mesh.ground_station.vehicles import Vehicle
from drone_mesh.state.model import EventRecord

Message = Any  # of pymavlink, which has no types
Told = Tuple[int, Message]
"""A message, and the node that it is from."""

SLOW_S = 5  # period of what changes rarely; the rest is told once a second
PARAMETER = b"MESH_NODE_ID"
COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
HOLD, RETURN, LAND = px4_mode(4, 3), px4_mode(4, 5), px4_mode(4, 6)
_TEXT_BYTES = 50  # of one STATUSTEXT; a longer one has parts
_UINT16_UNKNOWN = 2**16 - 1
_NO_BREACH = mavlink.MAV_SYS_STATUS_GEOFENCE  # without a fence MAVProxy would tell of a breach
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_CAN = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
)

_NOTICE, _WARNING, _CRITICAL = (
    mavlink.MAV_SEVERITY_NOTICE, mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL,
)  # fmt: skip
_UNTOLD = {MeshEventKind.NEIGHBOUR_FOUND, MeshEventKind.NEIGHBOUR_LOST, MeshEventKind.NODE_MISSING}
_SEVERITIES = {
    MeshEventKind.EMERGENCY: _CRITICAL,
    MeshEventKind.CRASHED: _CRITICAL,
    MeshEventKind.BATTERY_EMPTY: _CRITICAL,
    MeshEventKind.DISCONNECTED: _WARNING,
    MeshEventKind.POWER_OFF: _WARNING,
    MeshEventKind.BATTERY_LOW: _WARNING,
    MeshEventKind.CANNOT_FLY: _WARNING,
    MeshEventKind.NO_ROUTE: _WARNING,
    MeshEventKind.GOAL_REFUSED: _WARNING,
    MeshEventKind.ORDER_REFUSED: _WARNING,
    MeshEventKind.ORDER_GIVEN_UP: _WARNING,
    MeshEventKind.ORDER_LOST_CONTACT: _WARNING,
}


class Fleet:
    """The vehicles as last shown. One thread."""

    def __init__(self, origin: Origin | None, silent_after_s: float, may_order: bool) -> None:
        """A node of which nothing was heard for `silent_after_s` gives no sign of life here.

        With `may_order` it says that it is a PX4: QGroundControl offers orders to no unknown kind.
        """
        self.origin = origin
        self._silent_after_s = silent_after_s
        self._may_order = may_order
        self._vehicles: dict[int, Vehicle] = {}
        self._before: dict[int, Vehicle] = {}  # with an earlier place
        self.now_s = -math.inf
        self.homes: dict[int, Location] = {}  # where each was first seen on the ground
        self.modes: dict[int, int] = {}  # of those that return or land; all others hold
        self._texts = 0

    def show(self, vehicles: Iterable[Vehicle], now_s: float) -> None:
        """This is the fleet now; `now_s` as the times of the vehicles."""
        self.now_s = now_s
        shown = {vehicle.node: vehicle for vehicle in vehicles}
        for node, vehicle in shown.items():
            earlier = self._vehicles.get(node)
            if earlier is not None and earlier.place_s < vehicle.place_s:
                self._before[node] = earlier
            if vehicle.flying is False and vehicle.place is not None:
                self.homes.setdefault(node, vehicle.place)
        self._vehicles = shown

    def alive(self, node: int) -> Vehicle | None:
        """The vehicle, if there is proof of it; else None."""
        vehicle = self._vehicles.get(node)
        is_silent = vehicle is None or self.now_s - vehicle.heard_s > self._silent_after_s
        return None if is_silent else vehicle

    def all_alive(self) -> list[Vehicle]:
        """Those of which there is proof, by id."""
        return [v for _node, v in sorted(self._vehicles.items()) if self.alive(v.node)]

    def speaker(self, node: int) -> int | None:
        """Whose vehicle tells of this node: itself, or else a gateway; None: nobody can."""
        if self.alive(node):
            return node
        return next((v.node for v in self.all_alive() if v.is_gateway), None)

    def every_second(self, second: int) -> Iterator[Told]:
        """What is told in this second, counted from any."""
        for vehicle in self.all_alive():
            is_slow = (second + vehicle.node) % SLOW_S == 0
            for kind, make in PROVIDED.items():
                if kind in _FAST or (is_slow and kind in _SLOW):
                    message = make(self, vehicle)
                    if message is not None:
                        yield vehicle.node, message

    def texts(self, node: int, severity: int, words: str) -> Iterator[Told]:
        """Words about a node, in the parts of STATUSTEXT."""
        speaker = self.speaker(node)
        if speaker is None:
            return
        text = (words if speaker == node else f"drone {node}: {words}").encode()
        self._texts = self._texts % _UINT16_UNKNOWN + 1
        number = self._texts if len(text) > _TEXT_BYTES else 0
        for part, at in enumerate(range(0, len(text), _TEXT_BYTES)):
            piece = text[at : at + _TEXT_BYTES]
            yield speaker, mavlink.MAVLink_statustext_message(severity, piece, number, part)

    def event(self, event: EventRecord) -> Iterator[Told]:
        """An event of the mesh, in words; an order's is told of its drone."""
        kind = MeshEventKind(event.kind)
        if kind in _UNTOLD:
            return
        is_order = event.order and event.peers and kind is not MeshEventKind.FLIGHT_ORDERED
        words = told(kind, () if is_order else event.peers, event.explanation())
        node = event.peers[0] if is_order else event.node
        yield from self.texts(node, _SEVERITIES.get(kind, _NOTICE), words)

    # One message each; None: it is not known ---------------------------------------------------

    def heartbeat(self, vehicle: Vehicle) -> Message:
        """Of a quadrocopter: armed means in flight."""
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED * bool(vehicle.flying)
        if self._may_order:
            mode |= mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        if vehicle.crashed:
            state = mavlink.MAV_STATE_CRITICAL
        elif vehicle.flying is None:
            state = mavlink.MAV_STATE_UNINIT
        else:
            state = mavlink.MAV_STATE_ACTIVE if vehicle.flying else mavlink.MAV_STATE_STANDBY
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_PX4 if self._may_order else mavlink.MAV_AUTOPILOT_GENERIC,
            mode,
            self.modes.get(vehicle.node, HOLD) if self._may_order else 0,
            state,
            3,  # the version of MAVLink's messages
        )

    def landed(self, vehicle: Vehicle) -> Message:
        """Whether it flies."""
        states = {
            None: mavlink.MAV_LANDED_STATE_UNDEFINED,
            True: mavlink.MAV_LANDED_STATE_IN_AIR,
            False: mavlink.MAV_LANDED_STATE_ON_GROUND,
        }
        undefined = mavlink.MAV_VTOL_STATE_UNDEFINED
        return mavlink.MAVLink_extended_sys_state_message(undefined, states[vehicle.flying])

    def place(self, vehicle: Vehicle) -> Message | None:
        """Where it was when it last reported: on the earth, or in the common frame."""
        place = vehicle.place
        if place is None:
            return None
        north_m_s, east_m_s, up_m_s = self._velocity(vehicle)
        time_ms = int(vehicle.place_s * 1000) % 2**32
        if self.origin is None:
            return mavlink.MAVLink_local_position_ned_message(
                time_ms, place.latitude, place.longitude, -place.height,
                north_m_s, east_m_s, -up_m_s,
            )  # fmt: skip
        earth = self.origin.to_earth(place)
        north, east, down = (_int16(100 * v) for v in (north_m_s, east_m_s, -up_m_s))
        return mavlink.MAVLink_global_position_int_message(
            time_ms,
            round(earth.latitude_deg * 1e7),
            round(earth.longitude_deg * 1e7),
            round(earth.altitude_m * 1000),
            round((place.height - self.home_height_m(vehicle.node)) * 1000),
            north, east, down, _UINT16_UNKNOWN,
        )  # fmt: skip

    def home_height_m(self, node: int) -> float:
        """From which its relative heights count: of its home, or else of the origin."""
        home = self.homes.get(node)
        return 0.0 if home is None else home.height

    def _velocity(self, vehicle: Vehicle) -> tuple[float, float, float]:
        """North, east, up in m/s: the mean between its last two places; 0 on the ground."""
        before = self._before.get(vehicle.node)
        if not vehicle.flying or vehicle.place is None or before is None or before.place is None:
            return 0.0, 0.0, 0.0
        took_s = vehicle.place_s - before.place_s
        north, east, up = ((b - a) / took_s for a, b in zip(before.place, vehicle.place))
        return north, east, up

    def status(self, vehicle: Vehicle) -> Message:
        """Whether it can fly, and its battery."""
        return mavlink.MAVLink_sys_status_message(
            _PREARM, _PREARM, _NO_BREACH | (0 if vehicle.why_not_fly else _PREARM),
            0, _UINT16_UNKNOWN, -1, _percent(vehicle), 0, 0, 0, 0, 0, 0,
        )  # fmt: skip

    def battery(self, vehicle: Vehicle) -> Message | None:
        """The charge of its battery; nothing else is known of it."""
        if vehicle.battery_percent is None:
            return None
        voltages, unknown_celsius = [_UINT16_UNKNOWN] * 10, 2**15 - 1
        return mavlink.MAVLink_battery_status_message(
            0, 0, 0, unknown_celsius, voltages, -1, -1, -1, _percent(vehicle)
        )

    def home(self, vehicle: Vehicle) -> Message | None:
        """Where it was first seen on the ground."""
        home = self.homes.get(vehicle.node)
        if home is None or self.origin is None:
            return None
        earth = self.origin.to_earth(home)
        return mavlink.MAVLink_home_position_message(
            round(earth.latitude_deg * 1e7),
            round(earth.longitude_deg * 1e7),
            round(earth.altitude_m * 1000),
            home.latitude, home.longitude, -home.height,
            [math.nan] * 4, math.nan, math.nan, math.nan,
        )  # fmt: skip

    def version(self, vehicle: Vehicle) -> Message:
        """What it can do: no missions, no fences, no files."""
        return mavlink.MAVLink_autopilot_version_message(
            _CAN, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, vehicle.node + 1
        )

    def parameter(self, vehicle: Vehicle) -> Message:
        """Its only one: QGroundControl waits for ever for those of a vehicle that has none."""
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        return mavlink.MAVLink_param_value_message(PARAMETER, vehicle.node, kind, 1, 0)


PROVIDED: dict[int, Callable[[Fleet, Vehicle], Message | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Fleet.heartbeat,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Fleet.landed,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Fleet.place,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Fleet.status,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Fleet.battery,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: Fleet.home,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Fleet.version,
}
_FAST = list(PROVIDED)[:3]
_SLOW = list(PROVIDED)[3:-1]


def _percent(vehicle: Vehicle) -> int:
    return -1 if vehicle.battery_percent is None else round(vehicle.battery_percent)


def _int16(number: float) -> int:
    return max(-(2**15) + 1, min(2**15 - 1, round(number)))
