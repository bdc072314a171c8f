"""Random and hostile messages, and a link that breaks at any moment.

The long run is this file with MAVLINK_MESSAGES=200000 MAVLINK_LOSSES=1000 in the environment.
"""

from __future__ import annotations

import contextlib
import os
import random
import struct

import pytest
from mavlink_rig import ALL, ARDUPILOT, NONE, Rig, is_inside
from mavlink_vehicle.modes import Mode
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.errors import GoalRefused

MESSAGES = int(os.environ.get("MAVLINK_MESSAGES", "20000"))  # of all tests together
LOSSES = int(os.environ.get("MAVLINK_LOSSES", "20"))
HOME = Location(0.0, 0.0, 0.0)
LISTENED_TO = [
    "HEARTBEAT",
    "GLOBAL_POSITION_INT",
    "GPS_RAW_INT",
    "EKF_STATUS_REPORT",
    "ESTIMATOR_STATUS",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "FENCE_STATUS",
    "RC_CHANNELS",
    "COMMAND_ACK",
    "PARAM_VALUE",
    "MISSION_COUNT",
    "MISSION_ITEM_INT",
    "MISSION_ACK",
]
TYPES = {message.msgname: message for message in mavlink.mavlink_map.values()}
FLIGHT_ORDERS = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_NAV_LAND,
}


def _random_message(rng: random.Random) -> Message:
    """Any message with any bytes; mostly of the types that are listened to, and as the vehicle."""
    names = LISTENED_TO if rng.random() < 0.8 else sorted(TYPES)
    kind = TYPES[rng.choice(names)]
    size = struct.calcsize(kind.unpacker.format)
    body = bytearray(rng.getrandbits(8 * size).to_bytes(size, "little"))
    if kind.msgname == "HEARTBEAT" and rng.random() < 0.8:  # of something that looks flyable
        body[0:4] = struct.pack("<I", rng.choice([0, 3, 4, 5, 6, 9, 6 << 16, 4 << 16 | 3 << 24]))
        body[4:9] = bytes((2, rng.choice([3, 12]), rng.choice([1, 129]), 4, 3))
    system, component = rng.choice([(1, 1), (1, 1), (1, 1), (255, 190), (2, 1)])
    codec = mavlink.MAVLink(None, system, component)
    return _decode(codec, kind, bytes(body))


def _decode(codec, kind, body: bytes) -> Message:
    """As if it had come from a line: a frame with a right checksum, parsed."""
    header = mavlink.MAVLink_header(
        kind.id, 0, 0, len(body), 0, codec.srcSystem, codec.srcComponent
    )
    frame = header.pack(force_mavlink1=False) + body
    crc = mavlink.x25crc(frame[1:])
    crc.accumulate(bytes((kind.crc_extra,)))
    (message,) = mavlink.MAVLink(None).parse_buffer(frame + struct.pack("<H", crc.crc))
    return message


def _hostile(rig: Rig, messages: int, seed: int, goals: bool) -> None:
    rng = random.Random(seed)
    for number in range(messages):
        rig.now_s += rng.choice([0.0, 0.001, 0.01, 0.1])
        rig.pilot.on_message(_random_message(rng), rig.now_s)
        if number % 5 == 0:
            if goals:
                goal = Location(*(rng.uniform(-700, 700) for _ in range(2)), rng.uniform(0, 80))
                with contextlib.suppress(GoalRefused):
                    rig.pilot.set_goal(goal, rng.random() < 0.3, rig.now_s)
            rig.pilot.tick(rig.now_s)
            rig.status()
        rig.down.take()


def _flight_orders(rig: Rig) -> set[int]:
    return set(rig.commands()) & FLIGHT_ORDERS


@pytest.mark.parametrize("seed", range(4))
def test_random_messages_crash_nothing_and_start_no_flight(seed: int) -> None:
    rig = Rig(permissions=ALL)
    _hostile(rig, messages=MESSAGES // 8, seed=seed, goals=False)
    assert _flight_orders(rig) == set()


@pytest.mark.parametrize("seed", range(4, 8))
def test_without_permission_random_messages_and_goals_never_arm_or_take_off(seed: int) -> None:
    rig = Rig(permissions=NONE)
    _hostile(rig, messages=MESSAGES // 8, seed=seed, goals=True)
    assert _flight_orders(rig) <= {mavlink.MAV_CMD_NAV_LAND}


def lose_the_link(autopilot: Autopilot, seed: int) -> Rig:
    """Fly, lose the link at a random moment in one or both directions, wait for the end."""
    rng = random.Random(seed)
    limits = FlightLimits(max_height_m=20.0, max_distance_m=60.0, speed_m_s=4.0)
    rig = Rig(autopilot, ALL, limits, node_id=rng.randrange(254)).ready()
    for _ in range(3):
        goal = Location(rng.uniform(-40, 40), rng.uniform(-40, 40), rng.uniform(2, 20))
        rig.goal(*goal, lands=rng.random() < 0.2)
        rig.run(rng.uniform(0.0, 15.0))
        if rig.status().why_not_fly:
            break
    rig.down.broken = rng.random() < 0.8
    rig.up.broken = not rig.down.broken or rng.random() < 0.5
    was_armed = rig.vehicle.body.armed
    rig.down.sent.clear()
    rig.run(12.0)  # the autopilot has noticed
    assert rig.up.broken is False or not rig.status().is_flying
    assert was_armed or not rig.vehicle.body.armed or not rig.down.broken
    rig.down.broken = rig.up.broken = False
    armed = rig.vehicle.body.armed
    rig.run(8.0)
    assert armed or not rig.vehicle.body.armed, "it armed after the link was lost"
    return rig


def check_after_loss(rig: Rig) -> None:
    """The drone holds or lands, nothing is resumed, no target was outside the limits."""
    assert all(is_inside(target, rig.limits, HOME) for target in rig.targets())
    assert rig.vehicle.mode in (Mode.HOLD, Mode.FOLLOW, Mode.LAND)
    before = rig.place
    rig.run(3.0)
    moved_m = Location(before.latitude, before.longitude, 0.0).distance_m(
        rig.place._replace(height=0.0)
    )
    assert moved_m < 0.1
    assert rig.place.height <= before.height + 0.1


@pytest.mark.parametrize("seed", range(LOSSES // 2))
@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)
def test_a_link_lost_at_any_moment_ends_in_holding_or_landing(
    autopilot: Autopilot, seed: int
) -> None:
    check_after_loss(lose_the_link(autopilot, seed))


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)
def test_messages_of_strangers_on_the_line_do_not_disturb_a_flight(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(20.0, 0.0, 5.0)
    rng = random.Random(11)
    for _ in range(1000):
        rig.step()
        message = _random_message(rng)
        if message.get_srcSystem() != 1:
            rig.pilot.on_message(message, rig.now_s)
    assert rig.place.distance_m(Location(20.0, 0.0, 5.0)) < 0.5
