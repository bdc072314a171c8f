import data_cases
import pytest

from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.inprocess import Network


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_no_message_is_lost_or_comes_twice_or_out_of_order_when_packets_and_a_relay_get_lost(first):
    problems = {seed: data_cases.run_case(seed) for seed in range(first, first + 20)}
    assert {seed: problem for seed, problem in problems.items() if problem} == {}


def test_nor_on_one_channel_that_all_nodes_share():
    problems = {seed: data_cases.run_case(seed, "shared") for seed in range(10)}
    assert {seed: problem for seed, problem in problems.items() if problem} == {}


def test_a_node_that_lost_its_gateway_is_silent_about_messages_until_it_has_one_again():
    network = Network(seed=3, radio="shared")
    network.add_gateway(0, 0.0, 0.0)
    for node in (1, 2, 3):
        network.add_router(node, 6.0 * node, 0.0, why_not_fly="stands on a roof")
    assert network.run_until(network.all_connected, 30.0)
    network.power(1, False)
    assert network.run_until(lambda: not network.connected(3), 60.0)
    plain, ticket = network.send(3, 2, b"once", reliable=False), network.send(3, 2, b"repeated")
    network.run_for(20.0)
    assert [message.payload for message in network.received[2]] == [b"once"]
    assert ticket.reason == "this node looks for a gateway"
    assert plain.state is TicketState.SENT
    network.power(1, True)
    assert network.run_until(lambda: ticket.state is TicketState.DELIVERED, 40.0)
