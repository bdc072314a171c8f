"""BeaconPlane: one router with the technique `beacon`, packets in and packets out."""

from __future__ import annotations

from rig import Rig, packet

from drone_mesh.communication.beacon.plane import BeaconTechnique

SEARCH = 0x29
BEACONS = (f"0{node} 0{node} 28 01 fe 00 14 ff 00 ff ff ff ff ff 00 ff ff" for node in (2, 3))


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
