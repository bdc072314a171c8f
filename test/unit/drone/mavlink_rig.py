"""A pilot and a simulated vehicle on one in-memory link, under a virtual clock."""

from __future__ import annotations

import math
from typing import Callable

from mavlink_vehicle.modes import Mode
from mavlink_vehicle.vehicle import MavlinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.fence import Fence
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, OUR_SYSTEM_ID, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.pilot import MavlinkPilot
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.drone.mavlink.telemetry import Message

STEP_S = 0.05
ORIGIN = Origin(52.0907, 5.1214, 3.0)
ALL = Permissions(may_arm=True, may_take_off=True, may_change_mode=True)
NONE = Permissions()


class Wire:
    """Packs and parses, as a line does; breaks when `broken` is set."""

    def __init__(self, system_id: int, component_id: int) -> None:
        self._sender = mavlink.MAVLink(None, system_id, component_id)
        self._receiver = mavlink.MAVLink(None)
        self.waiting: list[tuple[int, Message]] = []  # and at which take it arrives
        self.sent: list[Message] = []
        self.broken = False
        self.loses: Callable[[], bool] = lambda: False  # asked for each message
        self.delays: Callable[[], int] = lambda: 0  # by how many takes; likewise
        self._takes = 0

    def send(self, message: Message) -> None:
        data = message.pack(self._sender)
        if self.broken or self.loses():
            return
        for arrived in self._receiver.parse_buffer(data) or ():
            self.sent.append(arrived)
            self.waiting.append((self._takes + self.delays(), arrived))

    def take(self) -> list[Message]:
        taken = [message for at, message in self.waiting if at <= self._takes]
        self.waiting = [(at, message) for at, message in self.waiting if at > self._takes]
        self._takes += 1
        return taken


class Rig:
    """One node's drone."""

    def __init__(
        self,
        autopilot: Autopilot = ARDUPILOT,
        permissions: Permissions = ALL,
        limits: FlightLimits = FlightLimits(),  # noqa: B008 - frozen
        node_id: int = 1,
        fence: Fence = Fence(),  # noqa: B008 - frozen
    ) -> None:
        self.now_s = 100.0
        self.limits = limits
        self.down = Wire(OUR_SYSTEM_ID, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self.up = Wire(1, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self.vehicle = MavlinkVehicle(autopilot, ORIGIN, self.up.send)
        self.pilot = MavlinkPilot(node_id, ORIGIN, limits, permissions, self.down.send, fence)
        self.heights: list[float] = []
        self.shown_mode: int | None = None  # in heartbeats, in place of the vehicle's own

    def step(self) -> None:
        self.now_s += STEP_S
        self.vehicle.tick(self.now_s)
        for message in self.up.take():
            if self.shown_mode is not None and message.get_type() == "HEARTBEAT":
                message.custom_mode = self.shown_mode
            self.pilot.on_message(message, self.now_s)
        self.pilot.tick(self.now_s)
        for message in self.down.take():
            self.vehicle.on_message(message, self.now_s)
        self.heights.append(self.vehicle.body.place.height)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def run_until(self, what: str, holds: Callable[[], bool], within_s: float = 120.0) -> None:
        end_s = self.now_s + within_s
        while not holds():
            assert self.now_s < end_s, f"not within {within_s:g} s: {what}; {self.status()}"
            self.step()

    def ready(self) -> Rig:
        """Wait until all that a pilot needs to know was reported."""
        self.run_until("everything is reported", lambda: self.status().home is not None)
        self.run(3.0)
        return self

    def status(self):  # the pilot's
        return self.pilot.status(self.now_s)

    def goal(self, latitude: float, longitude: float, height: float, lands: bool = False) -> None:
        self.pilot.set_goal(Location(latitude, longitude, height), lands, self.now_s)

    def repair(self, latitude: float, longitude: float, height: float) -> None:
        goal = Location(latitude, longitude, height)
        self.pilot.set_goal(goal, False, self.now_s, for_repair=True)

    def reach(self, phase: Phase, within_s: float = 120.0) -> None:
        self.run_until(phase.value, lambda: self.status().phase is phase, within_s)

    @property
    def place(self) -> Location:
        return self.vehicle.body.place

    def commands(self) -> list[int]:
        """What the vehicle was ordered to do, without what it was asked to report."""
        asked = (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,)
        return [
            m.command
            for m in self.down.sent
            if m.get_type() == "COMMAND_LONG" and m.command not in asked
        ]

    def targets(self) -> list[Location]:
        """Every target that was sent, in the common frame."""
        return [target_location(m) for m in self.down.sent if m.get_type() == TARGET]


TARGET = "SET_POSITION_TARGET_GLOBAL_INT"


def lift(vehicle: MavlinkVehicle, height_m: float) -> None:
    """Its human pilot has taken it to this height, where it hovers."""
    vehicle.arm()
    vehicle.body.place = vehicle.body.place._replace(height=height_m)
    vehicle.choose_mode(Mode.HOLD)


def target_location(message: Message) -> Location:
    from drone_mesh.drone.geodesy import EarthPlace

    return ORIGIN.to_frame(EarthPlace(message.lat_int / 1e7, message.lon_int / 1e7, message.alt))


def is_inside(target: Location, limits: FlightLimits, home: Location) -> bool:
    distance_m = math.hypot(target.latitude - home.latitude, target.longitude - home.longitude)
    return distance_m <= limits.max_distance_m + 0.1 and target.height <= (
        home.height + limits.max_height_m + 0.1
    )


def in_the_air(autopilot: Autopilot, permissions: Permissions = ALL) -> Rig:
    """Its pilot has taken it to 8 m."""
    rig = Rig(autopilot, permissions)
    lift(rig.vehicle, 8.0)
    return rig.ready()


def in_flight(autopilot: Autopilot, permissions: Permissions = ALL) -> Rig:
    """The pilot gave it to the mesh in the air, and it flies as ordered."""
    rig = in_the_air(autopilot, permissions)
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run_until("it can fly", lambda: not rig.status().why_not_fly, within_s=3.0)
    rig.goal(100.0, 0.0, 8.0)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 10.0)
    return rig
