"""The drones of emulated nodes get no more permissions than real ones."""

from __future__ import annotations

import time

import pytest

from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.raspberry.emulated_air import EmulatedAir
from drone_mesh.raspberry.emulated_fleet import EmulatedFleet
from drone_mesh.raspberry.options import parse_gateway

pytestmark = pytest.mark.slow  # the vehicles live in real time

WAIT_S = 30.0


def why_not_fly(line: str) -> str:
    """What the drone of node 1 says, as soon as its autopilot was heard."""
    options = parse_gateway(line.split(), {})
    air = EmulatedAir(RadioSettings(), 2)
    fleet = EmulatedFleet(options.fleet, options.flight, air)
    try:
        engine = fleet.engine(1)
        end_s = time.monotonic() + WAIT_S
        while "no " in engine.why_not_fly() or "not reported" in engine.why_not_fly():
            assert time.monotonic() < end_s, engine.why_not_fly()
            time.sleep(0.02)
        reason = engine.why_not_fly()
        engine.close()
        return reason
    finally:
        fleet.close()
        air.close()


def test_without_permissions_a_simulated_drone_waits_for_its_pilot() -> None:
    reason = why_not_fly("--emulated 2 --drones mavlink")
    assert reason == "in LOITER: the pilot has to choose GUIDED, or --may-change-mode"


def test_with_every_permission_it_may_fly() -> None:
    everything = "--may-change-mode --may-arm --may-take-off"
    assert why_not_fly(f"--emulated 2 --drones mavlink {everything}") == ""
