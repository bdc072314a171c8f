"""A machine gives the node no time: a gap in its own reading is not the autopilot's silence."""

from __future__ import annotations

import socket

import pytest
from mavlink_rig import STEP_S, Rig
from mavlink_vehicle.modes import Mode
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.engine import ListeningClock
from drone_mesh.drone.mavlink.link import MavlinkLink
from drone_mesh.drone.mavlink.pilot_status import Phase

GOAL = Location(100.0, 0.0, 12.0)
HEARTBEATS = 200


class SleepyRig(Rig):
    """Its node can sleep: the vehicle flies on, unless it sleeps as well."""

    asleep_s = 0.0  # so far

    def step(self) -> None:
        self.now_s += STEP_S
        self.vehicle.tick(self.now_s + self.asleep_s)
        self.read()

    def read(self) -> None:
        for message in self.up.take():
            self.pilot.on_message(message, self.now_s)
        self.pilot.tick(self.now_s)
        for message in self.down.take():
            self.vehicle.on_message(message, self.now_s + self.asleep_s)

    def sleep(self, seconds: float, vehicle_too: bool = False) -> None:
        clock = ListeningClock(self.now_s)
        clock.step(self.now_s + seconds)
        if vehicle_too:
            self.asleep_s -= clock.now_s - self.now_s
        else:
            for step in range(round(seconds / STEP_S)):
                self.vehicle.tick(self.now_s + self.asleep_s + step * STEP_S)
            self.asleep_s += seconds - (clock.now_s - self.now_s)
        self.now_s = clock.now_s
        for message in self.up.take():
            self.pilot.on_message(message, self.now_s)
        self.pilot.slept(self.now_s)
        self.read()


def in_flight() -> SleepyRig:
    rig = SleepyRig()
    rig.ready()
    rig.vehicle.parameters["FS_GCS_ENABLE"] = 0.0  # it shall not act by itself
    rig.goal(*GOAL)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 10.0)
    return rig


@pytest.mark.parametrize("vehicle_too", [False, True])
def test_a_flight_goes_on_after_the_node_had_no_time(vehicle_too: bool) -> None:
    rig = in_flight()
    for _ in range(5):
        rig.sleep(4.5, vehicle_too)
        rig.run(0.5)
    rig.reach(Phase.HOLDING)
    assert rig.status().ended == ""
    assert rig.place.distance_m(GOAL) < 1.5


def test_after_a_sleep_silence_ends_a_flight_as_soon_as_ever() -> None:
    rig = in_flight()
    rig.up.broken = True
    rig.sleep(4.0)
    rig.run(3.2)
    assert not rig.status().is_flying
    assert "no heartbeat from the autopilot for more than 3 s" in rig.status().why_not_fly


def test_a_mode_that_the_pilot_chose_meanwhile_is_left_alone() -> None:
    rig = in_flight()
    sent = len(rig.down.sent)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.sleep(4.0)
    rig.run(5.0)
    assert rig.vehicle.mode is Mode.HOLD
    assert rig.status().ended == "LOITER was chosen: the pilot flies"
    assert not any(m.get_type().startswith("SET_POSITION") for m in rig.down.sent[sent:])


def test_what_waited_in_the_line_moves_nothing_until_a_heartbeat_of_now() -> None:
    """A serial port keeps the oldest of what came meanwhile, and loses the latest."""
    rig = in_flight()
    rig.vehicle.tick(rig.now_s + STEP_S * 20)  # these reports wait; they tell of GUIDED
    assert rig.up.waiting
    rig.up.broken = True
    rig.vehicle.choose_mode(Mode.RETURN)
    sent, ordered = len(rig.down.sent), len(rig.commands())
    rig.sleep(4.0)
    rig.goal(30.0, 0.0, 5.0)
    rig.run(0.5)
    rig.up.broken = False
    rig.run(3.0)
    assert {m.get_type() for m in rig.down.sent[sent:]} <= {"HEARTBEAT", "COMMAND_LONG"}
    assert rig.commands()[ordered:] == []
    assert rig.status().ended == "RTL was chosen: the pilot flies"


def test_a_link_returns_everything_that_waits() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    link = MavlinkLink(f"udpin:127.0.0.1:{port}")
    codec = mavlink.MAVLink(None, 1, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        for mode in range(HEARTBEATS):
            codec.seq = mode % 256
            beat = mavlink.MAVLink_heartbeat_message(2, 3, 0, mode, 3, 3)
            peer.sendto(beat.pack(codec), ("127.0.0.1", port))
        heard = link.receive(1.0)
    link.close()
    assert [message.custom_mode for message in heard] == list(range(HEARTBEATS))
