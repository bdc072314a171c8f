"""On a shared channel a router that flies far by order leads nobody to its gateway.

It passes others faster than they notice a lost link, and often near the gateway: with few hops.
"""

from __future__ import annotations

from rig import Rig, packet

from drone_mesh.communication.timing import QUEUED, UNDISTURBED, Medium

PRESENT, HEARTBEAT = 3, 4
ORDER_FAR = "00 02 06 01 01 00 00 00 41"  # to latitude 8


def flying_rig(medium):
    """Router 1, connected through 2 in flight."""
    rig = Rig(medium=medium)
    rig.connect_through(2)
    rig.hear(ORDER_FAR)
    rig.forget()
    rig.mesh.on_msg(packet("00 02 04 01 01 01 00 01"), rig.now_s)
    assert rig.mesh.get_connected_to_gateway()
    return rig


def hops_told(rig):
    return [sent[5] for sent in rig.broadcasts() if sent[2] == PRESENT]


def test_in_flight_it_says_that_it_is_connected_and_offers_no_hops():
    rig = flying_rig(Medium(policy=QUEUED))
    assert packet("01 01 03 fe fe ff 01") in rig.broadcasts()


def test_where_a_lost_link_is_noticed_at_once_it_offers_its_way():
    assert hops_told(flying_rig(UNDISTURBED)) == [2]


def test_in_flight_it_does_not_answer_who_looks_for_a_gateway():
    rig = flying_rig(Medium(policy=QUEUED, answer_spread_s=0.2))
    rig.wait(1.0)  # for the search that it had planned before
    rig.forget()
    rig.broadcasts()
    rig.hear("05 05 03 01 fe ff 00", "05 05 04 01 01 00 ff 00")
    rig.wait(0.25)
    assert (hops_told(rig), rig.sent(HEARTBEAT)) == ([], [])


def test_once_it_has_landed_and_is_connected_it_leads_others_again():
    rig = flying_rig(Medium(policy=QUEUED))
    rig.engine.place = rig.engine.goals[-1]
    rig.wait(3.0)
    rig.forget()
    rig.mesh.on_msg(packet("00 02 04 01 01 01 00 01"), rig.now_s)
    assert hops_told(rig) == [2]


def test_nobody_looks_for_a_gateway_through_a_connected_neighbour_without_hops():
    rig = Rig(medium=Medium(policy=QUEUED))
    rig.hear("02 02 03 01 fe ff 01")
    assert rig.tried(HEARTBEAT) == []
    rig.hear("02 02 03 01 fe 01 01")
    assert [sent[3] for sent in rig.tried(HEARTBEAT)] == [2]
