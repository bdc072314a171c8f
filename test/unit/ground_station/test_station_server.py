"""The sockets: several stations at once, noise and floods, signatures, and the end."""

from __future__ import annotations

import logging
import math
import os
import socket
import threading
import time

import pytest
from desk_rig import HERE, ORIGIN, drone
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.errors import ConfigurationError
from drone_mesh.ground_station.server import MOST_STATIONS, GroundStationServer
from drone_mesh.ground_station.settings import Address, GroundStationSettings, signing_key
from drone_mesh.state.model import EventRecord

WITHIN_S = 20.0
PASSPHRASE = "a passphrase of the field"


class Station:
    """A ground station, over UDP or TCP."""

    def __init__(self, tcp=None, key=None):
        if tcp is None:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.socket.bind(("127.0.0.1", 0))
        else:
            self.socket = socket.create_connection(tcp)
        self.socket.settimeout(WITHIN_S)
        self.address = Address("udp", *self.socket.getsockname())
        self.codec = mavlink.MAVLink(None, 255, 190)
        self.codec.robust_parsing = True
        if key is not None:
            self.codec.signing.secret_key, self.codec.signing.sign_outgoing = key, True
            self.codec.signing.timestamp = int((time.time() - 1420070400) * 1e5)
        self.peer = None

    def hear(self, kind):
        """The next message of this kind."""
        deadline_s = time.monotonic() + WITHIN_S
        while time.monotonic() < deadline_s:
            data, peer = self.socket.recvfrom(65536)
            self.peer = peer or self.peer
            for message in self.codec.parse_buffer(data) or ():
                if message.get_type() == kind:
                    return message
        raise AssertionError(f"no {kind}")

    def hear_any(self):
        data, self.peer = self.socket.recvfrom(65536)
        return self.codec.parse_buffer(data)[0].get_type()

    def hear_all(self):
        """Until there is nothing more."""
        while True:
            self.hear_any()

    def say(self, message):
        self.say_bytes(message.pack(self.codec))
        self.codec.seq = (self.codec.seq + 1) % 256

    def say_bytes_for_ever(self, make):
        while True:
            self.say_bytes(make())

    def say_bytes(self, data):
        if self.peer is None:
            self.socket.sendall(data)
        else:
            self.socket.sendto(data, self.peer)


@pytest.fixture
def serve(monkeypatch):
    monkeypatch.setattr("drone_mesh.ground_station.server.OLD_VIEW_S", math.inf)  # shown only once
    servers = []

    def start(*addresses, order=lambda *_: None, **settings):
        server = GroundStationServer(
            GroundStationSettings(addresses, **settings), ORIGIN, 10.0, order
        )
        servers.append(server)
        server.start()
        server.show([drone(0), drone(3)], 100.0)
        return server

    yield start
    for server in servers:
        server.stop()
    assert not [t for t in threading.enumerate() if t.name == "ground stations"]


def listens_at(server):
    return server._listeners[0].getsockname()


def asks_for_missions():
    return mavlink.MAVLink_mission_request_list_message(4, 1, 0)


def lands():
    return mavlink.MAVLink_command_long_message(4, 1, mavlink.MAV_CMD_NAV_LAND, 0, *[0] * 7)


def test_two_stations_see_the_same_and_only_who_asks_is_answered(serve):
    one, two = Station(), Station()
    serve(one.address, two.address)
    assert {one.hear("HEARTBEAT").get_srcSystem() for _ in range(4)} == {1, 4}
    two.hear("GLOBAL_POSITION_INT")
    one.say(asks_for_missions())
    assert one.hear("MISSION_COUNT").count == 0
    assert "MISSION_COUNT" not in {two.hear_any() for _ in range(8)}


def test_a_station_over_tcp_is_served_and_one_too_many_is_not(serve):
    address = listens_at(serve(Address("tcp", "127.0.0.1", 0)))
    stations = [Station(tcp=address) for _ in range(MOST_STATIONS)]
    stations[-1].hear("HEARTBEAT")
    assert Station(tcp=address).socket.recv(1) == b""
    stations[0].socket.close()
    stations[1].say(asks_for_missions())
    stations[1].hear("MISSION_COUNT")


def test_noise_and_floods_stop_nobody(serve):
    one, stranger = Station(), Station()
    server = serve(one.address, Address("tcp", "127.0.0.1", 0))
    noisy = Station(tcp=listens_at(server))
    one.hear("HEARTBEAT")
    question = asks_for_missions().pack(one.codec)
    for _ in range(300):
        one.say_bytes(os.urandom(400))
        stranger.socket.sendto(question, one.peer)
        one.say_bytes(question[:-3])
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        noisy.say_bytes_for_ever(lambda: b"\xfe" + os.urandom(4000))
    one.say(asks_for_missions())
    one.hear("MISSION_COUNT")
    stranger.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        stranger.socket.recv(100)


