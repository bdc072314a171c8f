"""What only a real autopilot has: failures in flight. Prints the rows of the table in flying.md.

After each no order and no repair flies the copter, until the reason has gone and, where the
autopilot or the pilot has chosen a mode, until the pilot gives it back.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Mapping

import pytest
from copter_fleet import Fleet
from copter_rig import CopterRig
from hill import SLOPE_M, Hill

from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

pytestmark = pytest.mark.timeout(1800)  # flights last

WATCH_S = 12.0  # of the wall, five times as many of the copter
SPEEDUP = 5.0
NODE = 1
PACE = float(os.environ.get("AUTOPILOT_PACE", "1"))
STALLED = "the drone has not moved for 20 s"


@dataclass(frozen=True)
class Failure:
    """How it comes about, and what the flight does then."""

    what: str
    happens: Mapping[str, float]  # simulator's parameters, as they are called since ArduPilot 4.7
    mode: str  # that the copter chooses; empty: it stays in GUIDED
    ends: bool = True  # the flight
    gone: Mapping[str, float] = field(default_factory=dict)  # ends it again
    hill: bool = False  # 30 m high, in its way
    order: str = "given up"  # its state, as the gateway says it; empty: the node is out of reach


FAILURES = (
    Failure("GPS lost", {"SIM_GPS1_ENABLE": 0}, "LAND", gone={"SIM_GPS1_ENABLE": 1}),
    Failure(
        "GPS glitch of 1.1 km",
        {"SIM_GPS1_GLTCH_X": 0.01},
        "LAND",
        gone={"SIM_GPS1_GLTCH_X": 0},
        order="",  # the emulated antenna is where the GPS says
    ),
    Failure(
        "all compasses fail",
        {"SIM_MAG1_FAIL": 1, "SIM_MAG2_FAIL": 1, "SIM_MAG3_FAIL": 1},
        "",
        ends=False,
        order="arrived",
    ),
    Failure("battery at failsafe voltage", {"SIM_BATT_VOLTAGE": 10.0}, "RTL"),
    Failure("the pilot's radio lost", {"SIM_RC_FAIL": 1}, "RTL", gone={"SIM_RC_FAIL": 0}),
    Failure(
        "wind of 10 m/s with gusts",
        {"SIM_WIND_SPD": 10, "SIM_WIND_TURB": 5},
        "",
        ends=False,
        order="arrived",
    ),
    Failure("fence breached", {"FENCE_RADIUS": 12}, "RTL"),
    Failure("one of four motors stops", {"SIM_ENGINE_MUL": 0, "SIM_ENGINE_FAIL": 1}, ""),
    Failure("a hill in its way", {}, "", hill=True),
)


def refusal(ask: Callable[[float, float, float], None]) -> str:
    """Why the engine does not fly there now; empty: it would have flown."""
    try:
        ask(30.0, 10.0, 7.0)
    except GoalRefused as error:
        return str(error).replace("the drone cannot fly: ", "")
    return ""


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: failure.what)
def test_a_failure_in_flight_ends_it_and_nobody_takes_the_copter(
    program: tuple[Path, Path], tmp_path: Path, failure: Failure
) -> None:
    with CopterRig(program, tmp_path, speedup=SPEEDUP) as rig:
        if failure.hill:
            Hill(rig.pilot, rig.copter.system_id)
        rig.set_out(150.0, 0.0, 7.0)
        for name, value in failure.happens.items():
            rig.pilot.set(name, value)
        if not failure.ends:
            rig.pilot.until("at the goal", lambda: not rig.engine.is_flying(), 150.0)
            row(failure, rig, "flew on", "", "")
            assert rig.engine.why_ended() == ""
            assert rig.pilot.mode == "GUIDED"
            return
        rig.pilot.until("ended", lambda: not rig.engine.is_flying(), 60.0)
        mode = failure.mode or "GUIDED"
        rig.pilot.until(f"in {mode}", lambda: rig.pilot.mode == mode, 60.0)
        words = rig.engine.why_ended()
        assert words
        if failure.hill:
            assert SLOPE_M[0] < rig.engine.get_location().latitude < SLOPE_M[1]
        asked = nobody_flies_it(rig)
        assert rig.pilot.mode == mode
        did = "disarmed" if not rig.pilot.armed else f"in {rig.pilot.mode}"
        for name, value in failure.gone.items():
            rig.pilot.set(name, value)
        if failure.gone:  # the reason has gone; the autopilot's mode stays the pilot's
            asked = nobody_flies_it(rig)
        row(failure, rig, did, words, asked)


def nobody_flies_it(rig: CopterRig) -> str:
    """Orders and repairs are refused all the time; returns the last reason."""
    asked, end_s = "", time.monotonic() + WATCH_S
    while time.monotonic() < end_s:
        rig.pilot.read()
        # Where the flight only stalled, an order may try elsewhere; a repair never does.
        asks = [rig.engine.step_back_to]
        if rig.engine.why_ended() != STALLED:
            asks.append(rig.engine.set_goal)
        for ask in asks:
            asked = refusal(ask)
            assert asked
    return asked


def test_when_the_node_is_killed_the_copter_goes_home_and_the_next_node_leaves_it_alone(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    with CopterRig(program, tmp_path, speedup=SPEEDUP) as rig:
        rig.set_out(150.0, 0.0, 7.0)
        rig.engine.close()
        rig.pilot.until("in RTL", lambda: rig.pilot.mode == "RTL", 60.0)
        rig.start_engine()
        rig.pilot.until("heard", lambda: bool(rig.engine.status().mode), 30.0)
        rig.pilot.until("known", lambda: "RTL" in rig.engine.why_not_fly(), 30.0)
        asked = rig.engine.why_not_fly()
        nobody_flies_it(rig)
        assert rig.pilot.mode == "RTL"
        row(Failure("the node is killed", {}, "RTL"), rig, "RTL", "", asked)


@pytest.mark.parametrize(("options", "mode"), [(16.0, "RTL"), (24.0, "LAND")])
def test_a_low_battery_makes_a_return_of_a_landing_unless_it_is_told_to_land_on(
    program: tuple[Path, Path], tmp_path: Path, options: float, mode: str
) -> None:
    own = {"FS_OPTIONS": options, "BATT_LOW_TIMER": 2.0}  # seconds
    with CopterRig(program, tmp_path, speedup=1.0, parameters=own) as rig:
        rig.set_out(40.0, 0.0, 7.0)
        rig.engine.land_at(0.0, 0.0, 0.0)  # as for a lost mesh
        rig.pilot.until("landing", lambda: rig.pilot.mode == "LAND", 150.0)
        rig.pilot.set("SIM_BATT_VOLTAGE", 10.0)
        rig.pilot.until("ended", lambda: not rig.engine.is_flying(), 60.0)
        print(f"FS_OPTIONS {options:g}: {rig.pilot.mode} at {rig.pilot.height_m:.1f} m")
        assert rig.pilot.mode == mode
        assert rig.engine.why_ended() == "the autopilot reports a failsafe"
        rig.pilot.until("down", lambda: not rig.pilot.armed, 150.0)
        rig.pilot.choose("GUIDED")
        assert nobody_flies_it(rig) == "the autopilot reports a failsafe"


@pytest.mark.parametrize("failure", [f for f in FAILURES if f.order], ids=lambda f: f.what)
def test_gateway_and_page_say_why_a_flight_ended(
    program: tuple[Path, Path], tmp_path: Path, failure: Failure
) -> None:
    home, goal = Location(0.0, 0.0, 0.0), Location(50.0, 0.0, 18.0)
    elsewhere = Location(40.0, 20.0, 18.0)
    with Fleet(program, tmp_path, {NODE: home}, PACE, speed_m_s=1.5) as fleet:
        pilot = fleet.pilots[NODE]
        if failure.hill:
            Hill(pilot, fleet.copters[NODE].system_id)
        fleet.until("connected", lambda: fleet.reachable() == {NODE})
        with fleet.page() as page:
            fleet.order(NODE, goal)
            fleet.until("on its way", lambda: fleet.places[NODE].latitude > 15.0)
            for name, value in failure.happens.items():
                pilot.set(name, value)
            words = [fleet.outcome(NODE)]
            assert words[0].partition(":")[0] == failure.order
            if failure.ends:
                fleet.order(NODE, elsewhere)
                words.append(fleet.outcome(NODE))

            def is_shown() -> bool:  # word by word
                said = page.locator("#events li", has_text="order").all_inner_texts()
                reasons = [text.partition(": ")[2] for text in words]
                return all(any(reason in text for text in said) for reason in reasons)

            fleet.until("the page says so too", is_shown)
            print(f"| {failure.what} | {' | '.join(f'`{text}`' for text in words)} |", flush=True)


def row(failure: Failure, rig: CopterRig, did: str, words: str, asked: str) -> None:
    """A row of the table in docs/flying.md."""
    said = [
        t
        for t in rig.pilot.texts
        if any(k in t for k in ("ailsafe", "Crash", "EKF", "each", "Hit"))
    ]
    print(f"| {failure.what} | {did} | `{words}` | `{asked}` |   <!-- {said[-2:]} -->")
