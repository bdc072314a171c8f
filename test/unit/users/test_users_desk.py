import math

import pytest
from users_rig import UsersRig

from drone_mesh.errors import MessageRefused
from drone_mesh.users.desk import MOST_UNREAD, UsersDesk, check_wait


@pytest.fixture
def rig():
    return UsersRig()


def test_a_message_comes_to_the_listeners_of_its_port(rig):
    all_ports, port_5 = rig.desks[0].listen(), rig.desks[0].listen(5)
    assert rig.desks[2].send(0, b"four", port=4).wait(0.0)
    assert rig.desks[2].send(0, b"five", port=5).wait(1.0)
    assert [all_ports.next(0.0).payload for _ in range(2)] == [b"four", b"five"]
    assert port_5.next(0.0).payload == b"five"
    assert port_5.next(0.0) is None


def test_a_closed_listener_gets_nothing(rig):
    listener = rig.desks[0].listen()
    listener.close()
    rig.desks[2].send(0, b"late")
    assert listener.next(0.0) is None


def test_a_slow_listener_loses_the_oldest_messages_and_knows_how_many(rig):
    listener = rig.desks[0].listen()
    for number in range(MOST_UNREAD + 2):
        rig.desks[0].send(0, b"%d" % number)
    assert listener.next(0.0).payload == b"2"
    assert listener.dropped == 2


def test_a_refusal_comes_with_its_reason(rig):
    with pytest.raises(MessageRefused, match="too large"):
        rig.desks[2].send(0, bytes(1025)).ticket()
    with pytest.raises(MessageRefused, match="node 7 has not started"):
        UsersDesk(7, lambda work: None).send(0, b"")


def test_an_echo_is_answered_or_refused_with_the_reason(rig):
    assert rig.desks[0].echo(2, 1.0).route == (1,)
    with pytest.raises(MessageRefused, match="no route to node 77"):
        rig.desks[0].echo(77, 1.0)
    rig.network.nodes[2].component.on_msg = lambda payload, now_s: None
    assert rig.desks[0].echo(2, 0.01) is None


def test_an_echo_is_no_longer_waited_for_when_its_node_stops(rig):
    rig.network.nodes[2].component.on_msg = lambda payload, now_s: None
    polls = iter([False, True])
    assert rig.desks[0].echo(2, 300.0, stopping=lambda: next(polls)) is None
    assert next(polls, "asked twice") == "asked twice"


def test_an_echo_without_an_answer_names_the_neighbour_with_another_key(rig):
    network = rig.network
    network.nodes[2].component.data._send_packet = lambda *_packet: False
    assert rig.desks[0].echo(2, 0.01) is None
    reason = "a neighbour, node 9, sends packets without a seal: it has no key"
    network.nodes[0].component.complaints.foreign(1, reason, b"", network.now_s())
    with pytest.raises(MessageRefused, match=f"^no answer within 0.01 s; {reason}$"):
        rig.desks[0].echo(2, 0.01)
    with pytest.raises(MessageRefused, match=f"^no route to node 77; {reason}$"):
        rig.desks[0].echo(77, 0.01)


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf, 301.0])
def test_nobody_waits_for_a_time_that_is_none(seconds):
    with pytest.raises(MessageRefused, match=r"invalid wait .*: must be 0\.\.300 seconds"):
        check_wait(seconds)
