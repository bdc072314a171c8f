"""The simulated vehicle's mission protocol, message by message, under a virtual clock."""

from __future__ import annotations

import pytest
from mavlink_rig import ARDUPILOT, ORIGIN, Wire, lift
from mavlink_vehicle.modes import Mode, mode_number
from mavlink_vehicle.vehicle import MavlinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.telemetry import Message

WAY = [Location(0.0, 0.0, 0.0), Location(20.0, 0.0, 10.0), Location(20.0, 30.0, 12.0)]


class GroundStation:
    """Sends as its pilot would, and collects what comes back."""

    def __init__(self, autopilot: Autopilot) -> None:
        self.now_s = 100.0
        self._from = Wire(1, 1)
        self._to = Wire(255, 190)
        self.vehicle = MavlinkVehicle(autopilot, ORIGIN, self._from.send)
        lift(self.vehicle, 10.0)
        self.vehicle.faults.estimate_good = True

    def say(self, message: Message) -> list[Message]:
        self._to.send(message)
        for arrived in self._to.take():
            self.vehicle.on_message(arrived, self.now_s)
        return self._from.take()

    def run(self, seconds: float) -> list[Message]:
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.vehicle.tick(self.now_s)
        return self._from.take()

    def item(self, number: int, command: int = mavlink.MAV_CMD_NAV_WAYPOINT) -> Message:
        place = ORIGIN.to_earth(WAY[number])
        return mavlink.MAVLink_mission_item_int_message(
            *(1, 1, number, mavlink.MAV_FRAME_GLOBAL_INT, command, 0, 1, 0.0, 0.0, 0.0, 0.0),
            *(round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7), place.altitude_m),
        )

    def upload(self) -> None:
        (request,) = self.say(mavlink.MAVLink_mission_count_message(1, 1, len(WAY)))
        for number in range(len(WAY)):
            assert (request.get_type(), request.seq) == ("MISSION_REQUEST_INT", number)
            (request,) = self.say(self.item(number))
        assert request.get_type() == "MISSION_ACK"
        assert request.type == mavlink.MAV_MISSION_ACCEPTED


BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)


@BOTH
def test_an_uploaded_mission_is_downloaded_as_it_was(autopilot: Autopilot) -> None:
    station = GroundStation(autopilot)
    station.upload()
    (count,) = station.say(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert count.count == len(WAY)
    for number in range(len(WAY)):
        (item,) = station.say(mavlink.MAVLink_mission_request_int_message(1, 1, number))
        wanted = station.item(number)
        assert (item.seq, item.command, item.frame) == (number, wanted.command, wanted.frame)
        assert (item.x, item.y, item.z) == (wanted.x, wanted.y, pytest.approx(wanted.z))
    (refused,) = station.say(mavlink.MAVLink_mission_request_int_message(1, 1, len(WAY)))
    assert refused.type == mavlink.MAV_MISSION_INVALID_SEQUENCE


@BOTH
def test_it_flies_a_mission_to_its_end_and_hovers_there(autopilot: Autopilot) -> None:
    station = GroundStation(autopilot)
    station.upload()
    assert station.vehicle.mission.item() is not None
    mode = mode_number(autopilot, Mode.MISSION)
    station.say(mavlink.MAVLink_set_mode_message(1, 1, mode))
    said = station.run(40.0)
    assert station.vehicle.mode is Mode.MISSION
    assert station.vehicle.body.place.distance_m(WAY[-1]) < 0.1
    reached = [m.seq for m in said if m.get_type() == "MISSION_ITEM_REACHED"]
    assert reached == ([0, 1, 2] if autopilot is PX4 else [1, 2])  # ArduPilot's item 0 is home


def test_a_lost_request_is_repeated_and_then_given_up() -> None:
    station = GroundStation(ARDUPILOT)
    station.say(mavlink.MAVLink_mission_count_message(1, 1, len(WAY)))
    asked = [m.seq for m in station.run(30.0) if m.get_type() == "MISSION_REQUEST_INT"]
    assert asked == [0] * 4
    assert station.say(station.item(0)) == []


def test_an_empty_mission_is_not_begun_and_a_wrong_one_is_refused() -> None:
    station = GroundStation(ARDUPILOT)
    auto = mavlink.MAVLink_set_mode_message(1, 1, mode_number(ARDUPILOT, Mode.MISSION))
    station.say(auto)
    assert station.vehicle.mode is Mode.HOLD
    station.say(mavlink.MAVLink_mission_count_message(1, 1, 1))
    nowhere = station.item(0)
    nowhere.x = 2_000_000_000
    (answer,) = station.say(nowhere)
    assert answer.type == mavlink.MAV_MISSION_INVALID
    (answer,) = station.say(mavlink.MAVLink_mission_count_message(1, 1, 60_000))
    assert answer.type == mavlink.MAV_MISSION_NO_SPACE
    (answer,) = station.say(
        mavlink.MAVLink_mission_count_message(1, 1, 3, mavlink.MAV_MISSION_TYPE_FENCE)
    )
    assert answer.type == mavlink.MAV_MISSION_UNSUPPORTED
    assert station.vehicle.mission.is_empty


def test_its_place_from_home_is_north_east_and_down() -> None:
    station = GroundStation(PX4)
    station.vehicle.body.place = Location(3.0, -4.0, 10.0)
    (place,) = (m for m in station.run(0.1) if m.get_type() == "LOCAL_POSITION_NED")
    assert (place.x, place.y, place.z) == (3.0, -4.0, -10.0)
