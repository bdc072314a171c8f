"""Foreign MAVLink software: MAVSDK and MAVProxy fly our vehicle; our engine reads MAVSDK's."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Callable, Iterator

import pytest
from mavlink_vehicle.modes import Mode
from mavlink_vehicle.server import VehicleServer
from mavlink_vehicle.vehicle import MavlinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, PX4, Autopilot
from drone_mesh.drone.mavlink.engine import MavlinkEngine
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions

mavsdk = pytest.importorskip("mavsdk", reason="the binary in MAVSDK's wheel does not load here")
pytest.importorskip("MAVProxy")

pytestmark = pytest.mark.slow  # autopilots and links live in real time

ORIGIN = Origin(52.0907, 5.1214, 3.0)
PATIENCE_S = 40.0


def wait_for(what: str, holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < deadline, f"not within {PATIENCE_S:g} s: {what}"
        time.sleep(0.05)


def serve(autopilot: Autopilot) -> tuple[VehicleServer, MavlinkVehicle, int]:
    server = VehicleServer(autopilot, [ORIGIN])
    vehicle = server.vehicles[0]
    vehicle.body.speed_m_s = 10.0
    server.start()
    return server, vehicle, int(server.addresses[0].rpartition(":")[2])


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


# MAVSDK, the ground station ------------------------------------------------------------------


@pytest.fixture
def mavsdk_ground_station() -> Iterator[mavsdk.Mavsdk]:
    kind = mavsdk.ComponentType.GROUND_STATION
    station = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    yield station
    station.destroy()


def test_mavsdk_arms_takes_off_goes_somewhere_and_lands(mavsdk_ground_station) -> None:
    from mavsdk.plugins.action.action import Action
    from mavsdk.plugins.telemetry.telemetry import FlightMode, LandedState, Telemetry

    server, vehicle, port = serve(PX4)
    try:
        mavsdk_ground_station.add_any_connection(f"udpout://127.0.0.1:{port}")
        system = mavsdk_ground_station.first_autopilot(PATIENCE_S)
        assert system is not None
        action, telemetry = Action(system), Telemetry(system)
        wait_for("all is healthy", telemetry.health_all_ok)
        assert telemetry.flight_mode() == FlightMode.HOLD
        action.arm()
        wait_for("armed", telemetry.armed)
        action.takeoff()
        wait_for("it hovers", lambda: telemetry.position().relative_altitude_m > 2.4)
        wait_for("it reports that", lambda: telemetry.landed_state() == LandedState.IN_AIR)
        goal = ORIGIN.to_earth(Location(20.0, -15.0, 12.0))
        action.goto_location(*goal, 0.0)
        wait_for("it is there", lambda: telemetry.position().absolute_altitude_m > 14.9)
        there = telemetry.position()
        assert there.latitude_deg == pytest.approx(goal.latitude_deg, abs=1e-6)
        assert there.longitude_deg == pytest.approx(goal.longitude_deg, abs=1e-6)
        assert vehicle.body.place.distance_m(Location(20.0, -15.0, 12.0)) < 0.2
        action.land()
        wait_for("it lands", lambda: telemetry.flight_mode() == FlightMode.LAND)
    finally:
        server.close()


# MAVProxy, the ground station ----------------------------------------------------------------


class MavProxy:
    """MAVProxy in a process of its own, with these modules."""

    def __init__(self, port: int, modules: str, folder: Path) -> None:
        program = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent))
        assert program is not None
        self._process = subprocess.Popen(
            [
                sys.executable,
                program,
                f"--master=udpout:127.0.0.1:{port}",
                f"--default-modules={modules}",
                f"--state-basedir={folder}",
            ],
            env={**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
        )
        self._said: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        self._said.extend(iter(lambda: self._process.stdout.read(1), ""))

    @property
    def said(self) -> str:
        return "".join(self._said)

    def command(self, line: str, effect: Callable[[], bool]) -> None:
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        wait_for(f"{line}; {self.said}", effect)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        self._process.stdin.close()
        self._process.stdout.close()


def test_mavproxy_guides_arms_takes_off_and_reads_the_parameters(tmp_path: Path) -> None:
    server, vehicle, port = serve(ARDUPILOT)
    proxy = MavProxy(port, "mode,arm,cmdlong,param", tmp_path)
    try:
        wait_for("it read the mode", lambda: "Mode LOITER" in proxy.said)
        wait_for("it read the parameters", lambda: "Received 7 parameters" in proxy.said)
        proxy.command("mode GUIDED", lambda: vehicle.mode is Mode.FOLLOW)
        proxy.command("arm throttle", lambda: vehicle.body.armed)
        proxy.command("takeoff 5", lambda: vehicle.body.place.height > 4.9)
        wait_for("it read the new mode", lambda: "Mode GUIDED" in proxy.said)
        assert "ARMED" in proxy.said
    finally:
        proxy.close()
        server.close()


# MAVSDK, the vehicle -------------------------------------------------------------------------


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

    engine_port = free_port()
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
