"""BeaconPlane: one router with the technique `beacon`, packets in and packets out."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.beacon.plane import BeaconTechnique
from drone_mesh.drone.location import Location

LOCATION, SEARCH, LAST_PLACE = 0x01, 0x29, 0x45
BEACONS = [f"0{node} 0{node} 28 01 fe 00 14 ff 00 ff ff ff ff ff 00 ff ff" for node in (2, 3)]


def test_a_packet_that_waits_leaves_towards_the_neighbour_that_says_where_its_addressee_is():
    """Node 6 leads to node 33, for which node 1 searched; its answer came over node 3."""
    rig = Rig(routing=BeaconTechnique())
    rig.hear(*BEACONS)
    rig.wait(0.2)
    rig.forget()
    next_beacon_s = rig.mesh.next_tick_s
    rig.hear("05 02 00 01 21 07")
    assert [sent[2] for sent in rig.broadcasts()] == [SEARCH]
    assert rig.sent() == []
    rig.hear("06 03 2a 01 01 21")
    assert rig.sent() == [packet("05 01 00 03 21 07")]
    assert rig.mesh.next_tick_s == next_beacon_s


def test_a_drone_that_flies_by_is_answered_where_it_asks_and_not_where_it_was():
    """The way to node 2 led over node 3 a moment ago; an answer over that one would be late."""
    rig = Rig(routing=BeaconTechnique())
    rig.hear(BEACONS[1], "02 03 02 01 01 00 00 a0 40 00 00 00 00 01 00")  # 2 is at latitude 5
    rig.hear("07 03 02 01 01 00 00 00 41 00 00 00 00 01 00")  # 7 is at latitude 8
    rig.forget()
    rig.hear("02 02 02 01 fe 00 00 e0 40 00 00 00 00 01 80")  # 2 asks all: it flies to 7
    assert [(sent[2], *sent[3:5]) for sent in rig.sent()] == [(LOCATION, 2, 2), (LAST_PLACE, 2, 2)]


def test_a_gateway_in_flight_is_looked_for_at_the_goal_that_it_announced():
    """It may be out of reach a moment later, and not where it was seen on its way."""
    rig = Rig(routing=BeaconTechnique())
    rig.engine.place = Location(11.0, 11.0, 0.0)
    rig.hear("00 00 28 01 fe 15 10 00 fc 00 ff ff ff ff 73 00 74 00 00 00 00 00 00 00 01")
    assert rig.mesh.places.gateway == Location(pytest.approx(11.5), pytest.approx(11.6), 0.0)
    rig.hear("00 00 01 01 fe 00 00 80 41 00 00 80 bf 00 00 00 00 00 80")  # to latitude 16
    rig.hear("00 00 28 01 fe 15 10 00 fd 00 ff ff ff ff 78 00 66 00 47 00 0a f0 00 00 01")
    assert rig.mesh.places.gateway == Location(16.0, -1.0, 0.0)
    rig.wait(11.0)
    rig.hear("00 00 28 01 fe 15 10 00 fe 00 ff ff ff ff 7d 00 66 00 00 00 00 00 00 00 01")
    assert rig.mesh.places.gateway == Location(pytest.approx(12.5), pytest.approx(10.2), 0.0)


def test_the_way_back_to_who_searches_is_the_one_that_the_search_took_first():
    """Every node repeats it, also those further on: their copies show no way back."""
    rig = Rig(routing=BeaconTechnique())
    rig.hear(*BEACONS)
    rig.hear("05 02 29 01 fe 21 01 00 0a", "05 03 29 01 fe 21 01 00 09")
    rig.wait(0.2)
    rig.forget()
    rig.hear("21 04 2a 01 05 21")
    assert rig.sent() == [packet("21 01 2a 02 05 21")]
