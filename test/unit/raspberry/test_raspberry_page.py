"""docs/raspberry-pi.md: the systemd units, and the messages that it explains."""

from __future__ import annotations

import re
from configparser import RawConfigParser
from pathlib import Path

import pytest

from drone_mesh.raspberry.node import ALIVE_WITHIN_S
from drone_mesh.raspberry.program import ALIVE_PERIOD_S
from drone_mesh.users.local_client import SYSTEM_FOLDER

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "raspberry-pi.md").read_text(encoding="utf-8")
UNITS = ROOT / "src" / "drone_mesh" / "raspberry"


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


def test_each_message_that_the_page_explains_is_one_of_the_driver_or_of_the_programs() -> None:
    sources = [*UNITS.glob("*.py"), *(UNITS.parent / "nrf24").glob("*.py")]
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    text = re.sub(r'"\s+f?"', "", text)  # the parts of a long one
    table = PAGE.partition("| message | remedy |\n|---|---|\n")[2]
    messages = re.findall(r"`([^`]+)`", "".join(re.findall(r"^\| ([^|]+)", table, re.MULTILINE)))
    assert len(messages) >= 12
    for message in messages:
        for part in re.split(r"\.\.\.|: |/dev/spidev0\.0|25", message):
            assert part.strip() in text, message
