"""A relay that forwards heartbeats and drops the rest (docs/security.md)."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from proofs.stranger import Hole
from rig import Rig
from seal_rig import KEY, packet

from drone_mesh.communication.data.outgoing import TO_GATEWAY, TicketState
from drone_mesh.communication.heartbeats.detours import Detours, RelayCheck, Swallowing
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals
from drone_mesh.communication.timing import QUEUED, Deadlines, Medium, MeshTiming
from drone_mesh.inprocess import Network

NOTICED_WITHIN_S = 120.0


def own_keys(node_id):
    return KEY if node_id == 0 else KEY.for_node(node_id)


def swallow(network, node_id):
    network.nodes[node_id].receiver = Hole(network, node_id, [])


def delivered(network, ticket, within_s):
    return network.run_until(lambda: ticket.state is TicketState.DELIVERED, within_s)


@pytest.fixture
def grid():
    """A gateway and eight routers, and node 8 in the corner uses the relay that swallows."""
    network = Network(seed=1, key=own_keys)
    network.add_fleet(1, 8, 3, 6.0)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.run_for(30.0)
    relay = network.path_to_gateway(8)[1]
    assert relay != 0
    swallow(network, relay)
    return network, relay


def test_the_nodes_behind_it_take_another_route_and_their_messages_and_orders_arrive(grid):
    network, relay = grid
    lost = network.send(8, TO_GATEWAY, b"swallowed")
    assert not delivered(network, lost, within_s=10.0)
    assert network.connected(8)
    away = lambda: relay not in network.path_to_gateway(8)  # noqa: E731
    assert network.run_until(away, NOTICED_WITHIN_S)
    assert delivered(network, lost, within_s=10.0)
    assert delivered(network, network.send(0, 8, b"down"), within_s=10.0)
    here = network.location(8)
    network.order(8, here.longitude, here.latitude + 3.0)
    assert network.run_until(lambda: network.location(8).latitude == here.latitude + 3.0, 30.0)


def test_they_do_not_come_back_to_it(grid):
    network, relay = grid
    network.run_for(NOTICED_WITHIN_S)
    for _ in range(30):
        network.run_for(10.0)
        assert relay not in network.path_to_gateway(8)
        assert network.all_connected()


def test_without_another_route_a_node_keeps_its_connection():
    network = Network(seed=1, key=own_keys)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.add_router(2, 12.0, 0.0)
    network.run_for(60.0)
    swallow(network, 1)
    for _ in range(30):
        network.run_for(10.0)
        assert network.connected(2)


def check_of_node_8(now_s=100.0):
    """Two questions to the gateway, through 1, have no answer; the second was sent at 90 s."""
    neighbours = SimpleNamespace(ids=lambda: (1, 2), hops_of=lambda _node: 1)
    detours = Detours(neighbours)
    clock = Deadlines()
    clock.now_s = now_s
    requests = SimpleNamespace(ask=lambda _gateway: True)
    check = RelayCheck(8, True, MeshTiming().check_period_s, True, clock, requests, detours)
    check.swallowing.answered()
    check.swallowing.through(1, hops=2)
    for at_s in (80.0, 90.0):
        check.swallowing.asked(at_s)
    return check, detours


@pytest.mark.parametrize(
    ("now_s", "heartbeat_s", "patience"),
    [(100.0, 89.0, 0.0), (93.0, 91.0, 0.0), (121.0, 91.0, 2.5)],
    ids=[
        "heartbeats are not answered either",
        "the answer may be on its way",
        "on a busy channel, the question may wait in the queue of a relay",
    ],
)
def test_a_relay_is_not_suspected_while(now_s, heartbeat_s, patience):
    check, _detours = check_of_node_8(now_s)
    check.run(0, next_hop=1, hops=2, heartbeat_s=heartbeat_s, patience=patience)
    assert check.take_detour() == NO_ROUTE


def test_on_a_busy_channel_too_a_relay_is_suspected_in_the_end():
    check, _detours = check_of_node_8(now_s=122.0)
    check.run(0, next_hop=1, hops=2, heartbeat_s=91.0, patience=2.5)
    assert check.take_detour() == 2


def test_a_relay_is_not_suspected_for_questions_that_went_through_another_one(caplog):
    check, _detours = check_of_node_8()
    check.run(0, next_hop=2, hops=2, heartbeat_s=91.0, patience=0.0)
    assert (check.take_detour(), caplog.messages) == (NO_ROUTE, [])


class WithKey(IMeshSeals):
    has_key = True


def ask_on_a_shared_channel(is_taken):
    """Router 1 behind relay 2, in a mesh with a key; gateway 0 answers heartbeats only."""
    rig = Rig(medium=Medium(policy=QUEUED, answer_s=1.0), seals=WithKey())
    rig.hear("02 02 03 01 fe 01 01", "00 02 04 01 01 01 00 01", "00 02 01 01 01")
    for _half_second in range(120):
        rig.wait(0.5)
        for sent in rig.sent():
            if sent[2] == 4 and sent[4] == 0:
                rig.hear("00 02 04 01 01 01 00 01")
            elif sent[2] == 2 and sent[4] == 0 and not is_taken:
                rig.mesh.on_undelivered(sent, 18, rig.now_s)


@pytest.mark.parametrize("is_taken", [True, False])
def test_a_question_that_the_relay_did_not_take_says_nothing_about_it(caplog, is_taken):
    ask_on_a_shared_channel(is_taken)
    told = [line for line in caplog.messages if "through node 2, but no other packets" in line]
    assert bool(told) is is_taken


def test_a_question_that_several_neighbours_did_not_take_is_left_out_once():
    check, _detours = check_of_node_8()
    check.swallowing.asked(95.0)
    check.swallowing.not_taken()
    check.swallowing.not_taken()
    assert check.swallowing.noticed(hops=2)


def test_a_relay_that_swallowed_is_tried_again_after_ten_minutes():
    check, detours = check_of_node_8()
    check.run(0, next_hop=1, hops=2, heartbeat_s=91.0, patience=0.0)
    assert check.take_detour() == 2
    assert detours.avoids(1, 699.0)
    assert not detours.avoids(1, 701.0)


def test_no_relay_is_suspected_if_the_gateway_never_reported_its_place():
    swallowing = Swallowing(check_period_s=10.0)
    for check in range(20):
        swallowing.asked(10.0 * check)
    assert not swallowing.noticed(hops=2)


def test_nodes_farther_from_the_gateway_wait_longer():
    near, far = Swallowing(10.0), Swallowing(10.0)
    for swallowing in (near, far):
        swallowing.answered()
        for at_s in (10.0, 20.0):
            swallowing.asked(at_s)
    assert near.noticed(hops=2)
    assert not far.noticed(hops=3)
    far.asked(30.0)
    assert far.noticed(hops=3)


def test_where_a_loss_says_little_three_questions_are_asked_before_a_relay_is_suspected():
    swallowing = Swallowing(10.0, one_loss_counts=False)
    swallowing.answered()
    for at_s, is_noticed in ((10.0, False), (20.0, False), (30.0, True)):
        swallowing.asked(at_s)
        assert swallowing.noticed(hops=2) is is_noticed


def test_a_gateway_that_answers_is_asked_three_times_less_often():
    swallowing = Swallowing(check_period_s=10.0)
    assert swallowing.must_ask(0.0, patience=0.0)
    swallowing.asked(0.0)
    assert swallowing.must_ask(10.0, patience=0.0)
    swallowing.answered()
    assert not swallowing.must_ask(20.0, patience=0.0)
    assert swallowing.must_ask(30.0, patience=0.0)


def test_an_order_goes_where_the_drones_proof_came_from_not_where_claims_in_its_name_come_from():
    network = Network(seed=1, key=own_keys)
    network.add_fleet(1, 8, 3, 6.0)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.run_for(30.0)
    assert network.path_to_gateway(3) == [3, 2, 0]
    swallow(network, 4)
    network.nodes[4].component._antenna.send_message_to(packet("03 04 04 00 00 01 00 01"))
    network.run_for(0.002)
    assert network.nodes[0].component.get_direction_to(3) == 4
    network.order(3, 12.0, 2.0)
    assert network.run_until(lambda: network.location(3).latitude == 2.0, within_s=5.0)
