"""MAVSDK as the ground station, a program that others wrote."""

from __future__ import annotations

import socket
import time

import pytest
from desk_rig import HERE, ORIGIN, drone

from drone_mesh.ground_station.server import GroundStationServer
from drone_mesh.ground_station.settings import Address, GroundStationSettings
from drone_mesh.state.model import EventRecord

mavsdk = pytest.importorskip("mavsdk", reason="the binary in MAVSDK's wheel does not load here")

WITHIN_S = 30.0


class AcceptingMesh:
    """Three drones, of which nodes 0 and 3 are known; each order is accepted and flown at once."""

    def __init__(self, port):
        settings = GroundStationSettings((Address("udp", "127.0.0.1", port),), may_order=True)
        self.server = GroundStationServer(settings, ORIGIN, 10.0, self._order)
        self.ordered = []
        self.server.start()

    def show(self):
        now_s = time.monotonic()
        at = self.ordered[-1] if self.ordered else HERE
        moving = drone(3, now_s, flying=bool(self.ordered), place=at, battery_percent=80.0)
        self.server.show([drone(0, now_s), moving], now_s)

    def _order(self, node, goal, answer):
        self.ordered.append(goal)
        answer("")
        for kind in ("order sent", "order accepted"):
            self.server.tell(EventRecord(time.monotonic(), 0, kind, (node,), "", 7, goal))


@pytest.fixture
def mesh():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    mesh = AcceptingMesh(port)
    station = mavsdk.Mavsdk(
        mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
    )
    station.add_any_connection(f"udpin://127.0.0.1:{port}")
    mesh.station = station
    yield mesh
    station.destroy()
    mesh.server.stop()


def wait_for(mesh, what, condition):
    deadline_s = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < deadline_s, what
        mesh.show()
        time.sleep(0.2)


@pytest.mark.slow
def test_mavsdk_sees_two_vehicles_and_orders_one(mesh):
    from mavsdk.plugins.action import action
    from mavsdk.plugins.mission import mission
    from mavsdk.plugins.param import param
    from mavsdk.plugins.telemetry import telemetry

    wait_for(mesh, "both are found", lambda: mesh.station.system_count() >= 2)
    (system,) = (one for one in mesh.station.get_systems() if one.get_system_id() == 4)
    reports = telemetry.Telemetry(system)
    wait_for(mesh, "its place", lambda: abs(reports.position().absolute_altitude_m - 7.0) < 0.01)
    wait_for(mesh, "its battery", lambda: reports.battery().remaining_percent == pytest.approx(80))
    assert not reports.armed()
    orders = action.Action(system)
    orders.goto_location(52.0 + 100 / 111_267, 5.0, 13.0, 0.0)
    assert tuple(mesh.ordered[-1]) == pytest.approx((100.0, 0.0, 10.0), abs=0.1)
    wait_for(mesh, "it flies", lambda: reports.armed() and reports.in_air())
    orders.land()
    assert mesh.ordered[-1].height == 0.0
    with pytest.raises(Exception, match="UNSUPPORTED"):
        orders.arm()
    assert mission.Mission(system).download_mission().mission_items == []
    assert param.Param(system).get_param_float("MESH_NODE_ID") == 3.0
