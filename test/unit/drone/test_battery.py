"""What a drone takes from its battery, and the crews of pads."""

from __future__ import annotations

import pytest

from drone_mesh.drone.battery import FLAT, Battery, Crews, PowerModel


def test_hover_takes_what_is_published_for_an_iris_and_a_slow_flight_hardly_less():
    iris = PowerModel(mass_kg=1.5, electronics_w=0.0, radio_w=0.0)
    assert iris.watts(0.0) == pytest.approx(176.0, rel=0.005)
    assert 0.98 < iris.watts(2.0) / iris.watts(0.0) < 1.0
    assert iris.watts(15.0) > iris.watts(8.0)  # drag


def test_a_full_battery_lasts_for_the_hovering_time_and_for_hours_on_the_ground():
    battery = Battery(PowerModel(hover_s=1200.0))
    battery.use(600.0, 0.0)
    assert battery.percent == pytest.approx(50.0)
    battery.use(3600.0, None)
    assert 35.0 < battery.percent < 42.0
    battery.use(1200.0, 0.0)
    assert battery.percent == FLAT
    used_j = battery.used_j
    battery.use(60.0, 0.0)
    assert battery.used_j == used_j  # there was nothing left
    battery.swap()
    assert battery.percent == 100.0


def served(crews, now_s, *drones, pad=0):
    return [drone for drone in drones if crews.serve(drone, pad, now_s)]


def test_a_crew_swaps_one_after_the_other_and_each_pad_has_its_own():
    crews = Crews(swap_s=60.0)
    assert served(crews, 0.0, 3, 4) == served(crews, 0.0, 5, pad=1) == []
    assert served(crews, 60.0, 3, 4) == [3]
    assert served(crews, 60.0, 5, pad=1) == [5]
    assert served(crews, 119.0, 4) == []
    assert served(crews, 120.0, 4) == [4]
    assert crews.swaps == 3


def test_who_came_first_is_served_first_whoever_asks_first():
    crews = Crews(swap_s=60.0)
    for now_s, came in enumerate((2, 5, 3)):
        served(crews, now_s, came)
    assert served(crews, 60.0, 2, 3, 5) == [2]
    assert served(crews, 60.0, 3, 5) == []
    assert served(crews, 120.0, 3, 5) == [5]


def test_a_crew_of_two_serves_two_at_once_and_who_flies_away_loses_its_turn():
    crews = Crews(swap_s=60.0, at_once=2)
    assert served(crews, 0.0, 3, 4, 5) == []
    crews.leave(3, 0)
    assert served(crews, 30.0, 4, 5) == []
    assert served(crews, 60.0, 4, 5) == [4]
    assert served(crews, 90.0, 5) == [5]
