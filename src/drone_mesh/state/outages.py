"""Outages: when each node lost its gateway and how each loss was repaired, from the events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Iterable, Sequence

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import EventRecord, MeshStatus

_CONNECTED = MeshEventKind.CONNECTED.value
_DISCONNECTED = MeshEventKind.DISCONNECTED.value
_POWER_OFF = MeshEventKind.POWER_OFF.value
_EMERGENCY = MeshEventKind.EMERGENCY.value
_FLIGHT_DECIDED = MeshEventKind.FLIGHT_DECIDED.value
_LANDED = MeshEventKind.LANDED.value

CAUSE_WITHIN_S = 60.0  # noticed within 30 s (docs/protocol.md, "Requirements")


@dataclass(frozen=True)
class Outage:
    """One node's time without a gateway, in simulated seconds. None: that has not happened."""

    node: int
    lost_s: float  # it noticed that its gateway no longer answers
    cause_s: float | None = None  # the last power-off of another node before that
    cause_node: int | None = None
    emergency_s: float | None = None  # its time without a gateway ran out
    decided_s: float | None = None  # it decided to fly
    fallback: int | None = None  # the node whose position it flew to
    landed_s: float | None = None  # it noticed the landing; can be later than connected_s
    connected_s: float | None = None
    switched_off: bool = False  # the node itself was switched off: nothing to repair

    @property
    def seconds(self) -> float | None:
        """The duration, or None if the outage has not ended."""
        return None if self.connected_s is None else self.connected_s - self.lost_s


def find_outages(events: Iterable[EventRecord]) -> list[Outage]:
    """All periods in which a node was without a gateway, in order of loss.

    A flight by order counts as well: the node is without a gateway until it has landed.
    """
    done: list[Outage] = []
    open_of: dict[int, Outage] = {}
    power_offs: list[tuple[float, int]] = []
    for event in sorted(events, key=lambda event: event.stamp_s):
        node = event.node
        outage = open_of.get(node)
        if event.kind == _POWER_OFF:
            power_offs.append((event.stamp_s, node))
            if outage is not None:
                open_of[node] = replace(outage, switched_off=True)
        elif event.kind == _DISCONNECTED:
            open_of[node] = _new_outage(event, power_offs)
        elif event.kind == _CONNECTED:
            if outage is not None:
                done.append(replace(open_of.pop(node), connected_s=event.stamp_s))
        elif event.kind == _LANDED and (outage is None or outage.decided_s is None):
            _land_afterwards(done, event)
        elif outage is not None:
            open_of[node] = _with_phase(outage, event)
    return sorted([*done, *open_of.values()], key=lambda outage: (outage.lost_s, outage.node))


def _new_outage(event: EventRecord, power_offs: Sequence[tuple[float, int]]) -> Outage:
    for stamp_s, node in reversed(power_offs):
        if event.stamp_s - stamp_s > CAUSE_WITHIN_S:
            break
        if node != event.node:
            return Outage(event.node, event.stamp_s, cause_s=stamp_s, cause_node=node)
        if stamp_s == event.stamp_s:
            return Outage(event.node, event.stamp_s, switched_off=True)
    return Outage(event.node, event.stamp_s)


def _land_afterwards(done: list[Outage], event: EventRecord) -> None:
    """Record a landing after the outage: a drone may be connected before it notices its landing.

    That may cut it off again, for a moment.
    """
    for index in range(len(done) - 1, -1, -1):
        outage = done[index]
        if outage.node == event.node:
            if outage.decided_s is not None and outage.landed_s is None:
                done[index] = replace(outage, landed_s=event.stamp_s)
            return


def _with_phase(outage: Outage, event: EventRecord) -> Outage:
    if event.kind == _EMERGENCY and outage.emergency_s is None:
        return replace(outage, emergency_s=event.stamp_s)
    if event.kind == _FLIGHT_DECIDED:
        fallback = event.peers[0] if event.peers else None
        return replace(outage, decided_s=event.stamp_s, fallback=fallback, landed_s=None)
    if event.kind == _LANDED:
        return replace(outage, landed_s=event.stamp_s)
    return outage


@dataclass(frozen=True)
class MeshSample:
    """The mesh at one moment, in numbers."""

    stamp_s: float
    routers_on: int
    routers_connected: int
    messages: int  # sum over all nodes of packets sent since the start
    mean_hops: float | None  # over connected routers; None when there is none
    most_hops: int | None

    @property
    def connected_share(self) -> float | None:
        """0..1, of the routers that are on; None if no router is on."""
        return self.routers_connected / self.routers_on if self.routers_on else None


def take_sample(mesh: MeshStatus) -> MeshSample:
    routers = [node for node in mesh.nodes if node.role == Role.ROUTER and node.on]
    hops = [node.hops for node in routers if node.connected]
    return MeshSample(
        stamp_s=mesh.stamp_s,
        routers_on=len(routers),
        routers_connected=len(hops),
        messages=sum(node.total_messages for node in mesh.nodes),
        mean_hops=sum(hops) / len(hops) if hops else None,
        most_hops=max(hops, default=None),
    )
