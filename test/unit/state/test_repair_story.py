"""A repair, described in sentences."""

from __future__ import annotations

import math

from drone_mesh.inprocess import Network
from drone_mesh.state.repair_story import RepairStory, and_

STEP_S = 0.2


def group_behind_a_chain(repair: str = "thesis") -> Network:
    """Layout 202 of config/casus.yaml, connected and settled."""
    network = Network(seed=1, repair=repair)
    network.add_gateway(0, -1.0, 0.0)
    for node_id, (x, y) in enumerate([(-1, 4), (-1, 12), (-1, 18), (3, 15), (-4, 15)], start=1):
        network.add_router(node_id, x, y)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(25.0)
    return network


def story_of(network: Network, off: int, seconds: float) -> RepairStory:
    story = RepairStory()
    story.update(network.status())
    network.power(off, False)
    for _ in range(round(seconds / STEP_S)):
        story.update(network.status())
        network.run_for(STEP_S)
    return story


def test_a_repair_by_the_farthest_drone_is_described_from_the_loss_to_the_reconnection():
    story = story_of(group_behind_a_chain(), off=2, seconds=60.0)
    texts = [step.text for step in story.steps]
    assert texts[0] == (
        "Router 2 is switched off. It was on the route of 3, 4 and 5 to the gateway, and is not "
        "missed before a heartbeat of theirs stays without an answer"
    )
    assert texts[1] == (
        "3, 4 and 5 have no gateway. Each begins to wait at its periodic check (every 10 s by "
        "default), so that what is lost only for a moment sets nothing in motion"
    )
    assert texts[2].startswith("3, 4 and 5 lost the gateway: no heartbeat is answered.")
    assert "3 bids 18.0 m, 4 bids 15.5 m, 5 bids 15.3 m" in texts[3]
    assert "(a bid is its distance to the gateway)" in texts[3]
    assert texts[4].startswith(
        "3 is farthest (18.0 m) and flies to node 2's place; 4 and 5 wait for it. The farthest "
        "from the gateway flies, because the fewest others depend on it"
    )
    assert texts[5].startswith("3 has landed at node 2's place")
    assert texts[-1].startswith("3, 4 and 5 are connected again, ")
    assert story.is_over
    times = [step.at_s for step in story.steps]
    assert times == sorted(times)


def test_while_the_mesh_waits_the_step_says_until_when():
    network = group_behind_a_chain()
    off_s = network.now_s()
    story = story_of(network, off=2, seconds=25.0)
    waiting = story.steps[-1]
    assert off_s + 30.0 < waiting.until_s < off_s + 50.0
    network.run_until(lambda: network.status().nodes[3].repair_state > 1, within_s=30.0)
    assert abs(network.now_s() - waiting.until_s) < 1.0
    story.update(network.status())
    assert story.steps[-1].until_s == math.inf


def test_a_node_that_does_not_bid_is_listed_with_its_reason():
    story = story_of(group_behind_a_chain(), off=1, seconds=60.0)
    texts = [step.text for step in story.steps]
    bids = next(text for text in texts if "bids" in text)
    assert "2 bids 12.0 m" in bids
    assert "3, 4 and 5 do not bid: the place of 2 is occupied by 2" in bids
    assert "only 2 bids, so it flies to node 1's place; 3, 4 and 5 wait for it" in texts


def test_another_strategy_is_described_in_its_own_terms():
    story = story_of(group_behind_a_chain("nearest"), off=2, seconds=60.0)
    assert any("5 is nearest (1.19) and flies" in step.text for step in story.steps)


def test_a_mesh_that_waits_for_ever_stays_at_its_step():
    story = story_of(group_behind_a_chain("stay"), off=2, seconds=120.0)
    assert len(story.steps) == 3
    assert not story.is_over


def test_a_drone_without_neighbours_flies_without_a_negotiation():
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    for node_id in (1, 2):
        network.add_router(node_id, 6.0 * node_id, 0.0)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(25.0)
    story = story_of(network, off=1, seconds=70.0)
    assert "2 has no neighbours left and flies to node 1's place" in [s.text for s in story.steps]
    assert story.steps[-1].text.startswith("2 is connected again")


def test_ids_are_listed_as_in_a_sentence():
    assert [and_(ids) for ids in ([3], [4, 3], [5, 3, 4])] == ["3", "3 and 4", "3, 4 and 5"]
