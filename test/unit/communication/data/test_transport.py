import pytest

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.channel.medium_access import MediumAccess
from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import LIFETIME_S, TO_ALL, TO_GATEWAY, TicketState
from drone_mesh.communication.data.packets import Head
from drone_mesh.communication.data.transport import MOST_QUEUED
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.wire.messages import is_data
from drone_mesh.communication.wire.packet_types import Priority
from drone_mesh.errors import MessageRefused, QueueFull
from drone_mesh.inprocess import Network


@pytest.fixture
def network():
    """Gateway 0 and routers 1, 2, 3 in a line, all connected."""
    network = Network(seed=5)
    network.add_gateway(0, 0.0, 0.0)
    for node in (1, 2, 3):
        network.add_router(node, 6.0 * node, 0.0)
    assert network.run_until(network.all_connected, 30.0)
    network.run_for(1.0)
    return network


def payloads(network, node):
    return [message.payload for message in network.received.get(node, [])]


@pytest.mark.parametrize("size", [0, 17, 18, 1024])
def test_a_reliable_message_arrives_over_three_hops_and_its_ticket_says_so(network, size):
    ticket = network.send(3, 0, b"x" * size, port=9)
    assert ticket.state is TicketState.QUEUED or ticket.state is TicketState.SENT
    network.run_for(1.0)
    (message,) = network.received[0]
    assert (message.sender, message.port, message.payload) == (3, 9, b"x" * size)
    assert ticket.state is TicketState.DELIVERED


def test_a_message_for_the_gateway_goes_to_the_one_that_the_node_uses(network):
    ticket = network.send(2, TO_GATEWAY, b"up")
    network.run_for(1.0)
    assert payloads(network, 0) == [b"up"]
    assert ticket.state is TicketState.DELIVERED


def test_messages_for_the_gateway_keep_their_order_when_it_is_another_one():
    network = Network(seed=5)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(2, 6.0, 0.0)
    network.add_gateway(1, 12.0, 0.0)
    network.power(1, False)
    assert network.run_until(lambda: network.connected(2), 30.0)
    network.power(0, False)
    network.send(2, TO_GATEWAY, b"to the first gateway")
    network.run_for(5.0)
    network.power(1, True)
    router = network.nodes[2].component
    assert network.run_until(lambda: router.get_preferred_gateway() == 1, 60.0)
    network.send(2, TO_GATEWAY, b"to the second gateway")
    network.run_for(10.0)
    assert payloads(network, 1) == [b"to the first gateway", b"to the second gateway"]


def test_every_node_may_send_to_this_one_and_to_all_and_no_message_comes_twice(network):
    payload = b"twice on the air"
    head = Head(0, 7, 5, len(payload), True, 0, 0, packets.checksum(7, 5, 0, payload))
    body = packets.first_body(head, payload, 27)
    senders = range(1, MAX_NODE_ID + 1)
    for _ in range(2):
        for sender in senders:
            for forward in (0, TO_ALL):
                header = bytes((sender, 1, packets.FRAGMENTS.start, 0, forward))
                network.inject(0, (header + body).ljust(32, bytes(1)))
    heard = [(message.sender, message.to_all) for message in network.received[0]]
    assert sorted(heard) == [(sender, to_all) for sender in senders for to_all in (False, True)]


def test_a_message_to_all_reaches_each_node_once(network):
    ticket = network.send(1, TO_ALL, b"to everyone in the whole mesh")
    network.run_for(1.0)
    assert {node: len(got) for node, got in network.received.items()} == {0: 1, 2: 1, 3: 1}
    assert ticket.state is TicketState.SENT
    assert ticket.final


def test_no_message_to_all_gets_an_ack_neither_twice_nor_in_part_nor_marked_as_reliable(network):
    sent = []
    network.nodes[0].antenna.send_message_to = lambda payload: bool(sent.append(payload)) or True
    first = packets.first_body(Head(0, 7, 5, 70, True, 0, 0, 0), bytes(70), 27)
    last = packets.further_body(0, 2, bytes(70), 27)
    short = packets.first_body(
        Head(1, 7, 5, 0, True, 0, 1, packets.checksum(7, 5, 1, b"")), b"", 27
    )
    for index, body in ((0, first), (2, last), (2, last), (0, short), (0, short)):
        header = bytes((2, 1, packets.FRAGMENTS.start + index, 0, TO_ALL))
        network.inject(0, (header + body).ljust(32, bytes(1)))
    network.run_for(5.0)
    assert [payload for payload in sent if is_data(payload) and payload[0] == 0] == []


def test_a_gateway_without_internet_takes_its_own_messages_when_it_has_it_again(network):
    network.internet(0, False)
    network.run_for(40.0)
    waiting = network.send(0, TO_GATEWAY, b"first")
    network.internet(0, True)
    second = network.send(0, TO_GATEWAY, b"second")
    network.run_for(1.0)
    assert payloads(network, 0) == [b"first", b"second"]
    assert waiting.state is second.state is TicketState.DELIVERED


def test_a_message_to_itself_is_delivered_at_once(network):
    assert network.send(2, 2, b"me").state is TicketState.DELIVERED
    assert payloads(network, 2) == [b"me"]


def test_without_acknowledgement_no_ack_comes_back(network):
    sent = []
    network.nodes[0].antenna.send_message_to = lambda payload: bool(sent.append(payload)) or True
    ticket = network.send(1, 0, b"best effort", reliable=False)
    network.run_for(1.0)
    assert ticket.state is TicketState.SENT
    assert payloads(network, 0) == [b"best effort"]
    assert [payload for payload in sent if is_data(payload)] == []


