"""Gathering events."""

from __future__ import annotations

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.state.observation import EventBatcher

FOUND, LOST = MeshEventKind.NEIGHBOUR_FOUND, MeshEventKind.NEIGHBOUR_LOST


def batch(*events: MeshEvent) -> list[tuple[int, str, tuple[int, ...]]]:
    batcher = EventBatcher()
    for event in events:
        batcher.observe(event)
    return [(event.node, event.kind, event.peers) for event in batcher.drain()]


def test_neighbours_found_one_after_the_other_are_one_event():
    assert batch(
        MeshEvent(FOUND, 1, 0.0, 5), MeshEvent(FOUND, 2, 0.0, 5), MeshEvent(FOUND, 1, 0.1, 6)
    ) == [(1, "neighbour found", (5, 6)), (2, "neighbour found", (5,))]


def test_found_lost_and_found_again_stays_in_order():
    assert batch(
        MeshEvent(FOUND, 1, 0.0, 5), MeshEvent(LOST, 1, 0.1, 5), MeshEvent(FOUND, 1, 0.2, 5)
    ) == [
        (1, "neighbour found", (5,)),
        (1, "neighbour lost", (5,)),
        (1, "neighbour found", (5,)),
    ]


def test_other_events_stay_apart():
    connected = MeshEvent(MeshEventKind.CONNECTED, 1, 0.0, 0)
    assert batch(connected, connected) == [(1, "connected", (0,)), (1, "connected", (0,))]


def test_an_event_without_another_node_has_no_peers():
    assert batch(MeshEvent(MeshEventKind.LANDED, 4, 0.0)) == [(4, "landed", ())]


def test_each_event_is_taken_once():
    batcher = EventBatcher()
    batcher.observe(MeshEvent(MeshEventKind.LANDED, 4, 12.5, detail="soft"))
    (event,) = batcher.drain()
    assert (event.stamp_s, event.detail) == (12.5, "soft")
    assert batcher.drain() == []
