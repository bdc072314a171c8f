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
PARAMETER = "MESH_NODE_ID"
AIRBORNE_M = 1.0  # above its home; a drone at rest is in the air from there on: it hovers
COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
HOLD, RETURN, LAND = px4_mode(4, 3), px4_mode(4, 5), px4_mode(4, 6)
_TEXT_BYTES = 50  # of one STATUSTEXT; a longer one has parts
_UINT16_UNKNOWN, _INT16_UNKNOWN = 2**16 - 1, 2**15 - 1
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_NO_BREACH = mavlink.MAV_SYS_STATUS_GEOFENCE  # without a fence MAVProxy would tell of a breach
_CAN = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)  # fmt: skip
_UNTOLD = {
    MeshEventKind.NEIGHBOUR_FOUND, MeshEventKind.NEIGHBOUR_LOST, MeshEventKind.NODE_MISSING,
    MeshEventKind.FLIGHT_ORDERED,  # which its gateway tells, too
}  # fmt: skip
_CRITICAL = {MeshEventKind.EMERGENCY, MeshEventKind.CRASHED, MeshEventKind.BATTERY_EMPTY}
_WARNINGS = {
    MeshEventKind.DISCONNECTED, MeshEventKind.POWER_OFF, MeshEventKind.BATTERY_LOW,
    MeshEventKind.CANNOT_FLY, MeshEventKind.NO_ROUTE, MeshEventKind.GOAL_REFUSED,
    MeshEventKind.ORDER_REFUSED, MeshEventKind.ORDER_GIVEN_UP, MeshEventKind.ORDER_LOST_CONTACT,
    MeshEventKind.OUTSIDE_FENCE,
}  # fmt: skip


