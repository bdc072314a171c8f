"""What drones know of their own positions."""

from __future__ import annotations

import random
import statistics

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.drone import (
    CORRELATED_S,
    InProcessDrone,
    PositionErrors,
    PositionReceiver,
)

HERE = Location(4.0, 3.0, 1.0)


def errors_of(errors, count=4000, every_s=CORRELATED_S):
    clock = VirtualClock()
    drone = InProcessDrone(clock, HERE, lambda _started: None)
    receiver = PositionReceiver(drone, clock, errors, random.Random(1))
    found = []
    for _ in range(count):
        clock.run_until(clock.now_s + every_s)
        place = receiver.get_location()
        assert place.height == HERE.height
        found.append((place.longitude - HERE.longitude, place.latitude - HERE.latitude))
    return found


def test_the_error_is_normal_around_the_true_place():
    for values in zip(*errors_of(PositionErrors(sigma_m=2.0))):
        assert statistics.fmean(values) == pytest.approx(0.0, abs=0.15)
        assert statistics.pstdev(values) == pytest.approx(2.0, rel=0.06)


def test_the_error_drifts_slowly():
    steps = errors_of(PositionErrors(sigma_m=2.0), every_s=0.1)
    jumps = [abs(b[0] - a[0]) for a, b in zip(steps, steps[1:])]
    assert statistics.fmean(jumps) < 0.3


def test_outliers_are_as_frequent_and_as_far_as_given():
    found = errors_of(PositionErrors(outliers=0.1, outlier_m=30.0))
    far = [x**2 + y**2 for x, y in found if x**2 + y**2 > 1.0]
    assert len(far) / len(found) == pytest.approx(0.1, abs=0.02)
    assert all(square == pytest.approx(900.0) for square in far)


def test_without_a_receiver_no_position_is_known():
    with pytest.raises(LocationUnknown):
        errors_of(PositionErrors(known=False))