def test_a_reliable_message_waits_for_a_route_and_then_arrives(network):
    network.power(2, False)
    network.run_for(5.0)
    ticket = network.send(3, 0, b"late")
    network.run_for(10.0)
    assert ticket.state is not TicketState.DELIVERED
    network.power(2, True)
    network.run_for(30.0)
    assert ticket.state is TicketState.DELIVERED
    assert payloads(network, 0) == [b"late"]


def test_without_a_route_it_is_given_up_at_the_end_of_its_life_with_the_reason(network):
    ticket = network.send(3, 77, b"unreachable")
    network.run_for(LIFETIME_S + 1.0)
    assert str(ticket) == "message 1 to node 77: given up: no route to node 77 for 240 s"


def test_without_a_route_it_looks_for_one_twice_a_second():
    network = Network()
    network.add_router(3, 0.0, 0.0)
    ticks = []
    tick = network.nodes[3].component.tick
    network.nodes[3].component.tick = lambda now_s: (ticks.append(now_s), tick(now_s))
    network.run_for(10.0)
    of_the_mesh = len(ticks)
    network.send(3, 77, b"unreachable")
    network.run_for(10.0)
    assert len(ticks) - of_the_mesh == pytest.approx(of_the_mesh + 20, abs=4)


def test_without_a_route_best_effort_is_given_up_at_once(network):
    ticket = network.send(0, 77, b"unreachable", reliable=False)
    assert (ticket.state, ticket.reason) == (TicketState.GIVEN_UP, "no route to node 77")


@pytest.mark.parametrize(
    ("to", "payload", "port", "why"),
    [
        (256, b"", 0, "invalid destination 256"),
        (-1, b"", 0, "invalid destination -1"),
        (0, b"", 256, "invalid port 256"),
        (0, bytes(1025), 0, "too large: 1025 bytes, at most 1024"),
    ],
)
def test_a_bad_message_is_refused_with_the_reason(network, to, payload, port, why):
    with pytest.raises(MessageRefused, match=why):
        network.send(1, to, payload, port)


def test_a_full_queue_is_an_error_and_has_room_again_later(network):
    for _ in range(MOST_QUEUED):
        network.send(3, 0, bytes(200))
    with pytest.raises(QueueFull, match="64 messages wait"):
        network.send(3, 0, b"one more")
    network.run_for(5.0)
    network.send(3, 0, b"one more")
    network.run_for(1.0)
    assert len(payloads(network, 0)) == MOST_QUEUED + 1


def test_the_figures_say_what_was_sent_received_and_given_up_and_what_waits(network):
    sent_s = network.now_s()
    network.send(3, 0, bytes(200))
    network.power(2, False)
    network.send(3, 0, bytes(24), reliable=False)  # without a route it is given up
    sender = network.nodes[3].component.data
    figures = sender.figures()
    assert (figures.messages_queued, figures.messages_given_up) == (1, 1)
    assert (figures.messages_sent, figures.bytes_sent, figures.sent_s) == (2, 224, sent_s)
    network.power(2, True)
    assert network.run_until(lambda: sender.figures().messages_delivered == 1, 60.0)
    assert sender.figures().messages_queued == 0
    received = network.nodes[0].component.data.figures()
    assert (received.messages_received, received.bytes_received) == (1, 200)
    assert received.received_s > sent_s


def test_after_a_restart_of_the_sender_its_messages_are_not_taken_for_old_ones(network):
    network.send(3, 0, b"before")
    network.run_for(1.0)
    restarted = Network(seed=5)
    restarted.add_gateway(0, 0.0, 0.0)
    restarted.add_router(3, 6.0, 0.0)
    restarted.run_for(20.0)
    heard = []
    restarted.nodes[0].component.on_msg = lambda payload, now_s: heard.append(payload)
    restarted.send(3, 0, b"after")
    restarted.run_for(0.1)
    for payload in filter(is_data, heard):
        network.inject(0, payload)
    assert payloads(network, 0) == [b"before", b"after"]


def test_an_echo_reports_the_hops_and_the_nodes_on_the_route(network):
    answers = []
    assert network.echo(0, 3, answers.append)
    network.run_for(1.0)
    (answer,) = answers
    assert (answer.node, answer.hops, answer.route) == (3, 3, (1, 2))
    assert answer.round_trip_s == pytest.approx(0.012)
    assert not network.echo(0, 77, answers.append)


def test_a_neighbour_counts_as_lost_only_after_nine_lost_packets_of_a_user(network):
    tried = []
    network.nodes[1].antenna.send_message_to = lambda payload: bool(tried.append(payload))
    network.send(1, 0, b"one packet", reliable=False)
    assert len([payload for payload in tried if is_data(payload) and payload[3] == 0]) == 9


def test_users_packets_leave_room_in_the_queue():
    rules = AccessRules.for_cycle(0.002)
    access = MediumAccess(rules, rng=None)
    taken = [access.offer(5, b"%d" % n, 0.0, Priority.DATA) for n in range(rules.queue_length)]
    assert sum(taken) == rules.data_queue_length
    assert access.data_room() == 0
    assert access.offer(5, b"of the mesh", 0.0)


def test_while_the_antenna_has_no_room_the_node_does_not_wake_all_the_time(network):
    network.send(3, 0, bytes(1024))
    network.run_for(0.01)
    node = network.nodes[3]
    node.antenna.data_room = lambda: 0
    ticks = []
    tick = node.component.tick
    node.component.tick = lambda now_s: (ticks.append(now_s), tick(now_s))
    network.run_for(5.0)
    assert len(ticks) <= 5.0 / 0.005 + 10
    del node.antenna.data_room
    network.run_for(5.0)
    assert payloads(network, 0) == [bytes(1024)]
