"""RunStory: the events of a run, gathered in one pass over its states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Iterable, Mapping, Sequence

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.errors import MeshError
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.outages import MeshSample, Outage, find_outages, take_sample

BLIP_S = 1.0  # a shorter outage was just the wait for an answer


class NothingRecorded(MeshError):
    """The recording contains no state of a mesh."""


@dataclass(frozen=True)
class RunStory:
    """A run, ready to be drawn and written. All times are simulated seconds."""

    samples: Sequence[MeshSample]
    events: Sequence[EventRecord]
    outages: Sequence[Outage]  # without blips, and without nodes that were switched off themselves
    blips: int  # number of outages shorter than BLIP_S
    before: MeshStatus  # the last state before the first power-off or loss, else the first one
    after: MeshStatus  # the last state
    tracks: Mapping[int, Sequence[tuple[float, float]]]  # x, y in metres, of nodes that moved
    messages_of: Mapping[int, int]  # sent per node during the recording


def tell_story(states: Iterable[MeshStatus], events: Iterable[EventRecord]) -> RunStory:
    """The story of these states and events, oldest first. Raises NothingRecorded without states."""
    records = list(events)
    outages = find_outages(records)
    real = [outage for outage in outages if not outage.switched_off and not _is_blip(outage)]
    first_loss_s = _first_loss_s(records, real)
    samples: list[MeshSample] = []
    tracks: dict[int, list[tuple[float, float]]] = {}
    first = before = after = None
    for mesh in states:
        if after is not None and mesh.stamp_s < after.stamp_s:
            # Simulated time restarted: only the last run counts.
            samples, tracks, first, before = [], {}, None, None
        after = mesh
        if first is None:
            first = before = mesh
        if first_loss_s is not None and mesh.stamp_s <= first_loss_s:
            before, tracks = mesh, {}
        if not samples or mesh.stamp_s > samples[-1].stamp_s:
            samples.append(take_sample(mesh))
        for node in mesh.nodes:
            _follow(tracks, node)
    if first is None or before is None or after is None:  # all, or none
        raise NothingRecorded("no states of a mesh: was /mesh/state recorded?")
    sent_before = {node.id: node.total_messages for node in first.nodes}
    return RunStory(
        samples,
        records,
        real,
        sum(map(_is_blip, outages)),
        before,
        after,
        {node: track for node, track in tracks.items() if len(track) > 1},
        {node.id: node.total_messages - sent_before.get(node.id, 0) for node in after.nodes},
    )


def _is_blip(outage: Outage) -> bool:
    return outage.seconds is not None and outage.seconds < BLIP_S


def _first_loss_s(events: Sequence[EventRecord], outages: Sequence[Outage]) -> float | None:
    for event in events:
        if event.kind == MeshEventKind.POWER_OFF.value:
            return event.stamp_s
    return min((outage.lost_s for outage in outages), default=None)


def _follow(tracks: dict[int, list[tuple[float, float]]], node: NodeStatus) -> None:
    position = (round(node.position[0], 2), round(node.position[1], 2))
    track = tracks.setdefault(node.id, [position])
    if track[-1] != position:
        track.append(position)
