"""MavlinkEngine over UDP, in wall time."""

from __future__ import annotations

import socket
import threading
import time
from typing import Iterator

import pytest
from mavlink_vehicle.server import VehicleServer
from patience import PATIENCE_S, free_port, wait_for

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, PX4
from drone_mesh.drone.mavlink.engine import MavlinkEngine
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.link import UdpLine
from drone_mesh.errors import GoalRefused, LocationUnknown

pytestmark = pytest.mark.slow  # autopilots and links live in real time

ORIGIN = Origin(52.0907, 5.1214, 3.0)
LIMITS = FlightLimits(speed_m_s=20.0, cruise_height_m=4.0, layer_m=0.0)
ALL = Permissions(may_arm=True, may_take_off=True, may_change_mode=True)


@pytest.fixture(params=[ARDUPILOT, PX4], ids=lambda a: a.name)
def server(request: pytest.FixtureRequest) -> Iterator[VehicleServer]:
    server = VehicleServer(request.param, [ORIGIN])
    server.vehicles[0].body.speed_m_s = 25.0
    server.start()
    yield server
    server.close()


@pytest.fixture
def engine(server: VehicleServer) -> Iterator[MavlinkEngine]:
    engine = MavlinkEngine(1, server.addresses[0], ORIGIN, LIMITS, ALL)
    wait_for("it can fly", engine.can_fly)
    yield engine
    engine.close()


def test_it_flies_hovers_and_lands(engine: MavlinkEngine) -> None:
    engine.set_goal(20.0, -10.0, 4)
    assert engine.is_flying()
    wait_for("it has arrived", lambda: not engine.is_flying())
    assert engine.get_location().distance_m(Location(20.0, -10.0, 4.0)) < 1.5
    engine.set_goal(0.0, 0.0, 0)
    wait_for("it has landed", lambda: engine.status().on_ground is True)
    wait_for("the flight is over", lambda: not engine.is_flying())
    assert engine.get_location().distance_m(Location(0.0, 0.0, 0.0)) < 1.5


def test_a_step_back_ends_in_hovering_even_at_a_place_on_the_ground(engine: MavlinkEngine) -> None:
    engine.step_back_to(10.0, 0.0, 0)
    wait_for("it has arrived", lambda: not engine.is_flying())
    assert engine.get_location().height == pytest.approx(LIMITS.layer_height_m(1), abs=1.5)
    engine.set_goal(10.0, 0.0, 15)
    wait_for("it is higher", lambda: not engine.is_flying())
    engine.step_back_to(0.0, 0.0, 2)
    wait_for("it is back", lambda: not engine.is_flying())
    assert engine.get_location().height == pytest.approx(15.0, abs=1.5)


def test_the_last_flight_lands_at_home_within_the_time_that_is_reckoned(
    engine: MavlinkEngine,
) -> None:
    home = engine.home()
    assert home is not None
    assert engine.on_ground(home)
    engine.step_back_to(30.0, 0.0, 0)
    wait_for("it hovers", lambda: not engine.is_flying())
    assert not engine.on_ground(home)
    reckoned_s, begun_s = engine.seconds_between(engine.get_location(), home), time.monotonic()
    engine.land_at(home.latitude, home.longitude, 0.0)
    wait_for("it has landed", lambda: engine.on_ground(home))
    assert time.monotonic() - begun_s < reckoned_s
    assert engine.get_location().distance_m(home) < 1.5
    assert (engine.least_percent, LIMITS.min_battery_percent) == (30.0, 30.0)


def test_a_step_back_to_where_it_hovers_moves_nothing(
    engine: MavlinkEngine, server: VehicleServer
) -> None:
    engine.step_back_to(20.0, 0.0, 0.0)
    wait_for("it hovers", lambda: not engine.is_flying())
    goal = engine.status().goal
    body = server.vehicles[0].body
    body.speed_m_s = 0.0  # the wind lifts it, and it does not come back at once
    body.place = body.place._replace(height=body.place.height + 0.6)
    wait_for("it reports that", lambda: engine.get_location().height > goal.height + 0.5)
    engine.step_back_to(20.0, 0.0, 0.0)
    assert not engine.is_flying() or engine.status().goal == goal
    wait_for("the engine has taken it", lambda: not engine.is_flying())
    assert engine.status().goal == goal


def test_a_goal_outside_the_limits_is_refused_at_once(engine: MavlinkEngine) -> None:
    with pytest.raises(GoalRefused, match="--max-distance"):
        engine.set_goal(600.0, 0.0, 5)
    assert not engine.is_flying()


def test_a_vehicle_that_falls_silent_is_noticed(
    engine: MavlinkEngine, server: VehicleServer
) -> None:
    server.vehicles[0].faults.silent = True
    wait_for("it cannot fly", lambda: not engine.can_fly())
    with pytest.raises(LocationUnknown, match="no "):
        engine.get_location()
    with pytest.raises(GoalRefused, match="the drone cannot fly: no "):
        engine.set_goal(1.0, 1.0, 5)
    server.vehicles[0].faults.silent = False
    wait_for("it can fly again", engine.can_fly)


def test_without_a_vehicle_it_starts_says_why_it_cannot_fly_and_ends() -> None:
    threads = set(threading.enumerate())
    address = f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    engine = MavlinkEngine(1, address, ORIGIN, LIMITS, ALL)
    assert engine.why_not_fly().startswith("no heartbeat")
    with pytest.raises(LocationUnknown, match="no heartbeat"):
        engine.get_location()
    engine.close()
    assert set(threading.enumerate()) <= threads


def test_a_tcp_line_that_breaks_is_opened_again(caplog: pytest.LogCaptureFixture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
        engine = MavlinkEngine(1, address, ORIGIN, LIMITS, ALL)
        first, _ = listener.accept()
        first.close()
        listener.settimeout(PATIENCE_S)
        second, _ = listener.accept()
        second.close()
        engine.close()
    assert "broke" in caplog.text


def test_only_the_first_peer_on_a_udp_port_is_listened_to_until_it_falls_silent() -> None:
    line = UdpLine("127.0.0.1", 0, listens=True)
    port = line.port
    peers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    heard = []
    for number, sender in enumerate((peers[0], peers[1], peers[0])):
        sender.sendto(bytes((number,)), ("127.0.0.1", port))
        heard.append(line.receive(PATIENCE_S))
    line.forget_peer()
    peers[1].sendto(b"3", ("127.0.0.1", port))
    heard.append(line.receive(PATIENCE_S))
    assert heard == [b"\x00", b"", b"\x02", b"3"]
    for peer in (*peers, line):
        peer.close()
