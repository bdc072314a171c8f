"""The status of an in-process network, for tables, pictures and reports."""

import pytest
from scenarios import line as in_line

from drone_mesh.drone.roles import Role
from drone_mesh.state.outages import find_outages, take_sample
from drone_mesh.view.table import mesh_table


@pytest.fixture
def line():
    """Gateway 0, then routers 1, 2, 3, each in reach of its two neighbours only."""
    network = in_line(3, seed=3)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(1.0)
    return network


def test_the_status_has_the_links_and_the_routes_of_packets(line):
    status = line.status()
    assert [node.role for node in status.nodes] == [Role.GATEWAY] + [Role.ROUTER] * 3
    assert [bytes(node.neighbours) for node in status.nodes] == [b"\1", b"\0\2", b"\1\3", b"\2"]
    assert [bytes(node.route) for node in status.nodes] == [b"\0", b"\1\0", b"\2\1\0", b"\3\2\1\0"]
    assert [tuple(node.position) for node in status.nodes] == [(6.0 * n, 0, 0) for n in range(4)]
    assert status.stamp_s == line.clock.now_s
    assert take_sample(status).connected_share == 1.0
    assert "3 > 2 > 1 > 0" in mesh_table(status, colours=False)


def test_a_status_stays_as_it_was(line):
    before = line.status()
    line.power(1, on=False)
    line.run_for(20.0)
    after = line.status()
    assert [node.on for node in before.nodes] == [True] * 4
    assert [node.on for node in after.nodes] == [True, False, True, True]
    assert [node.connected for node in before.nodes] == [True] * 4
    assert [node.connected for node in after.nodes] == [True, False, False, False]


def test_a_drone_in_flight_has_the_rest_of_its_path(line):
    assert line.order(3, x=12.0, y=6.0)
    line.run_for(0.5)
    (flying,) = [node for node in line.status().nodes if len(node.path)]
    assert flying.id == 3
    assert tuple(flying.path[-3:]) == (12.0, 6.0, 0.0)
    assert flying.position[2] > 0.0
    line.run_for(30.0)
    assert [len(node.path) for node in line.status().nodes] == [0] * 4


def test_the_story_of_the_run_names_each_lost_node_and_its_return(line):
    cut_s = line.clock.now_s
    line.power(2, on=False)
    line.run_for(15.0)
    line.power(2, on=True)
    assert line.run_until(line.all_connected, within_s=30.0)
    outage = [found for found in find_outages(line.event_records()) if found.node == 3][-1]
    assert outage.cause_node == 2
    assert outage.cause_s == pytest.approx(cut_s)
    assert cut_s < outage.lost_s < outage.connected_s <= line.clock.now_s
