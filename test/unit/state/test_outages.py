"""The story of losses and repairs, derived from events."""

from __future__ import annotations

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.outages import find_outages, take_sample


def story(*events: tuple[float, int, str] | tuple[float, int, str, int]) -> list[EventRecord]:
    return [EventRecord(s, node, kind, tuple(peers)) for s, node, kind, *peers in events]


REPAIR = story(
    (1.0, 2, "connected", 0),
    (1.1, 3, "connected", 0),
    (100.0, 2, "power off"),
    (100.0, 2, "disconnected", 0),
    (103.0, 3, "disconnected", 0),
    (140.0, 3, "emergency"),
    (141.0, 3, "negotiation started"),
    (150.0, 3, "flight decided", 2),
    (153.0, 3, "landed"),
    (153.5, 3, "connected", 0),
)


def test_a_repair_has_its_phases():
    switched_off, repair = find_outages(REPAIR)
    assert switched_off.node == 2
    assert switched_off.switched_off
    assert repair.node == 3
    assert (repair.cause_s, repair.cause_node) == (100.0, 2)
    assert (repair.lost_s, repair.emergency_s) == (103.0, 140.0)
    assert (repair.decided_s, repair.fallback, repair.landed_s) == (150.0, 2, 153.0)
    assert repair.connected_s == 153.5
    assert repair.seconds == 50.5


def test_a_drone_may_be_connected_before_it_notices_that_it_has_landed():
    late = [*REPAIR[:-2], *story((153.5, 3, "connected", 0), (154.0, 3, "landed"))]
    *_, repair = find_outages(late)
    assert (repair.landed_s, repair.connected_s) == (154.0, 153.5)


def test_a_drone_that_connects_in_flight_may_be_cut_off_for_a_moment_as_it_lands():
    landing = story(
        (152.0, 3, "connected", 0),
        (153.0, 3, "disconnected", 0),
        (153.0, 3, "landed"),
        (153.1, 3, "connected", 0),
    )
    *_, repair, moment = find_outages([*REPAIR[:-2], *landing])
    assert (repair.decided_s, repair.connected_s, repair.landed_s) == (150.0, 152.0, 153.0)
    assert (moment.lost_s, moment.decided_s, moment.landed_s) == (153.0, None, None)


def test_a_landing_long_after_the_repair_does_not_belong_to_it():
    *_, repair = find_outages([*REPAIR, *story((300.0, 3, "landed"))])
    assert repair.landed_s == 153.0


def test_a_loss_that_lasts_stays_open():
    *_, repair = find_outages(REPAIR[:6])
    assert repair.connected_s is None
    assert repair.seconds is None


def test_a_recording_may_begin_when_all_nodes_are_connected_already():
    *_, repair = find_outages(REPAIR[2:])
    assert (repair.node, repair.lost_s, repair.connected_s) == (3, 103.0, 153.5)


def test_a_loss_without_a_power_off_has_no_cause():
    (outage,) = find_outages(story((1.0, 1, "connected", 0), (9.0, 1, "disconnected", 0)))
    assert outage.cause_s is None
    assert outage.cause_node is None


def test_a_power_off_long_ago_is_not_a_cause():
    (outage,) = find_outages(story((1.0, 2, "power off"), (90.0, 1, "disconnected", 0)))
    assert outage.cause_node is None


def test_a_node_that_was_lost_and_then_switched_off_is_not_to_be_repaired():
    (outage,) = find_outages(
        story((1.0, 1, "connected", 0), (9.0, 1, "disconnected", 0), (12.0, 1, "power off"))
    )
    assert outage.switched_off


def test_events_may_come_in_any_order():
    assert find_outages(reversed(REPAIR)) == find_outages(REPAIR)


def test_a_sample_counts_routers_that_are_on():
    mesh = MeshStatus(
        7.0,
        [
            NodeStatus(0, Role.GATEWAY, connected=True, hops=0, total_messages=10),
            NodeStatus(1, connected=True, hops=1, total_messages=5),
            NodeStatus(2, connected=True, hops=4),
            NodeStatus(3, connected=False),
            NodeStatus(4, on=False),
        ],
    )
    sample = take_sample(mesh)
    assert (sample.routers_on, sample.routers_connected, sample.messages) == (3, 2, 15)
    assert (sample.mean_hops, sample.most_hops) == (2.5, 4)
    assert sample.connected_share == 2 / 3


def test_of_no_routers_there_is_no_connected_share():
    sample = take_sample(MeshStatus(1.0, [NodeStatus(1, on=False, hops=3)]))
    assert (sample.connected_share, sample.mean_hops, sample.most_hops) == (None, None, None)
