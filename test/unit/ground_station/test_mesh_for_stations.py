"""A whole mesh in one process, seen by a ground station: pymavlink, by bytes."""

from __future__ import annotations

import queue

import pytest
from desk_rig import ORIGIN, reposition, text_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from test_station_server import Station

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.ground_station.gateway_link import GatewayLink
from drone_mesh.ground_station.reports import Fleet
from drone_mesh.ground_station.requests import Desk
from drone_mesh.ground_station.settings import GroundStationSettings
from drone_mesh.ground_station.vehicles import PROOF_PERIODS, vehicles_of_gateway
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.node import event_records
from drone_mesh.web.access import Allowance

REPORT_PERIOD_S = 30.0
SILENT_S = PROOF_PERIODS * REPORT_PERIOD_S


class StationOfMesh:
    """Runs the mesh, and keeps what the station was told: second, vehicle, message."""

    def __init__(self, routers, gridsize, routing="child_table_tree"):
        timing = MeshTiming(report_period_s=REPORT_PERIOD_S)
        self.network = Network(seed=1, timing=timing, routing=routing)
        self.network.add_fleet(gateways=1, routers=routers, gridsize=gridsize, spacing=6.0)
        self.fleet = Fleet(ORIGIN, SILENT_S, may_order=True)
        limit = Allowance(300, 0.05, clock=lambda: self.network.clock.now_s)
        self.desk = Desk(self.fleet, self._order, self._post, limit)
        self.codec = mavlink.MAVLink(None, 255, 190)
        self.told, self._seen = [], 0

    def _order(self, node, goal, answer):
        gateway, place = self.network.nodes[0].component, (*goal[:2], int(goal.height))
        try:
            taken = gateway.send_goal_request_to_drone(node, *place, self.network.clock.now_s)
        except GoalRefused as error:
            answer(str(error))
        else:
            answer("" if taken else "no route")

    def _post(self, node, message, _station):
        packet = message.pack(mavlink.MAVLink(None, node + 1, 1))
        for parsed in self.codec.parse_buffer(packet):
            self.told.append((self.network.clock.now_s, parsed.get_srcSystem() - 1, parsed))

    def run_for(self, seconds):
        for second in range(seconds):
            self.network.run_for(1.0)
            node, now_s = self.network.nodes[0], self.network.clock.now_s
            self.fleet.show(vehicles_of_gateway(node.component, node.drone, now_s), now_s)
            events = self.network.events[self._seen :]
            self._seen += len(events)
            for event in event_records(events):
                self.desk.event(event)
                for told in self.fleet.event(event):
                    self._post(*told, None)
            for told in self.fleet.every_second(second):
                self._post(*told, None)

    def send(self, message):
        for parsed in self.codec.parse_buffer(message.pack(self.codec)):
            self.desk.received(parsed, None)

    def of(self, kind, node=None, since_s=0.0):
        return [
            (at_s, m)
            for at_s, n, m in self.told
            if m.get_type() == kind and node in (None, n) and at_s >= since_s
        ]


@pytest.mark.parametrize(
    ("routers", "gridsize"), [(16, 4), pytest.param(99, 10, marks=pytest.mark.slow)]
)
def test_each_node_is_a_vehicle_at_the_place_that_it_reported(routers, gridsize):
    station = StationOfMesh(routers, gridsize)
    station.run_for(40)
    last_s = station.network.clock.now_s
    alive = {m.get_srcSystem() for _at, m in station.of("HEARTBEAT", since_s=last_s)}
    assert alive == set(range(1, routers + 2))
    for node in range(1, routers + 1):
        _at_s, message = station.of("GLOBAL_POSITION_INT", node, last_s)[-1]
        x, y = (message.lon - 5e7) / 1e7 * 68_670, (message.lat - 52e7) / 1e7 * 111_267
        place = station.network.location(node)
        assert (x, y) == pytest.approx((place.longitude, place.latitude), abs=0.4)
        assert last_s - message.time_boot_ms / 1000 <= REPORT_PERIOD_S + 1.0


