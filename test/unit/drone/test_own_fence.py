"""The autopilot's own fence: read over a line that loses and delays, kept, and read again."""

from __future__ import annotations

import contextlib
import random

import pytest
from mavlink_rig import ORIGIN, Rig, in_flight
from mavlink_vehicle.modes import Mode
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, OUR_SYSTEM_ID, PX4
from drone_mesh.drone.mavlink.own_fence import FENCE, LOOK_AGAIN_S
from drone_mesh.errors import GoalRefused

RETURN, CORNER_IN, CORNER_OUT, CIRCLE_IN, CIRCLE_OUT = range(5000, 5005)  # MAV_CMD_NAV_FENCE_...
UNSUPPORTED = mavlink.MAV_MISSION_UNSUPPORTED
QGC = (OUR_SYSTEM_ID, 190)  # its system and component
ITSELF = "the autopilot's fence"


def at(command, size, *places):
    """Items at these places, in metres to the north and to the east."""
    return [(command, size, *ORIGIN.to_earth(Location(*place, 0.0))[:2]) for place in places]


def field(south, north, command=CORNER_IN):
    return at(command, 4, (south, -60), (north, -60), (north, 60), (south, 60))


HERE, THERE = field(-20, 50), field(20, 90)
POND = at(CIRCLE_OUT, 10, (40, 0))
BOWTIE = at(CORNER_IN, 4, (0, 0), (90, 90), (90, 0), (0, 90))
GOAL = (60.0, 0.0, 10.0)


@pytest.mark.parametrize(
    ("autopilot", "parameters", "items", "words"),
    [
        (ARDUPILOT, {}, at(RETURN, 0, (0, 0)) + HERE, f"outside {ITSELF}, area 1"),
        (ARDUPILOT, {}, at(CIRCLE_IN, 70, (0, 0)) + HERE, f"outside {ITSELF}, area 2"),
        (ARDUPILOT, {"FENCE_OPTIONS": 2}, HERE + THERE, ""),  # in any of them
        (ARDUPILOT, {}, field(55, 65, CORNER_OUT), f"inside {ITSELF}, area 1, which"),
        (ARDUPILOT, {}, BOWTIE + HERE, f"outside {ITSELF}, area 2"),  # the first is no area
        (ARDUPILOT, {"FENCE_TYPE": 3, "FENCE_RADIUS": 59}, HERE, f"outside {ITSELF}, around home"),
        (ARDUPILOT, {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 9}, [], f"above {ITSELF}, around home: 10"),
        (ARDUPILOT, {"FENCE_TYPE": 3}, HERE, ""),
        (ARDUPILOT, {"FENCE_ENABLE": 0}, HERE, ""),
        (ARDUPILOT, {"FENCE_ENABLE": 0, "FENCE_AUTOENABLE": 3}, HERE, f"outside {ITSELF}, area 1"),
        (PX4, {}, HERE + THERE, f"outside {ITSELF}, area 1"),
        (PX4, {"GF_MAX_HOR_DIST": 59}, [], f"outside {ITSELF}, around home"),
        (PX4, {"GF_MAX_HOR_DIST": 0, "GF_MAX_VER_DIST": 9}, [], f"above {ITSELF}, around home"),
        (PX4, {"GF_ACTION": 0}, HERE, ""),
    ],
)
def test_a_goal_beyond_it_is_refused_by_name(autopilot, parameters, items, words):
    rig = Rig(autopilot)
    rig.vehicle.parameters.update(parameters)
    rig.vehicle.fence.items = items
    rig.ready()
    with pytest.raises(GoalRefused, match=words) if words else contextlib.nullcontext():
        rig.goal(*GOAL)
    assert not rig.vehicle.fence.is_busy


@pytest.mark.parametrize("seed", range(4))
def test_it_is_read_over_a_line_that_loses_and_delays(seed):
    rig, good, rng = Rig(), Rig(), random.Random(seed)
    zigzag = [(2 * n - 20, 4 * (n % 2) - 60) for n in range(29)]
    for one in (rig, good):
        one.vehicle.fence.items = at(CORNER_IN, 30, *zigzag, (0, 90)) + POND
    for wire in (rig.up, rig.down):
        wire.loses = lambda: rng.random() < 0.2
        wire.delays = lambda: rng.randrange(12)  # 0.6 s: they overtake each other
    rig.run_until("it is read", lambda: len(rig.pilot.fences().rules) == 2)
    assert rig.pilot.fences() == good.ready().pilot.fences()


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_one_that_changes_while_it_is_read_is_never_a_mixture(autopilot):
    def names(items):
        other = Rig(autopilot)
        other.vehicle.fence.items = items
        return other.ready().pilot.fences()

    new = at(CORNER_IN, 5, (-20, -60), (90, -60), (99, 0), (90, 60), (-20, 60)) + POND
    rig = Rig(autopilot)
    store = rig.vehicle.fence
    store.items = HERE + POND
    rig.run_until("two items are told", lambda: store.next == 2)
    store.items = new
    seen = [rig.pilot.fences()]

    def is_new():
        seen.append(rig.pilot.fences())
        return seen[-1] == names(new)

    rig.run_until("the new one", is_new, within_s=LOOK_AGAIN_S + 2.0)
    assert all(fence in (seen[0], names(HERE + POND), names(new)) for fence in seen)


