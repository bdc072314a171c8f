"""Events on their way from the mesh software to views: batched, in bounded memory."""

from __future__ import annotations

from collections import deque

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.state.model import EventRecord

_SEVERAL_AT_ONCE = (
    MeshEventKind.NEIGHBOUR_FOUND,
    MeshEventKind.NEIGHBOUR_LOST,
    MeshEventKind.NODE_MISSING,
)
EVENTS_KEPT = 100_000  # twice what 254 nodes that find 200 neighbours each produce


class EventBatcher:
    """Accepts events from any thread; one thread takes them out in batches.

    When many nodes meet, they produce tens of thousands of events within a second. Consecutive
    events about neighbours that one node found (or lost, or misses) therefore become one event with
    many peers.
    """

    def __init__(self) -> None:
        self._waiting: deque[MeshEvent] = deque(maxlen=EVENTS_KEPT)  # append and popleft are atomic

    def observe(self, event: MeshEvent) -> None:
        """A MeshObserver. Beyond EVENTS_KEPT the oldest events are dropped."""
        self._waiting.append(event)

    def drain(self) -> list[EventRecord]:
        """All events since the last call, oldest first."""
        batch: list[tuple[MeshEvent, list[int]]] = []  # each with all its peers
        latest_of: dict[int, tuple[MeshEvent, list[int]]] = {}
        for _ in range(len(self._waiting)):
            event = self._waiting.popleft()
            peers = [] if event.peer == NO_ROUTE else [event.peer]
            latest, known = latest_of.get(event.node, (None, []))
            if latest is not None and latest.kind is event.kind and event.kind in _SEVERAL_AT_ONCE:
                known += [peer for peer in peers if peer not in known]
            else:
                latest_of[event.node] = event, peers
                batch.append((event, peers))
        return [
            EventRecord(
                event.now_s,
                event.node,
                event.kind.value,
                tuple(peers),
                event.detail,
                event.order,
                event.place,
            )
            for event, peers in batch
        ]