@pytest.mark.slow
def test_a_lost_node_ends_its_heartbeats_and_begins_them_again():
    station = StationOfMesh(16, 4)
    station.run_for(40)
    station.network.power(16, False)
    lost_s = station.network.clock.now_s
    station.run_for(int(SILENT_S) + 20)
    last_s = max(at_s for at_s, _m in station.of("HEARTBEAT", 16))
    assert last_s - lost_s <= SILENT_S + 1.0
    assert station.of("HEARTBEAT", 15, since_s=station.network.clock.now_s)
    station.network.power(16, True)
    station.run_for(60)
    assert station.of("HEARTBEAT", 16, since_s=station.network.clock.now_s - 1.0)


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_an_order_from_a_station_flies_and_the_new_place_is_told_at_once(routing):
    station = StationOfMesh(16, 4, routing)
    station.run_for(40)
    ordered_s = station.network.clock.now_s
    station.send(reposition(52.0 + 15.0 / 111_267, 5.0 + 9.0 / 68_670, 5.0, node=16))
    station.run_for(30)
    results = [m.result for _at_s, m in station.of("COMMAND_ACK", 16)]
    assert results == [mavlink.MAV_RESULT_IN_PROGRESS, mavlink.MAV_RESULT_ACCEPTED]
    assert station.network.location(16).distance_m(Location(15.0, 9.0, 2.0)) < 0.5
    words = " ".join(text_of(m) for _at_s, m in station.of("STATUSTEXT", 16, ordered_s))
    assert "order accepted" in words
    assert "order arrived" in words
    (landed_s,) = (e.now_s for e in station.network.events if e.kind.value == "landed")
    places = [m for _at_s, m in station.of("GLOBAL_POSITION_INT", 16, ordered_s)]
    times_s = {m.time_boot_ms / 1000 for m in places}
    assert any(landed_s <= at_s <= landed_s + 3.0 for at_s in times_s)
    if routing == "beacon":  # with the document's way, a drone in flight has no gateway
        in_flight = [at_s for at_s in times_s if ordered_s <= at_s <= landed_s]
        assert len(in_flight) >= 0.8 * (landed_s - ordered_s)


def test_the_place_of_another_drone_is_refused_in_the_words_of_the_gateway():
    network = Network(seed=1)
    network.add_fleet(gateways=1, routers=3, gridsize=3, spacing=6.0)
    network.run_for(20.0)
    work, shown, ends, station = queue.SimpleQueue(), [], [], Station()
    link = GatewayLink(
        GroundStationSettings((station.address,), may_order=True),
        ORIGIN,
        10.0,
        network.nodes[0].drone,
        work.put,
        lambda _period_s, show: shown.append(show) or (lambda: ends.append(True)),
    )
    link.connect(network.nodes[0].component)
    try:
        shown[0](network.clock.now_s)
        assert {station.hear("HEARTBEAT").get_srcSystem() for _ in range(4)} == {1, 2, 3, 4}
        station.say(reposition(52.0, 5.0, 3.0, node=3))  # where drone 1 stands
        assert station.hear("COMMAND_ACK").result == mavlink.MAV_RESULT_IN_PROGRESS
        work.get(timeout=20.0)(network.clock.now_s)
        assert station.hear("COMMAND_ACK").result == mavlink.MAV_RESULT_DENIED
        parts = [text_of(station.hear("STATUSTEXT")) for _ in range(2)]
        assert "".join(parts).startswith("not ordered: drone 1 stands 0.0 m from there")
        link.observe(MeshEvent(MeshEventKind.LANDED, 2, network.clock.now_s))
        assert text_of(station.hear("STATUSTEXT")) == "landed"
    finally:
        link.disconnect()
    assert ends == [True]
