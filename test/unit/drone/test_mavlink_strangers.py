"""Foreign MAVLink software: our engine reads a vehicle of MAVSDK's."""

from __future__ import annotations

import socket
import threading
from typing import Iterator

import pytest
from patience import free_port, wait_for
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.engine import MavlinkEngine
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions

mavsdk = pytest.importorskip("mavsdk", reason="the binary in MAVSDK's wheel does not load here")

pytestmark = pytest.mark.slow  # autopilots and links live in real time

ORIGIN = Origin(52.0907, 5.1214, 3.0)


class Relay(threading.Thread):
    """Between MAVSDK's vehicle and the engine; names the autopilot and the type in heartbeats.

    MAVSDK's Python configuration can only be a "generic" vehicle.
    """

    def __init__(self, engine_port: int, autopilot: int | None) -> None:
        super().__init__(daemon=True)
        self._autopilot = autopilot
        self._engine = ("127.0.0.1", engine_port)
        self._vehicle: tuple[str, int] | None = None
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.from_engine: list[str] = []

    def run(self) -> None:
        codecs = {True: mavlink.MAVLink(None), False: mavlink.MAVLink(None)}
        while True:
            try:
                data, sender = self.socket.recvfrom(4096)
            except OSError:
                return
            up = sender != self._engine
            if up:
                self._vehicle = sender
            for message in codecs[up].parse_buffer(data) or ():
                try:
                    self._pass(message, up)
                except OSError:  # closed meanwhile
                    return

    def _pass(self, message, up: bool) -> None:
        to = self._engine if up else self._vehicle
        data = message.get_msgbuf()
        if up and message.get_type() == "HEARTBEAT" and self._autopilot is not None:
            message.type, message.autopilot = mavlink.MAV_TYPE_QUADROTOR, self._autopilot
            codec = mavlink.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
            data = message.pack(codec)
        elif not up:
            self.from_engine.append(message.get_type())
        if to is not None:
            self.socket.sendto(data, to)


@pytest.fixture
def mavsdk_vehicle() -> Iterator[mavsdk.Mavsdk]:
    configuration = mavsdk.Configuration.create_manual(1, 1, True)
    vehicle = mavsdk.Mavsdk(configuration)
    yield vehicle
    vehicle.destroy()


@pytest.mark.parametrize("named", [None, mavlink.MAV_AUTOPILOT_PX4], ids=["generic", "as PX4"])
def test_mavsdk_as_the_vehicle_is_read_and_not_flown_without_an_estimator(
    mavsdk_vehicle, named: int | None
) -> None:
    from mavsdk.plugins.telemetry_server import telemetry_server as reports

    engine_port = free_port(socket.SOCK_DGRAM)
    relay = Relay(engine_port, named)
    permissions = Permissions(may_arm=True, may_take_off=True, may_change_mode=True)
    engine = MavlinkEngine(1, f"udpin:127.0.0.1:{engine_port}", ORIGIN, FlightLimits(), permissions)
    relay.start()
    mavsdk_vehicle.add_any_connection(f"udpout://127.0.0.1:{relay.port}")
    server = reports.TelemetryServer(mavsdk_vehicle.server_component())
    place = reports.Position(52.0908, 5.1214, 13.0, 10.0)
    home = reports.Position(52.0907, 5.1214, 3.0, 0.0)

    def publish() -> None:
        server.publish_position(place, reports.VelocityNed(0.0, 0.0, 0.0), reports.Heading(0.0))
        server.publish_home(home)
        server.publish_extended_sys_state(reports.VtolState.UNDEFINED, reports.LandedState.IN_AIR)

    def says(reason: str) -> bool:
        publish()
        return reason in engine.why_not_fly()

    try:
        if named is None:
            wait_for("it is refused", lambda: says("not a multirotor with ArduPilot or PX4"))
        else:
            wait_for("only the rest is missing", lambda: says("no report from the GPS"))
            wait_for("its home is known", lambda: says("") and engine.status().home is not None)
            wait_for("it flies", lambda: says("") and engine.status().on_ground is False)
            home_seen = engine.status().home  # MAVSDK sends another altitude than it was given
            assert home_seen[:2] == pytest.approx((0.0, 0.0), abs=0.01)
            assert engine.status().autopilot == "PX4"
    finally:
        engine.close()
        relay.socket.close()
    assert "SET_POSITION_TARGET_GLOBAL_INT" not in relay.from_engine
