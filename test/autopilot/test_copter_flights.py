"""Flights of ArduPilot's own software: up, across and down, and the pilot's part in them."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from typing import Callable

import pytest
from copter_rig import FLIGHT_S, FLOWN, CopterRig

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.errors import GoalRefused

pytestmark = pytest.mark.timeout(1800)  # flights last

FLIGHTS = int(os.environ.get("AUTOPILOT_FLIGHTS", "2"))  # of each kind
FLIGHTS_OF_ONE_COPTER = 5
FIRST_FLIGHTS = range(0, FLIGHTS, FLIGHTS_OF_ONE_COPTER)


@pytest.mark.parametrize("losing", [0.0, 0.05], ids=["whole line", "5 % lost"])
@pytest.mark.parametrize("speedup", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("first", FIRST_FLIGHTS)
def test_it_flies_up_across_and_down_again_and_again(
    program: tuple[Path, Path],
    tmp_path: Path,
    record_property: Callable[[str, object], None],
    speedup: float,
    losing: float,
    first: int,
) -> None:
    ended, flown = [], 0
    with CopterRig(program, tmp_path, speedup=speedup, losing=losing) as rig:
        try:
            for flight in range(first, min(FLIGHTS, first + FLIGHTS_OF_ONE_COPTER)):
                side = 12.0 if flight % 2 else -12.0
                flown += 1
                for goal in (Location(side, 10.0, 4.0), Location(0.0, 0.0, 0.0)):
                    words = rig.try_to_fly(goal)
                    if words:
                        said = rig.pilot.texts[-4:]
                        ended.append(f"flight {flight + 1} to {goal.in_words()}: {words}; {said}")
                        rig.bring_down()
                        break
                rig.pilot.until("ready again", rig.engine.can_fly)
        finally:
            record_property(FLOWN, (f"{speedup:g}x, {losing:.0%} lost", flown, flown - len(ended)))
    assert ended == []


def test_a_flight_goes_on_after_the_node_was_given_no_time(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    with CopterRig(program, tmp_path, speedup=1.0) as rig:
        rig.set_out(80.0, 0.0, 7.0)
        own = os.getpid()
        stopped = f"kill -STOP {own}; sleep 4; kill -CONT {own}"
        subprocess.run(["sh", "-c", stopped], check=True)
        rig.pilot.until("at its goal", lambda: not rig.engine.is_flying(), FLIGHT_S)
        assert rig.engine.why_ended() == ""
        assert rig.engine.get_location().distance_m(Location(80.0, 0.0, 7.0)) < 1.6


def test_the_speed_of_the_engine_is_kept(program: tuple[Path, Path], tmp_path: Path) -> None:
    limits = FlightLimits(speed_m_s=4.0, cruise_height_m=6.0, layer_m=1.0)
    with CopterRig(program, tmp_path, speedup=1.0, limits=limits) as rig:
        rig.fly(0.0, 0.0, 7.0)
        rig.engine.set_goal(100.0, 0.0, 7.0)
        where = rig.engine.get_location
        rig.pilot.until("on its way", lambda: where().latitude > 20.0, FLIGHT_S)
        start_m, start_s = where().latitude, rig.pilot.uptime_s
        wall_s = time.monotonic()
        rig.pilot.until("further", lambda: where().latitude > 80.0, FLIGHT_S)
        passed_s = rig.pilot.uptime_s - start_s  # of the copter's clock: the machine may be busy
        speed_m_s = (where().latitude - start_m) / passed_s
        pace = passed_s / (time.monotonic() - wall_s)
        print(f"--speed 4: {speed_m_s:.2f} m/s over 60 m; the simulator ran at {pace:.2f}x")
        assert speed_m_s == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("behaviour", "turns"), [(0.0, False), (2.0, True)])
def test_the_autopilot_decides_where_the_nose_points(
    program: tuple[Path, Path], tmp_path: Path, behaviour: float, turns: bool
) -> None:
    with CopterRig(program, tmp_path, parameters={"WP_YAW_BEHAVIOR": behaviour}) as rig:
        rig.fly(0.0, 0.0, 7.0)
        before = rig.pilot.heading_deg
        rig.engine.set_goal(0.0, 100.0, 7.0)  # east, 90 degrees
        where = rig.engine.get_location
        rig.pilot.until("on its way", lambda: where().longitude > 70.0, FLIGHT_S)
        print(
            f"WP_YAW_BEHAVIOR {behaviour:g}: from {before:.0f} to {rig.pilot.heading_deg:.0f} deg"
        )
        wanted = 90.0 if turns else before
        assert abs((rig.pilot.heading_deg - wanted + 180.0) % 360.0 - 180.0) < 15.0


@pytest.mark.parametrize("mode", ["LOITER", "RTL", "STABILIZE", "LAND", "BRAKE", "POSHOLD"])
def test_the_pilot_ends_a_flight_and_keeps_the_drone(
    program: tuple[Path, Path], tmp_path: Path, mode: str
) -> None:
    with CopterRig(program, tmp_path, speedup=3.0) as rig:
        rig.set_out(120.0, 0.0, 7.0)
        rig.pilot.choose(mode)
        rig.pilot.until("ended", lambda: not rig.engine.is_flying(), 5.0)
        assert rig.engine.why_ended() == f"{mode} was chosen: the pilot flies"
        end_s = time.monotonic() + 10.0
        while time.monotonic() < end_s:
            rig.pilot.read()
            assert rig.pilot.mode == mode
            for ask in (rig.engine.set_goal, rig.engine.step_back_to):
                with pytest.raises(GoalRefused, match=f"in {mode}, flown by its pilot"):
                    ask(50.0, 20.0, 7.0)


def test_only_the_pilot_or_an_order_with_permission_takes_it_back_from_loiter(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    take_back = Permissions(True, True, True, orders_may_take_back_s=5.0)
    with CopterRig(program, tmp_path, speedup=3.0, permissions=take_back) as rig:
        rig.set_out(120.0, 0.0, 7.0)
        rig.pilot.choose("LOITER")
        rig.pilot.until("the pilot's", lambda: not rig.engine.can_fly(), 5.0)
        rig.pilot.until("to be taken back", rig.engine.can_fly, 20.0)
        assert "flown by its pilot" in rig.engine.why_not_repair()
        rig.fly(20.0, 0.0, 7.0)
        assert rig.pilot.mode == "GUIDED"
        assert rig.engine.why_not_repair() == ""
        rig.pilot.choose("LOITER")
        rig.pilot.until("the pilot's", lambda: rig.engine.why_not_repair() != "", 5.0)
        rig.pilot.choose("GUIDED")
        rig.pilot.until("given back", lambda: rig.engine.why_not_repair() == "", 5.0)


def test_a_copter_that_does_not_arm_is_given_up_in_its_own_words(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    with CopterRig(program, tmp_path) as rig:
        rig.pilot.set("ARMING_MIS_ITEMS", 1.0)  # it wants a landing in its mission, which is empty
        rig.engine.set_goal(10.0, 0.0, 5.0)
        rig.pilot.until("given up", lambda: not rig.engine.is_flying(), 30.0)
        print(rig.engine.why_ended())
        assert rig.engine.why_ended().startswith("arming: ")
        assert "rm: " in rig.engine.why_ended()  # PreArm: or Arm:
        assert not rig.pilot.armed


@pytest.mark.parametrize("missing", ["may_arm", "may_take_off"])
def test_without_a_permission_it_neither_arms_nor_takes_off(
    program: tuple[Path, Path], tmp_path: Path, missing: str
) -> None:
    granted = {"may_arm": True, "may_take_off": True, "may_change_mode": True, missing: False}
    with CopterRig(program, tmp_path, permissions=Permissions(**granted), ready=False) as rig:
        rig.pilot.make_ready()
        rig.pilot.until("everything reported", lambda: "the pilot" in rig.engine.why_not_fly())
        for ask in (rig.engine.set_goal, rig.engine.step_back_to):
            with pytest.raises(GoalRefused):
                ask(10.0, 0.0, 5.0)
        for _ in range(100):
            rig.pilot.read()
        assert not rig.pilot.armed
        assert rig.pilot.height_m < 1.0
