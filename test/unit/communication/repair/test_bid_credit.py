from __future__ import annotations

import pytest

from drone_mesh.communication.repair.election import BACKUP, BidCredit, highest_plausible
from drone_mesh.drone.location import Location

MOST = 2000.0


def test_a_bid_beyond_every_place_of_the_group_does_not_count():
    credit = BidCredit()
    assert not credit.believes(7, 1e9, 2, MOST)
    assert credit.believes(7, 30.0, 2, MOST)


def test_no_node_of_a_group_is_farther_than_a_chain_of_all_ids():
    own, gateway = Location(0.0, 12.0, 0.0), Location(0.0, 0.0, 0.0)
    assert highest_plausible(own, gateway, 9.0) == pytest.approx(12.0 + 253 * 9.0)


@pytest.mark.parametrize(("own", "gateway"), [(None, Location(0, 0, 0)), (Location(0, 0, 0), None)])
def test_a_node_that_knows_no_places_believes_any_bid_but_no_code_that_it_does_not_know(
    own, gateway
):
    most = highest_plausible(own, gateway, 9.0)
    assert BidCredit().believes(7, 1e9, 2, most)
    assert not BidCredit().believes(7, BACKUP, 2, most)


def test_a_neighbour_that_brings_winners_which_do_not_fly_is_no_longer_believed():
    credit = BidCredit()
    for winner in (100, 101, 102):
        assert credit.believes(winner, 50.0, 2, MOST)
        credit.did_not_fly(winner)
    assert not credit.believes(103, 50.0, 2, MOST)
    assert credit.believes(103, 50.0, 3, MOST)


def test_all_are_believed_again_once_the_node_is_connected():
    credit = BidCredit()
    for winner in (100, 101, 102):
        credit.believes(winner, 50.0, 2, MOST)
        credit.did_not_fly(winner)
    credit.clear()
    assert credit.believes(103, 50.0, 2, MOST)
