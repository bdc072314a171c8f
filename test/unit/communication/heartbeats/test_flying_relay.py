"""A router that flies far by order is no shorter way to its gateway.

It passes others faster than they notice a lost link, and often near the gateway: with few hops.
"""

from __future__ import annotations

from rig import Rig, packet

from drone_mesh.communication.timing import QUEUED, Medium

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


def through_for_a_gateway(rig):
    """Others of its heartbeats keep its neighbours."""
    return [sent[3] for sent in rig.sent(HEARTBEAT) if sent[4] != sent[3]]


def test_in_flight_it_says_that_it_is_connected_and_offers_no_hops():
    rig = flying_rig(Medium(policy=QUEUED))
    assert packet("01 01 03 fe fe ff 01") in rig.broadcasts()


def test_in_flight_it_answers_who_has_no_gateway():
    """Where all drones fly by order, there may be no other way."""
    rig = flying_rig(Medium(policy=QUEUED))
    rig.forget()
    rig.hear("05 05 03 01 fe ff 00")
    assert [sent[3] for sent in rig.sent(HEARTBEAT)] == [5]


def test_once_it_has_landed_and_is_connected_it_is_a_shorter_way_again():
    rig = flying_rig(Medium(policy=QUEUED))
    rig.engine.place = rig.engine.goals[-1]
    rig.wait(3.0)
    rig.forget()
    rig.mesh.on_msg(packet("00 02 04 01 01 01 00 01"), rig.now_s)
    assert hops_told(rig) == [2]


def test_only_who_has_no_gateway_goes_through_a_connected_neighbour_without_hops():
    """A connected router asks a neighbour with fewer hops at its next check: with 1 it would."""
    rig = Rig(medium=Medium(policy=QUEUED))
    rig.hear("02 02 03 01 fe ff 01")
    assert [sent[3] for sent in rig.tried(HEARTBEAT)] == [2]
    for hops, asked in (("ff", 3), ("01", 2)):
        rig = Rig(medium=Medium(policy=QUEUED))
        rig.know_neighbour(2)
        rig.connect_through(3, hops=4)
        rig.hear(f"02 02 03 01 fe {hops} 01")
        rig.forget()
        rig.wait(20.0)
        assert through_for_a_gateway(rig)[0] == asked
