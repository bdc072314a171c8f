"""OwnMotion: velocity over two seconds, and whether somebody flies the drone."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.own_beacons import OwnMotion
from drone_mesh.drone.location import Location


class Drone:
    place = Location(0.0, 0.0, 0.0)

    def locate(self):
        return self.place


@pytest.fixture
def drone():
    return Drone()


@pytest.fixture
def motion(drone):
    return OwnMotion(drone.locate, step_m=0.45)


def fly(drone, motion, seconds, east_m_s):
    for tick in range(int(seconds * 5)):
        drone.place = Location(0.0, east_m_s * tick / 5, 0.0)
        last = motion.at(tick / 5)
    return last


def test_the_velocity_is_that_of_the_last_two_seconds(drone, motion):
    assert fly(drone, motion, 6.0, 0.5).velocity == pytest.approx((0.0, 0.5, 0.0))


def test_a_place_that_jumps_at_the_start_is_no_great_velocity(drone, motion):
    motion.at(0.0)
    drone.place = Location(0.0, 1.0, 0.0)
    assert motion.at(0.1).velocity == pytest.approx((0.0, 1.0, 0.0))


def test_after_a_turn_the_velocity_is_that_of_the_new_leg(drone, motion):
    fly(drone, motion, 6.0, 0.5)
    for tick in range(30, 34):
        drone.place = Location(2.0 * (tick - 29) / 5, 2.9, 0.0)
        motion.at(tick / 5)
    motion.has_turned(6.6)
    drone.place = Location(2.0, 2.9, 0.0)
    assert motion.at(6.8).velocity == pytest.approx((2.0, 0.0, 0.0))


def test_soon_after_a_turn_a_receivers_noise_is_no_great_velocity(drone, motion):
    fly(drone, motion, 6.0, 0.0)
    motion.has_turned(6.5)
    motion.at(6.5)
    drone.place = Location(0.0, 0.2, 0.0)
    assert motion.at(6.7).velocity == pytest.approx((0.0, 0.4, 0.0))


def test_an_unknown_place_has_no_motion(drone, motion):
    drone.place = None
    assert motion.at(0.0) is None
    assert motion.stands(0.0)


def test_a_drone_that_is_flown_stands_again_ten_seconds_after_its_last_step(drone, motion):
    fly(drone, motion, 6.0, 0.5)
    assert not motion.stands(6.0)
    assert motion.stands(16.0)


def test_noise_of_a_receiver_is_no_flight(drone, motion):
    for tick in range(100):
        drone.place = Location(0.2 * (tick % 3 - 1), 0.2 * (tick % 2), 0.0)
        motion.at(tick / 5)
    assert motion.stands(20.0)
