"""The calls that a routing technique gets and may make, seen at the component that it serves."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.errors import PacketError


class Talkative(ChildTableTree):
    """Records the calls that it gets, adds bytes, and sends over two neighbours."""

    def __init__(self):
        super().__init__()
        self.heard, self.results, self.packets, self.woken_s = [], [], [], []
        self.bytes, self.rooms = b"", {}
        self.drops = False

    def learn(self, creator, from_, kind, payload):
        self.heard.append((creator, from_, kind))
        super().learn(creator, from_, kind, payload)
        return not self.drops

    def sent(self, neighbour, ok, transmissions):
        self.results.append((neighbour, ok, transmissions))
        super().sent(neighbour, ok, transmissions)

    def extension(self, kind, room):
        self.rooms[int(kind)] = room
        return self.bytes

    def on_packet(self, creator, from_, kind, body):
        self.packets.append((creator, from_, kind, body))

    def on_time(self, now_s):
        self.woken_s.append(now_s)


@pytest.fixture
def rig():
    return Rig(routing=Talkative())


def test_extension_bytes_follow_the_body_of_a_present(rig):
    rig.routing.bytes = b"\xaa\xbb"
    rig.mesh.control.search_other_nodes_in_range()
    assert rig.antenna.broadcasts[-1] == packet("01 01 03 fe fe ff 00 aa bb")


def test_extension_bytes_follow_the_body_of_a_heartbeat(rig):
    rig.hear("02 02 03 01 fe 00 01")
    rig.routing.bytes = b"\xaa\xbb"
    rig.mesh.control.send_heartbeat(2)
    assert rig.antenna.taken[-1] == packet("01 01 04 02 02 00 ff 00 aa bb")


def test_a_technique_learns_how_many_bytes_fit(rig):
    rig.hear("02 02 03 01 fe 00 01")
    rig.mesh.control.search_other_nodes_in_range()
    assert rig.routing.rooms == {3: 23, 4: 24}


def test_extension_bytes_that_do_not_fit_are_an_error_of_the_technique(rig):
    rig.routing.bytes = bytes(26)
    with pytest.raises(PacketError, match="26 extension bytes do not fit into 23"):
        rig.mesh.control.search_other_nodes_in_range()


def test_a_forwarded_heartbeat_keeps_its_extension_bytes(rig):
    rig.hear("02 02 03 01 fe 00 01")
    rig.hear("03 03 03 01 fe 00 01")
    rig.hear("02 02 04 01 03 00 ff 00 aa bb")
    assert rig.antenna.taken[-1] == packet("02 01 04 03 03 00 ff 01 aa bb")


def test_a_technique_hears_each_packet_and_may_drop_it(rig):
    rig.hear("03 03 03 01 fe 00 01")
    taken = len(rig.antenna.taken)
    rig.routing.drops = True
    rig.hear("09 02 04 01 03 00 ff 00")
    assert rig.routing.heard[-1] == (9, 2, 4)
    assert len(rig.antenna.taken) == taken


def test_a_technique_learns_the_result_and_the_transmissions_of_each_send(rig):
    rig.hear("02 02 03 01 fe 00 01")
    rig.antenna.losing = 1
    rig.mesh.control.send_heartbeat(2)
    assert rig.routing.results[-1] == (2, True, 2)
    rig.antenna.dead.add(2)
    rig.mesh.control.send_heartbeat(2)
    assert (2, False, 3) in rig.routing.results


def test_a_technique_gets_packets_of_its_own_types_and_of_no_others(rig):
    rig.hear("02 02 08 01 01 07")
    rig.hear("02 02 3f 01 01 07")
    rig.hear("02 02 40 01 01 07")
    assert [kind for _creator, _from, kind, _body in rig.routing.packets] == [8, 63]
    assert rig.routing.packets[0] == (2, 2, 8, b"\7" + bytes(26))


def test_a_technique_sends_packets_of_its_own_types(rig):
    rig.hear("02 02 03 01 fe 00 01")
    rig.mesh.control.send_packet(8, 2, b"\7")
    assert rig.antenna.taken[-1] == packet("01 01 08 02 02 07")
    rig.mesh.control.broadcast_packet(9, b"\7")
    assert rig.antenna.broadcasts[-1] == packet("01 01 09 fe fe 07")


def test_a_technique_is_woken_when_it_asked_to_be(rig):
    rig.mesh.control.wake_at(1.5)
    assert rig.mesh.next_tick_s == 1.5
    rig.mesh.tick(1.5)
    assert rig.routing.woken_s == [1.5]
    assert rig.mesh.next_tick_s > 1.5


def test_child_table_tree_adds_no_byte_to_any_packet():
    rig = Rig()
    rig.hear("02 02 03 01 fe 00 01")
    rig.mesh.control.search_other_nodes_in_range()
    rig.mesh.control.send_heartbeat(2)
    assert rig.antenna.broadcasts[-1][7:] == bytes(25)
    assert rig.antenna.taken[-1][8:] == bytes(24)
