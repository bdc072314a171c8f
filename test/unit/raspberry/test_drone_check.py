"""raspberry_router ... check-drone prints every parameter, and its exit status is the verdict."""

from __future__ import annotations

import sys
from typing import Any, Iterator

import pytest
from mavlink_vehicle.server import VehicleServer
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT
from drone_mesh.raspberry.program import router

HOME = mavlink.MAVLINK_MSG_ID_HOME_POSITION

pytestmark = pytest.mark.slow  # the vehicle lives in real time


@pytest.fixture
def server() -> Iterator[VehicleServer]:
    server = VehicleServer(ARDUPILOT, [Origin(52.0907, 5.1214, 3.0)])
    server.start()
    yield server
    server.close()


def check(
    server: VehicleServer, monkeypatch: pytest.MonkeyPatch, origin: str = "52.0907,5.1214,3"
) -> int:
    drone = f"--drone mavlink:{server.addresses[0]} --origin={origin}"
    line = f"raspberry_router --id 3 {drone} check-drone"
    monkeypatch.setattr(sys, "argv", line.split())
    return router()


def test_a_safe_drone_passes_and_every_parameter_is_printed(
    server: VehicleServer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check(server, monkeypatch) == 0
    printed = capsys.readouterr().out
    assert "UNSAFE" not in printed
    for requirement in ARDUPILOT.requirements:
        assert any(name in printed for name in requirement.names)


def test_an_unsafe_one_fails_and_the_page_says_how_to_set_it(
    server: VehicleServer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    server.vehicles[0].parameters["FENCE_ENABLE"] = 0.0
    assert check(server, monkeypatch) == 1
    (row,) = [r for r in capsys.readouterr().out.splitlines() if "UNSAFE" in r]
    assert row.split()[:3] == ["FENCE_ENABLE", "0", "UNSAFE"]
    assert row.endswith("param set FENCE_ENABLE 1")


def test_an_origin_far_below_the_home_is_doubted_also_when_the_home_comes_late(
    server: VehicleServer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reports = server.vehicles[0]._reports
    set_interval = reports.set_interval

    def from_then_on(command: Any) -> Any:
        answer = set_interval(command)
        reports._due_s[HOME] = reports._vehicle.now_s + reports._interval_s[HOME]
        return answer

    monkeypatch.setattr(reports, "set_interval", from_then_on)
    reports._interval_s[HOME] = 0.0  # not sent until it is asked for
    assert check(server, monkeypatch, "52.0907,5.1214,-297") == 0
    assert "its home is 300 m above --origin" in capsys.readouterr().out


def test_without_an_autopilot_it_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["raspberry_router", "--id", "3", "check-drone"])
    assert router() == 1
    assert "check-drone needs --drone mavlink:ADDRESS" in capsys.readouterr().err
