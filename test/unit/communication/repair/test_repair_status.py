"""The sentence about a repair that every view shows."""

from __future__ import annotations

import pytest
from rig import Rig

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.repair.status import NO_CHECK_YET, NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.drone.location import Location

OCCUPIED = "the place of 2 is occupied by 3"


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (NOTHING_TO_REPAIR, ""),
        (NO_CHECK_YET, "has no gateway; its periodic check begins the wait for one"),
        (RepairStatus(RepairState.AT_REST, OCCUPIED), f"does not fly: {OCCUPIED}"),
        (RepairStatus(RepairState.LOST, emergency_s=111.2), "waits 12 s for a gateway"),
        (RepairStatus(RepairState.LOST, emergency_s=99.0), "waits for a gateway"),
        (
            RepairStatus(RepairState.LOST, OCCUPIED, emergency_s=111.2),
            f"waits 12 s for a gateway; does not fly: {OCCUPIED}",
        ),
        (
            RepairStatus(RepairState.LOST, emergency_s=230.0, silent=True),
            "waits 130 s for a gateway: all its neighbours fell silent together",
        ),
        (RepairStatus(RepairState.ASKING, OCCUPIED), "asks where its neighbours are"),
        (
            RepairStatus(RepairState.NEGOTIATING, bid=15.52, bid_unit="m", place_of=2),
            "negotiating, bids 15.5 m for the place of 2",
        ),
        (
            RepairStatus(RepairState.NEGOTIATING, bid=1 / 9, bid_unit="m", place_of=0),
            "negotiating, bids 0.111 for the place of 0",
        ),
        (
            RepairStatus(RepairState.NEGOTIATING, bid=1 + 1 / 9, place_of=2),
            "negotiating, bids 1.11 for the place of 2",
        ),
        (
            RepairStatus(RepairState.NEGOTIATING, bid=0.0, place_of=6),
            "negotiating, bids 0 for the place of 6",
        ),
        (
            RepairStatus(RepairState.NEGOTIATING, bid=0.0),
            "negotiating, bids 0 to look where another drone did",
        ),
        (
            RepairStatus(RepairState.NEGOTIATING, OCCUPIED),
            f"negotiating, does not bid: {OCCUPIED}",
        ),
        (RepairStatus(RepairState.WATCHING, bid=9.0, winner=4), "waits for 4 to take off"),
        (RepairStatus(RepairState.FLYING, place_of=2), "flies to the place of 2"),
        (
            RepairStatus(RepairState.FLYING, goal=Location(4.0, 3.0, 0.0)),
            "flies to x 3.00 m, y 4.00 m, z 0 m",
        ),
        (RepairStatus(RepairState.FLYING, "a gateway answers"), "lands: a gateway answers"),
        (
            RepairStatus(RepairState.FLYING, place_of=2, landed=True),
            "has landed, checks that no other drone is there",
        ),
    ],
)
def test_a_status_is_one_short_sentence(status, words):
    assert status.in_words(now_s=100.0) == words


def test_a_gateway_and_a_connected_router_have_nothing_to_repair():
    assert Rig(0, gateway=True).mesh.get_repair_status() == NOTHING_TO_REPAIR
    rig = Rig()
    rig.connect_to_gateway()
    assert rig.mesh.get_repair_status() == NOTHING_TO_REPAIR


def test_before_a_check_finds_the_loss_a_router_says_that_it_waits_for_that_check():
    rig = Rig()
    assert rig.mesh.get_repair_status() == NO_CHECK_YET
    rig.antenna.powered = False
    assert rig.mesh.get_repair_status() == NOTHING_TO_REPAIR


def test_an_ordered_flight_is_not_a_repair():
    rig = Rig()
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 a0 41")
    rig.wait(1.0)
    assert rig.engine.goals
    assert rig.repair_in_words() == ""
