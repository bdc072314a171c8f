"""The sentences shown while a mesh repairs itself: layout 202, router 1 switched off."""

from __future__ import annotations

import re

import pytest
from scenarios import layout

from drone_mesh.view.table import mesh_table

STEP_S = 0.1


@pytest.fixture(scope="module")
def sentences():
    """For each node the sentences that it had, in order; the seconds of a wait left out."""
    network = layout(202)
    network.run_for(20.0)
    network.power(1, False)
    said = {node: [""] for node in network.nodes}
    for _step in range(1300):
        network.run_for(STEP_S)
        for node in network.status().nodes:
            sentence = re.sub(r"waits \d+ s", "waits", node.repair)
            if sentence != said[node.id][-1]:
                said[node.id].append(sentence)
    assert network.all_connected(network.nodes.keys() - {1})
    return said


def test_the_drone_that_flies_first_shows_each_phase_of_its_repair(sentences):
    assert sentences[2] == [
        "",
        "has no gateway; its periodic check begins the wait for one",
        "waits for a gateway",
        "negotiating, bids 12.0 m for the place of 1",
        "flies to the place of 1",
        "has landed, checks that no other drone is there",
        "",
    ]


def test_the_one_behind_it_shows_why_it_does_not_fly_and_then_flies_as_well(sentences):
    assert sentences[3] == [
        "",
        "has no gateway; its periodic check begins the wait for one",
        "waits for a gateway",
        "negotiating, does not bid: the place of 2 is occupied by 2",
        "does not fly: 2 flies instead",
        "waits for a gateway; does not fly: 2 flies instead",
        "negotiating, bids 18.0 m for the place of 2",
        "flies to the place of 2",
        "has landed, checks that no other drone is there",
        "",
    ]


def test_a_drone_that_loses_the_election_names_the_one_that_flies(sentences):
    assert sentences[4][-3:] == [
        "negotiating, bids 15.5 m for the place of 2",
        "does not fly: 3 flies instead",
        "",
    ]


def test_a_gateway_and_a_drone_that_is_switched_off_have_nothing_to_say(sentences):
    assert sentences[0] == sentences[1] == [""]


def test_the_wait_counts_down_and_the_table_shows_it():
    network = layout(202)
    network.run_for(20.0)
    network.power(1, False)
    network.run_for(15.0)
    waits = []
    for _second in range(3):
        network.run_for(1.0)
        row = mesh_table(network.status(), colours=False).splitlines()[6]
        assert row.startswith("4 "), row
        waits.append(int(re.search(r"gateway; waits (\d+) s for a gateway$", row)[1]))
    assert waits == [waits[0], waits[0] - 1, waits[0] - 2]
    assert 0 < waits[2] < waits[0] <= 30