def test_one_whose_reading_was_interrupted_by_a_restart_of_the_autopilot_is_read():
    rig = Rig(PX4)
    store = rig.vehicle.fence
    store.items = HERE
    rig.run_until("two items are told", lambda: store.next == 2)
    store.result = None
    rig.run(3.0)
    store.result, store.is_busy = mavlink.MAV_MISSION_ACCEPTED, False
    rig.run_until("it is read", lambda: "area 1" in rig.pilot.fences().names, within_s=4.0)


PX4_OF_2023 = (  # a count with an opaque id behind its type, and an item without its type
    "fd0900000001012c00000100ffbf01dec0175a9b0b",
    "fd25000000010149000000004842000000000000000000000000f8680c1fb0760d030000000000008b13ffbf000001"
    "58f7",
)


def test_the_bytes_of_a_px4_before_1_14_1_are_understood_and_those_for_others_ignored():
    rig, codec = Rig(PX4), mavlink.MAVLink(None)
    rig.vehicle.fence.result = None
    rig.vehicle.parameters.update(GF_MAX_HOR_DIST=0.0, GF_MAX_VER_DIST=0.0)
    rig.run(0.3)
    for text in PX4_OF_2023:
        head = (*QGC, 0, mavlink.MAV_FRAME_GLOBAL, CIRCLE_OUT, 0, 1, 9.0, 0.0, 0.0, 0.0)
        rig.up.send(mavlink.MAVLink_mission_count_message(*QGC, 0, FENCE))
        rig.up.send(mavlink.MAVLink_mission_item_int_message(*head, 0, 0, 0.0, FENCE))
        rig.step()
        rig.pilot.on_message(*codec.parse_buffer(bytes.fromhex(text)), rig.now_s)
    assert rig.pilot.fences().why_not((49.9, 0.0, 9.0)) == ""
    assert rig.pilot.fences().why_not((50.1, 0.0, 9.0)) == f"outside {ITSELF}, area 1"


def test_a_change_in_flight_leads_it_round_or_ends_the_flight():
    rig = in_flight(ARDUPILOT)  # to 100 m north
    rig.vehicle.body.speed_m_s = 1.0
    rig.vehicle.fence.items = POND
    rig.run_until("it is read", lambda: bool(rig.pilot.fences()), within_s=LOOK_AGAIN_S + 1.0)
    pond = rig.pilot.fences()
    while rig.place.latitude < 60.0:
        rig.step()
        assert not pond.why_not(rig.place.to_vector())
    rig.vehicle.fence.items = field(-20, 90)
    rig.run_until("it ended", lambda: not rig.status().is_flying, within_s=LOOK_AGAIN_S + 1.0)
    assert rig.status().ended == f"outside {ITSELF}, area 1"
    assert rig.vehicle.mode is Mode.FOLLOW


@pytest.mark.parametrize("result", [None, mavlink.MAV_MISSION_DENIED, UNSUPPORTED])
def test_one_that_is_not_told_is_waited_for_and_named_once_and_kept_when_it_comes(result, caplog):
    rig = Rig()
    rig.vehicle.fence.result = result
    rig.run(3.0)
    assert (rig.status().why_not_fly == f"{ITSELF} is not read yet") is (result != UNSUPPORTED)
    rig.run(5.0)
    rig.goal(*GOAL)
    rig.run(LOOK_AGAIN_S + 4.0)
    assert caplog.text.count("does not tell its fence") == 1
    rig.vehicle.fence.items, rig.vehicle.fence.result = HERE, mavlink.MAV_MISSION_ACCEPTED
    rig.up.send(mavlink.MAVLink_mission_ack_message(*QGC, mavlink.MAV_MISSION_ACCEPTED, FENCE))
    rig.run_until("it is read", lambda: bool(rig.pilot.fences()), within_s=2.0)
    assert rig.status().ended == f"outside {ITSELF}, area 1"


def test_one_whose_item_cannot_be_read_holds_no_drone_down_for_ever(caplog):
    """As with a broken memory card of the autopilot, which still knows how many there are."""
    rig = Rig()
    rig.vehicle.fence.items, rig.vehicle.fence.unreadable = [*HERE, *POND], 4
    rig.run(3.0)
    assert rig.status().why_not_fly == f"{ITSELF} is not read yet"
    rig.run(5.0)
    rig.goal(*GOAL)
    assert caplog.text.count("does not tell its fence") == 1


def test_a_switch_at_the_pilots_transmitter_and_a_parameter_count_at_once():
    rig = Rig()
    rig.vehicle.parameters["FENCE_ENABLE"] = 0.0
    rig.vehicle.fence.items = HERE
    assert not rig.ready().pilot.fences()
    rig.vehicle.faults.fence_on = True
    rig.run(1.5)
    assert rig.pilot.fences().names == f"{ITSELF}, area 1"
    rig.up.send(mavlink.MAVLink_param_value_message(b"FENCE_TYPE", 3.0, 9, 1, 0))
    rig.run(0.2)
    assert rig.pilot.fences().names == f"{ITSELF}, around home"


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_a_breach_ends_when_the_fence_is_switched_off(autopilot):
    """PX4 sends no FENCE_STATUS, and the report that the fence is on says no more of it."""
    rig = Rig(autopilot).ready()
    rig.vehicle.parameters["FENCE_ENABLE"], rig.vehicle.faults.fence_on = 0.0, True
    rig.vehicle.faults.fence_breached = True
    rig.run_until("it is outside", lambda: "outside" in rig.status().why_not_fly)
    rig.vehicle.faults.fence_on = False
    rig.run_until("it may fly", lambda: not rig.status().why_not_fly, within_s=3.0)
