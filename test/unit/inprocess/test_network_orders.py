"""Orders in a mesh: what their gateway knows in the end is what the drone did."""

from __future__ import annotations

import pytest
from scenarios import line as in_line

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.seals.keys import KEY_BYTES, MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.inprocess import Network


def line(seed=3, **settings):
    """Gateway 0 and the routers 1..4, 6 m apart, connected."""
    network = in_line(3, seed=seed, **settings)
    network.add_router(4, 24.0, 0.0, why_not_fly="it stands on the ground")
    assert network.run_until(network.all_connected, within_s=30.0)
    return network


def ends(network):
    """Drone, state and reason of each order."""
    orders = network.nodes[0].component.get_orders()
    return [(order.drone, order.state.value, order.reason) for order in orders]


@pytest.mark.parametrize(
    "medium", [{}, {"radio": "shared"}, {"key": MeshKey(bytes(range(KEY_BYTES)))}]
)
def test_replies_and_reports_come_from_four_hops_away_also_on_a_shared_channel_and_sealed(medium):
    network = line(timing=MeshTiming(report_period_s=30.0), **medium)
    assert network.order(3, 18.0, 6.0)
    assert network.order(4, 24.0, 1.0)
    network.run_for(40.0)
    assert ends(network) == [
        (3, "arrived", ""),
        (4, "refused", "drone 4 cannot fly: it stands on the ground"),
    ]
    four = network.nodes[0].component.get_node_reports()[-1]
    assert (four.node_id, four.report.hops, four.report.place) == (4, 4, (0.0, 24.0, 0.0))
    assert four.why_not_fly == "it stands on the ground"


def test_contact_with_a_drone_that_flew_out_of_reach_is_lost():
    network = line()
    assert network.order(3, 400.0, 400.0)
    network.run_for(30.0 + 21 * 15.0)
    assert ends(network) == [(3, "lost contact", "at 0 s: it fell silent on its way")]


def test_a_relay_that_dies_under_an_order_ends_it_without_a_route_after_three_searches():
    network = line()
    network.power(2, False)
    assert network.order(3, 18.0, 3.0)  # relay 1 took it
    network.run_for(2.9)
    assert ends(network) == [(3, "sent", "")]
    network.run_for(0.2)
    assert ends(network) == [(3, "no route", "")]


def test_on_a_lossy_medium_each_order_is_flown_once_and_its_end_is_known():
    states = []
    for seed in range(12):
        network = in_line(2, spacing=5.0, seed=seed, loss=0.35, timing=MeshTiming(send_attempts=2))
        flown = {1: [], 2: []}
        for node_id, goals in flown.items():
            drone = network.nodes[node_id].drone
            fly = drone.set_goal
            drone.set_goal = lambda *goal, fly=fly, goals=goals: (goals.append(goal), fly(*goal))
        assert network.run_until(network.all_connected, within_s=60.0)
        for node_id in flown:
            network.order(node_id, 5.0 * node_id, 2.0)
        network.run_for(400.0)
        for drone, state, _reason in ends(network):
            states.append(state)
            ordered = [goal for goal in flown[drone] if goal == (2.0, 5.0 * drone, 0.0)]
            assert len(ordered) <= 1
            assert ordered or state != "arrived"
    assert set(states) <= {"arrived", "no route", "lost contact", "given up"}
    assert states.count("arrived") >= 12


def test_a_drone_whose_goal_is_inside_an_obstacle_refuses_and_stays():
    network = line()
    box = Obstacles([Box((18.0, 9.0, 3.0), (4.0, 4.0, 6.0))])
    network.nodes[3].drone.plan_flight = box.plan_flight
    assert network.order(3, 18.0, 9.0)
    network.run_for(0.5)
    ((drone, state, reason),) = ends(network)
    assert (drone, state) == (3, "refused")
    assert "no path past the obstacles" in reason
    assert network.nodes[3].drone.path is None


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_with_a_key_a_restarted_router_is_believed_again(routing, seed):
    """It does not know which sequence numbers it has used."""
    timing = MeshTiming(report_period_s=30.0)
    key = MeshKey(bytes(range(KEY_BYTES)))
    network = line(seed=seed, routing=routing, key=key, timing=timing)
    network.run_for(100.0)
    network.restart(3)
    restarted_s = network.now_s()
    network.run_for(180.0)
    gateway = network.nodes[0].component
    reported_s = {one.node_id: one.heard_s for one in gateway.get_node_reports()}
    assert reported_s[3] > restarted_s
    assert network.order(3, 18.0, 2.0)
    network.run_for(30.0)
    assert gateway.get_orders()[0].state is OrderState.ARRIVED


@pytest.mark.parametrize("routing", ["child_table_tree", "steady_tree", "beacon"])
def test_with_a_key_a_gateway_goes_on_believing_the_relays_of_others(routing):
    """A relay learns from the gateway's answers to others that it is connected, and no nonce."""
    network = Network(
        seed=0,
        routing=routing,
        radio="shared",
        rate="250k",
        key=MeshKey(bytes(range(KEY_BYTES))),
        timing=MeshTiming(report_period_s=30.0),
    )
    network.add_fleet(gateways=1, routers=15, gridsize=4, spacing=6.0)
    network.run_for(60.0)
    for _ in range(10):
        network.run_for(60.0)
        reports = network.nodes[0].component.get_node_reports()
        late = [one.node_id for one in reports if network.now_s() - one.heard_s > 65.0]
        assert (len(reports), late) == (15, [])
