"""The systemd units of a Pi fit the programs that they run, and docs/raspberry-pi.md."""

from __future__ import annotations

from configparser import RawConfigParser
from pathlib import Path

import pytest

from drone_mesh.raspberry.node import ALIVE_WITHIN_S
from drone_mesh.raspberry.program import ALIVE_PERIOD_S
from drone_mesh.users.local_client import SYSTEM_FOLDER

UNITS = Path(__file__).resolve().parents[3] / "src" / "drone_mesh" / "raspberry"


@pytest.mark.parametrize("role", ["router", "gateway"])
def test_a_unit_starts_its_program_with_the_options_in_its_file_and_watches_it(role: str) -> None:
    unit = RawConfigParser(delimiters="=")
    unit.read(UNITS / f"raspberry_{role}.service", encoding="utf-8")
    service, options = unit["Service"], f"/etc/drone_mesh/{role}.conf"
    assert service["ExecStart"] == f"/opt/drone_mesh/bin/raspberry_{role} $OPTIONS"
    assert (service["EnvironmentFile"], unit["Unit"]["ConditionPathExists"]) == (options, options)
    assert (service["Type"], service["WatchdogSec"]) == ("notify", "60")
    assert ALIVE_PERIOD_S == 5.0
    assert ALIVE_WITHIN_S + ALIVE_PERIOD_S < 60.0 / 2
    assert (service["Restart"], service["RestartPreventExitStatus"]) == ("on-failure", "2")
    assert service["TimeoutStopSec"] == "5"
    assert service["DynamicUser"] == "yes"
    assert set(service["SupplementaryGroups"].split()) == {"spi", "gpio", "dialout"}
    assert f"/run/{service['RuntimeDirectory']}" == str(SYSTEM_FOLDER)