class Fleet:
    """The vehicles as last shown. One thread."""

    def __init__(self, origin: Origin | None, silent_after_s: float, may_order: bool) -> None:
        """A node of which nothing was heard for `silent_after_s` gives no sign of life here.

        With `may_order` it says that it is a PX4: QGroundControl offers orders to no unknown kind.
        """
        self.origin = origin
        self.may_order = may_order
        self._silent_after_s = silent_after_s
        self._vehicles: dict[int, Vehicle] = {}
        self._before: dict[int, Vehicle] = {}  # with an earlier place
        self.now_s = -math.inf
        self.homes: dict[int, Location] = {}  # where each was first seen at rest
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
        return [vehicle for node in sorted(self._vehicles) if (vehicle := self.alive(node))]

    def every_second(self, second: int) -> Iterator[Told]:
        """What is told in this second, counted from any."""
        for vehicle in self.all_alive():
            for make in _FAST + _SLOW * ((second + vehicle.node) % SLOW_S == 0):
                message = make(self, vehicle)
                if message is not None:
                    yield vehicle.node, message

    def texts(self, node: int, severity: int, words: str) -> Iterator[Told]:
        """Words about a node, in the parts of STATUSTEXT; a lost one's gateway says them."""
        gateways = [vehicle.node for vehicle in self.all_alive() if vehicle.is_gateway]
        if not (self.alive(node) or gateways):
            return
        speaker = node if self.alive(node) else gateways[0]
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
        is_order = event.order and event.peers
        words = told(kind, () if is_order else event.peers, event.explanation())
        severity = mavlink.MAV_SEVERITY_NOTICE - (kind in _WARNINGS) - 3 * (kind in _CRITICAL)
        yield from self.texts(event.peers[0] if is_order else event.node, severity, words)

    # One message each; None: it is not known ---------------------------------------------------

    def heartbeat(self, vehicle: Vehicle) -> Message:
        """Of a quadrocopter: armed means in the air."""
        in_air = self._in_air(vehicle)
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED * in_air
        autopilot, own_mode = mavlink.MAV_AUTOPILOT_GENERIC, 0
        if self.may_order:
            mode |= mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
            autopilot, own_mode = mavlink.MAV_AUTOPILOT_PX4, self.modes.get(vehicle.node, HOLD)
        state = mavlink.MAV_STATE_ACTIVE if in_air else mavlink.MAV_STATE_STANDBY
        if vehicle.crashed:
            state = mavlink.MAV_STATE_CRITICAL
        elif vehicle.flying is None:
            state = mavlink.MAV_STATE_UNINIT
        kind, version = mavlink.MAV_TYPE_QUADROTOR, 3
        return mavlink.MAVLink_heartbeat_message(kind, autopilot, mode, own_mode, state, version)

    def landed(self, vehicle: Vehicle) -> Message:
        state = mavlink.MAV_LANDED_STATE_UNDEFINED
        if vehicle.flying is not None:
            ground, air = mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_IN_AIR
            state = air if self._in_air(vehicle) else ground
        return mavlink.MAVLink_extended_sys_state_message(0, state)

    def _in_air(self, vehicle: Vehicle) -> bool:
        if vehicle.flying or vehicle.flying is None or vehicle.place is None:
            return bool(vehicle.flying)
        return vehicle.place.height - self.home_height_m(vehicle.node) > AIRBORNE_M

    def place(self, vehicle: Vehicle) -> Message | None:
        """Where it was when it last reported: on the earth, or in the common frame."""
        place, time_ms = vehicle.place, int(max(0.0, vehicle.place_s) * 1000) % 2**32
        if place is None:
            return None
        before, speed = self._before.get(vehicle.node), (0.0, 0.0, 0.0)
        if vehicle.flying and before is not None and before.place is not None:  # the mean since
            took_s = vehicle.place_s - before.place_s
            north, east, up = ((b - a) / took_s for a, b in zip(before.place, place))
            speed = north, east, -up
        if self.origin is None:
            north_east_down = place.latitude, place.longitude, -place.height
            return mavlink.MAVLink_local_position_ned_message(time_ms, *north_east_down, *speed)
        cm_s = (max(-_INT16_UNKNOWN, min(_INT16_UNKNOWN, round(100 * v))) for v in speed)
        relative_mm = round((place.height - self.home_height_m(vehicle.node)) * 1000)
        return mavlink.MAVLink_global_position_int_message(
            time_ms, *_on_earth(self.origin, place), relative_mm, *cm_s, _UINT16_UNKNOWN
        )

    def home_height_m(self, node: int) -> float:
        """From which its relative heights count: of its home, or else of the origin."""
        home = self.homes.get(node)
        return 0.0 if home is None else home.height

    def status(self, vehicle: Vehicle) -> Message:
        """Whether it can fly, and its battery."""
        can_fly = vehicle.flying is not None and not vehicle.why_not_fly
        healthy = _NO_BREACH | _PREARM * can_fly
        unknown = 0, _UINT16_UNKNOWN, -1, _percent(vehicle)
        return mavlink.MAVLink_sys_status_message(_PREARM, _PREARM, healthy, *unknown, *[0] * 6)

    def battery(self, vehicle: Vehicle) -> Message | None:
        """The charge of its battery; nothing else is known of it."""
        if vehicle.battery_percent is None:
            return None
        unknown = _INT16_UNKNOWN, [_UINT16_UNKNOWN] * 10, -1, -1, -1
        return mavlink.MAVLink_battery_status_message(0, 0, 0, *unknown, _percent(vehicle))

    def home(self, vehicle: Vehicle) -> Message | None:
        """Where it was first seen at rest."""
        home, nan = self.homes.get(vehicle.node), math.nan
        if home is None or self.origin is None:
            return None
        local = home.latitude, home.longitude, -home.height
        where = *_on_earth(self.origin, home), *local
        return mavlink.MAVLink_home_position_message(*where, [nan] * 4, nan, nan, nan)

    def version(self, vehicle: Vehicle) -> Message:
        """What it can do: no missions, no fences, no files."""
        unknown = 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0
        return mavlink.MAVLink_autopilot_version_message(_CAN, *unknown, vehicle.node + 1)

    def parameter(self, vehicle: Vehicle) -> Message:
        """Its only one: QGroundControl waits for ever for those of a vehicle that has none."""
        real = mavlink.MAV_PARAM_TYPE_REAL32
        return mavlink.MAVLink_param_value_message(PARAMETER.encode(), vehicle.node, real, 1, 0)


Make = Callable[[Fleet, Vehicle], "Message | None"]
_FAST: list[Make] = [Fleet.heartbeat, Fleet.landed, Fleet.place]
_SLOW: list[Make] = [Fleet.status, Fleet.battery, Fleet.home]
PROVIDED: dict[int, Make] = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Fleet.place,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Fleet.status,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Fleet.battery,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: Fleet.home,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Fleet.version,
}


def _on_earth(origin: Origin, place: Location) -> tuple[int, int, int]:
    """1e-7 degrees north and east, and mm above the sea."""
    north_deg, east_deg, altitude_m = origin.to_earth(place)
    return round(north_deg * 1e7), round(east_deg * 1e7), round(altitude_m * 1000)


def _percent(vehicle: Vehicle) -> int:
    percent = vehicle.battery_percent
    return -1 if percent is None else round(max(0.0, min(100.0, percent)))
