"""What a node remembers of all that strangers invent. (A compiled class hides what it holds.)"""

from __future__ import annotations

import pytest
from proofs.damage import keys_of
from proofs.fuzz import crowd, tables

from drone_mesh.inprocess import Network

MOST_FLOODS = 1024  # messages to all that a node remembers; the other tables are per node id


@pytest.mark.parametrize("keys", [None, keys_of], ids=["without key", "with key"])
def test_no_table_grows_beyond_what_254_invented_nodes_can_fill(keys):
    for held in crowd(2_000, seed=1, key=keys):
        assert held.largest <= MOST_FLOODS


def test_the_tables_of_an_object_are_those_of_all_its_parts():
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    node = network.nodes[0]
    before = tables([node.receiver])
    node.component.complaints.counts.update(f"reason {n}" for n in range(2_000))
    after = tables([node.receiver])
    assert after.largest == 2_000
    assert after.entries == before.entries + 2_000