def test_a_page_in_a_browser_that_posts_messages_is_no_station(serve):
    ordered = []
    server = serve(
        Address("tcp", "127.0.0.1", 0), may_order=True, order=lambda *order: ordered.append(order)
    )
    page, station = Station(tcp=listens_at(server)), Station(tcp=listens_at(server))
    page.say_bytes(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" + lands().pack(page.codec))
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        page.say_bytes_for_ever(lambda: b"and more")
    station.say(asks_for_missions())
    station.hear("MISSION_COUNT")
    assert ordered == []


def test_a_station_that_does_not_read_is_left(serve):
    server = serve(Address("tcp", "127.0.0.1", 0))
    server._listeners[0].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    station = Station(tcp=listens_at(server))
    station.hear("HEARTBEAT")
    for _ in range(100_000):
        server._post(0, mavlink.MAVLink_statustext_message(6, b"x" * 50), None)
        if not server._stations:
            return
    raise AssertionError("it is still there")


def test_only_signed_messages_count_and_each_only_once(serve, tmp_path, caplog):
    file = tmp_path / "passphrase"
    file.write_text(PASSPHRASE + "\n")
    file.chmod(0o600)
    key, ordered = signing_key(file), []
    one = Station(key=key)
    serve(one.address, key=key, may_order=True, order=lambda *order: ordered.append(order))
    assert one.hear("HEARTBEAT").get_signed()
    plain = mavlink.MAVLink(None, 255, 190)
    order = lands()
    one.say_bytes(order.pack(plain))
    forged = bytearray(order.pack(one.codec))
    forged[-7:] = b"\xff" * 7  # the time far ahead, and a wrong signature
    one.say_bytes(bytes(forged))
    one.say(order)
    assert one.hear("COMMAND_ACK").result == mavlink.MAV_RESULT_IN_PROGRESS
    caplog.set_level(logging.INFO)
    one.say_bytes(order.get_msgbuf())  # again, as who recorded it would
    one.say(asks_for_missions())
    one.hear("MISSION_COUNT")
    assert caplog.messages == []  # who says it a thousand times a second would fill the disk
    assert [(node, goal) for node, goal, _answer in ordered] == [(3, HERE._replace(height=0.0))]


def test_nothing_is_told_of_a_mesh_that_is_not_shown_any_more(serve, monkeypatch):
    one = Station()
    serve(one.address)
    one.hear("HEARTBEAT")
    monkeypatch.setattr("drone_mesh.ground_station.server.OLD_VIEW_S", 0.0)
    one.socket.settimeout(2.5)
    with pytest.raises(socket.timeout):
        one.hear_all()
    one.say(asks_for_missions())
    with pytest.raises(socket.timeout):
        one.hear_any()


def test_cursor_on_target_is_sent_for_each_new_place(serve):
    atak = Station()
    server = serve(cot=(atak.address,))
    uids = {atak.socket.recv(2000).partition(b'uid="')[2][:12] for _ in range(2)}
    assert uids == {b"drone_mesh.0", b"drone_mesh.3"}
    server.show([drone(0), drone(3, 101.0)], 101.0)
    assert b"drone_mesh.3" in atak.socket.recv(2000)


@pytest.mark.parametrize(
    ("stations", "cot", "may_order", "words"),
    [
        (["serial:/dev/ttyS0"], [], False, "use udp:HOST:PORT or tcp:HOST:PORT"),
        (["udp:127.0.0.1:99999"], [], False, "invalid --ground-station"),
        ([], ["tcp:127.0.0.1:8087"], False, "invalid --cot"),
        ([], [], True, "need --ground-station"),
        (["udp:192.0.2.1:14550"], [], True, "need --ground-station-key-file"),
        (["tcp:0.0.0.0:5760"], [], False, "need --ground-station-key-file"),
    ],
)
def test_what_cannot_be_meant_is_refused(stations, cot, may_order, words):
    with pytest.raises(ConfigurationError, match=words):
        GroundStationSettings.parse(stations, cot, may_order, "")


def test_without_an_origin_there_is_no_cursor_on_target():
    settings = GroundStationSettings.parse([], ["udp:127.0.0.1:6969"], False, "")
    with pytest.raises(ConfigurationError, match="needs an origin"):
        GroundStationServer(settings, None, 10.0, lambda *_: None)


@pytest.mark.slow
def test_mavsdk_as_the_station_sees_two_vehicles_and_orders_one(serve):
    mavsdk = pytest.importorskip("mavsdk", reason="the binary in its wheel does not load here")
    from mavsdk.plugins.action import action
    from mavsdk.plugins.mission import mission
    from mavsdk.plugins.param import param
    from mavsdk.plugins.telemetry import telemetry

    free, ordered = Station(), []
    free.socket.close()

    def order(node, goal, answer):
        ordered.append(goal)
        answer("")
        for kind in ("order sent", "order accepted"):
            server.tell(EventRecord(200.0, 0, kind, (node,), "", 7, goal))

    def wait_for(condition):
        deadline_s = time.monotonic() + WITHIN_S
        while not condition():
            assert time.monotonic() < deadline_s
            at = {"flying": bool(ordered), "place": (ordered or [HERE])[-1]}
            server.show([drone(0), drone(3, battery_percent=80.0, **at)], 100.0)
            time.sleep(0.2)

    server = serve(free.address, may_order=True, order=order)
    kind = mavsdk.ComponentType.GROUND_STATION
    station = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    try:
        station.add_any_connection(f"udpin://127.0.0.1:{free.address.port}")
        wait_for(lambda: station.system_count() >= 2)
        (system,) = (one for one in station.get_systems() if one.get_system_id() == 4)
        reports, orders = telemetry.Telemetry(system), action.Action(system)
        wait_for(lambda: abs(reports.position().absolute_altitude_m - 7.0) < 0.01)
        wait_for(lambda: reports.battery().remaining_percent == pytest.approx(80))
        orders.goto_location(52.0 + 100 / 111_267, 5.0, 13.0, 0.0)
        assert tuple(ordered[-1]) == pytest.approx((100.0, 0.0, 10.0), abs=0.1)
        wait_for(lambda: reports.armed() and reports.in_air())
        orders.land()
        assert ordered[-1].height == 0.0
        with pytest.raises(Exception, match="UNSUPPORTED"):
            orders.arm()
        assert mission.Mission(system).download_mission().mission_items == []
        assert param.Param(system).get_param_float("MESH_NODE_ID") == 3.0
    finally:
        station.destroy()
