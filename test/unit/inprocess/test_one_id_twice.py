"""Two radios with one id: both say so, and the later one leaves the earlier one its connection."""

from __future__ import annotations

import math
import random
from unittest.mock import Mock

import pytest

from drone_mesh.communication.node.own_id import OwnId
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.inprocess import Network

KEY = MeshKey(bytes(range(16)))


def start(routing: str, key: MeshKey | None, seed: int = 2) -> tuple[Network, Network]:
    """A mesh with router 2, and another mesh of one drone beside it, to be added."""
    mesh = Network(seed, radio="chips", rate="1M", routing=routing, key=key)
    mesh.add_gateway(0, 0.0, 0.0)
    mesh.add_router(1, 6.0, 0.0)
    mesh.add_router(2, 12.0, 0.0)
    twin = Network(seed + 1, radio=mesh.air, routing=routing, key=key)
    return mesh, twin


@pytest.mark.parametrize(
    ("routing", "key", "seed"),
    [
        ("child_table_tree", None, 2),
        ("beacon", None, 2),
        ("child_table_tree", KEY, 4),
        ("child_table_tree", KEY, 6),
        ("child_table_tree", KEY, 11),
        ("beacon", KEY, 2),
    ],
)
def test_the_later_of_two_radios_with_one_id_gives_way_and_both_name_it(routing, key, seed):
    mesh, twin = start(routing, key, seed)
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    mesh.run_for(11.0)
    twin.add_router(2, 6.0, 5.0, start_s=mesh.now_s())
    earlier, later = mesh.nodes[2].component, twin.nodes[2].component
    assert mesh.run_until(lambda: earlier.get_shares_id() and later.get_shares_id(), within_s=120.0)
    mesh.run_for(2.0)
    for _ in range(8):
        mesh.run_for(5.0)
        assert earlier.get_connected_to_gateway()
        assert not later.get_connected_to_gateway()
    told = [node.id for node in (*mesh.status().nodes, *twin.status().nodes) if node.shares_id]
    assert told == [2, 2]
    mesh.stop()
    twin.stop()


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_a_gateway_gives_way_to_no_other_radio_with_its_id(routing):
    mesh = Network(2, radio="chips", rate="1M", routing=routing)
    mesh.add_gateway(0, 0.0, 0.0)
    mesh.add_router(1, 6.0, 0.0)
    assert mesh.run_until(mesh.all_connected, within_s=30.0)
    twin = Network(3, radio=mesh.air, routing=routing)
    twin.add_gateway(0, 6.0, 5.0, start_s=mesh.now_s())
    for _ in range(60):
        mesh.run_for(1.0)
        assert mesh.nodes[0].antenna.powered
        assert twin.nodes[0].antenna.powered
    assert mesh.nodes[0].component.get_shares_id()
    mesh.stop()
    twin.stop()


def test_whoever_comes_back_after_giving_way_finds_the_id_introduced_again():
    """The other one introduces itself only so often, and apart, but anew when the first is back."""
    control, antenna, deadlines = Mock(), Mock(), Deadlines()
    own_id = OwnId(control, antenna, deadlines, Mock(), random.Random(1), 10.0, math.inf)
    control.says_connected.return_value = False
    for back_s in (11.0, 41.0):
        sent_s = []
        control.introduce.side_effect = lambda sent_s=sent_s: sent_s.append(deadlines.now_s)
        deadlines.now_s = back_s
        for _ in range(4):
            own_id.heard(0, b"")
        while deadlines.next_s < math.inf:
            deadlines.now_s = deadlines.next_s
            own_id.on_due()
            own_id.heard(0, b"")
        assert len(sent_s) == 3
        assert sent_s[0] == back_s
        assert all(0.5 <= later - first <= 1.5 for first, later in zip(sent_s, sent_s[1:]))
    control.says_connected.return_value = True
    own_id.heard(0, b"")
    antenna.switch_power.assert_called_once_with(False)
    assert 41.0 + 30.0 <= deadlines.at_s[Due.OWN_ID] <= deadlines.now_s + 60.0
    deadlines.now_s = deadlines.at_s[Due.OWN_ID]
    own_id.on_due()
    antenna.switch_power.assert_called_with(True)
