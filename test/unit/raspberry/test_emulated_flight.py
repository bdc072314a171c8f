"""Emulated radios and simulated MAVLink vehicles together, under a virtual clock.

Mesh software, radio driver and MAVLink pilot are the real ones; chips, air and vehicles are not.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "drone"))
from mavlink_rig import ALL, ORIGIN, Wire
from mavlink_vehicle.modes import Mode
from mavlink_vehicle.vehicle import MavlinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, OUR_SYSTEM_ID, PX4, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.mavlink.pilot import MavlinkPilot
from drone_mesh.errors import LocationUnknown
from drone_mesh.formations.layouts import Layouts
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.node import InProcessNode

STEP_S = 0.05
LIMITS = FlightLimits(speed_m_s=4.0, cruise_height_m=3.0, layer_m=0.5)
GATEWAY = Location(latitude=0.0, longitude=-1.0, height=0.0)
CASUS = Path(__file__).parents[3] / "config" / "casus.yaml"
LAYOUT_202 = {0: GATEWAY, **dict(Layouts.load(CASUS).orders(202))}


class VirtualEngine(IDroneEngine):
    """A MAVLink pilot with its vehicle at the other end of a line, driven by the air's clock."""

    def __init__(self, mesh: Network, node_id: int, home: Location, kind: Autopilot) -> None:
        self._mesh, self._node_id = mesh, node_id
        self._down = Wire(OUR_SYSTEM_ID, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._up = Wire(1, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self.vehicle = MavlinkVehicle(kind, Origin(*ORIGIN.to_earth(home)), self._up.send)
        self.pilot = MavlinkPilot(node_id, ORIGIN, LIMITS, ALL, self._down.send)
        self._goals: list[tuple[Location, bool, bool]] = []  # lands there; for a repair
        self._status = self.pilot.status(mesh.now_s())
        self._step(None)

    def _step(self, _argument: Any) -> None:
        now_s = self._mesh.now_s()
        self.vehicle.tick(now_s)
        for message in self._up.take():
            self.pilot.on_message(message, now_s)
        while self._goals:
            goal, lands, for_repair = self._goals.pop(0)
            self.pilot.set_goal(goal, lands, now_s, for_repair)
        self.pilot.tick(now_s)
        for message in self._down.take():
            self.vehicle.on_message(message, now_s)
        self._status = self.pilot.status(now_s)
        node = self._mesh.nodes.get(self._node_id)
        if node is not None and self._status.location is not None:
            node.antenna.chip.position = self._status.location.to_vector()
        self._mesh.clock.call_at(now_s + STEP_S, self._step, None)

    def commands(self) -> list[int]:
        return [m.command for m in self._down.sent if m.get_type() == "COMMAND_LONG"]

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        self._goals.append((Location(latitude, longitude, height), height <= 0.0, False))

    def step_back_to(self, latitude: float, longitude: float, height: float) -> None:
        hover_m = LIMITS.layer_height_m(self._node_id)
        self._goals.append((Location(latitude, longitude, hover_m), False, True))

    def get_location(self) -> Location:
        if self._status.location is None:
            raise LocationUnknown(self._status.location_trouble)
        return self._status.location

    def why_not_fly(self) -> str:
        return self._status.why_not_fly

    def why_not_repair(self) -> str:
        return self._status.why_not_repair

    def why_ended(self) -> str:
        return self._status.ended

    def is_flying(self) -> bool:
        return bool(self._goals) or self._status.is_flying


class FlyingMesh(Network):
    """Each node has a vehicle."""

    def __init__(self, kind: Autopilot, seed: int) -> None:
        timing = MeshTiming(check_period_s=5.0, connection_lost_after_s=15.0)
        super().__init__(seed, timing, radio="chips")
        self.engines: dict[int, VirtualEngine] = {}
        self._kind = kind

    def _install(self, node: InProcessNode, node_id: int) -> None:
        home = node.drone.get_location()
        node.drone = self.engines[node_id] = VirtualEngine(self, node_id, home, self._kind)
        super()._install(node, node_id)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [ARDUPILOT, PX4], ids=lambda a: a.name)
def test_layout_202_without_node_1_is_repaired_by_drones_that_really_fly(kind: Autopilot) -> None:
    mesh = FlyingMesh(kind, seed=3)
    for node_id, place in LAYOUT_202.items():
        add = mesh.add_router if node_id else mesh.add_gateway
        add(node_id, place.longitude, place.latitude)
    try:
        assert mesh.run_until(mesh.all_connected, within_s=60.0)
        mesh.run_for(30.0)  # everything is reported, and each knows where to step back to
        assert all(engine.can_fly() for engine in mesh.engines.values())
        mesh.power(1, False)
        mesh.run_for(10.0)
        assert not mesh.all_connected()
        assert mesh.run_until(mesh.all_connected, within_s=240.0)
        mesh.run_for(30.0)
        assert mesh.all_connected()
        flown = {
            node_id
            for node_id, engine in mesh.engines.items()
            if engine.get_location().distance_m(LAYOUT_202[node_id]) > 0.5
        }
        assert 2 in flown
        assert 1 not in flown
        place, goal = mesh.engines[2].get_location(), LAYOUT_202[1]
        assert place.latitude == pytest.approx(goal.latitude, abs=1.2)
        assert place.longitude == pytest.approx(goal.longitude, abs=1.2)
        for node_id in flown:  # they hover: no order to land was given
            height_m = LIMITS.layer_height_m(node_id)
            assert mesh.engines[node_id].get_location().height == pytest.approx(height_m, abs=1.0)
            assert mesh.engines[node_id].vehicle.body.armed
    finally:
        mesh.stop()


@pytest.mark.slow
@pytest.mark.parametrize("kind", [ARDUPILOT, PX4], ids=lambda a: a.name)
def test_a_drone_whose_pilot_chose_to_hover_is_not_flown_by_a_repair(kind: Autopilot) -> None:
    mesh = FlyingMesh(kind, seed=4)
    for node_id, east_m in ((0, 0.0), (1, 6.0), (2, 8.0)):
        add = mesh.add_router if node_id else mesh.add_gateway
        add(node_id, east_m, 0.0)
    try:
        assert mesh.run_until(mesh.all_connected, within_s=60.0)
        mesh.run_for(30.0)
        gateway, two = mesh.nodes[0].component, mesh.engines[2]
        assert gateway.send_goal_request_to_drone(2, 0.0, 30.0, 3, mesh.now_s())
        assert mesh.run_until(lambda: two.get_location().longitude > 9.0, within_s=60.0)
        two.vehicle.choose_mode(Mode.HOLD)  # in LOITER or HOLD, the pilot flies
        mesh.run_for(30.0)
        (order,) = gateway.get_orders()
        hold = kind.mode_name(kind.hold_mode)
        assert order.reason.startswith(f"{hold} was chosen: the pilot flies; ")
        place, commands = two.get_location(), len(two.commands())
        mesh.power(0, False)  # the gateway falls silent
        mesh.run_for(150.0)
        assert not mesh.nodes[2].component.get_connected_to_gateway()
        assert two.vehicle.mode is Mode.HOLD
        assert two.get_location().distance_m(place) < 0.5
        assert len(two.commands()) == commands
    finally:
        mesh.stop()
