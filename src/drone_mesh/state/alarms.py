"""Alarms: what needs attention, kept until somebody has seen it and it is over."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Iterable, Mapping

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition, condition_of
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus, another_radio

LOW_BATTERY_PERCENT = 20.0
JAMMED = "the radio channel is jammed"
_ORDER_FAILURES = {  # the words of the alarm; the reason follows
    MeshEventKind.ORDER_REFUSED.value: "refused an order",
    MeshEventKind.ORDER_LOST_CONTACT.value: "lost contact during an order",
    MeshEventKind.ORDER_GIVEN_UP.value: "gave up an order",
}
_ORDER_ENDS = (MeshEventKind.ORDER_ARRIVED.value, MeshEventKind.ORDER_ACCEPTED.value)


@dataclass(frozen=True)
class Alarm:
    """One alarm of one node, or of the mesh as a whole."""

    node: int | None  # None: the whole mesh
    text: str  # what is wrong, after the name of the node
    since_s: float  # simulated
    until_s: float = math.inf  # inf: it lasts
    acknowledged: bool = False


class AlarmBook:
    """All alarms of a mesh. Belongs to one thread."""

    def __init__(self) -> None:
        self._alarms: dict[tuple[int | None, str], Alarm] = {}  # by node and text, oldest first
        self._was_connected: set[int] = set()
        self._flew: set[int] = set()  # in the latest state: after a landing they connect anew

    def update(self, mesh: MeshStatus) -> None:
        """Compare with a state of the mesh: alarms begin and end."""
        now: set[tuple[int | None, str]] = set()
        if any(node.jammed for node in mesh.nodes):
            now.add((None, JAMMED))
        switched_off = {node.id for node in mesh.nodes if not node.on and node.battery != 0.0}
        self._was_connected -= switched_off
        for node in mesh.nodes:
            now.update((node.id, text) for text in self._troubles(node))
            if node.connected:
                self._was_connected.add(node.id)
        self._flew = {node.id for node in mesh.nodes if len(node.path)}
        ids = {node.id for node in mesh.nodes}
        for key in now:
            if key not in self._alarms or self._alarms[key].until_s < math.inf:
                self._alarms[key] = Alarm(*key, since_s=mesh.stamp_s)
        for key, alarm in list(self._alarms.items()):
            if key in now or (_of_order(alarm.text) and alarm.node in ids):
                continue
            if alarm.node in switched_off:
                del self._alarms[key]  # whoever did that knows that it has no gateway
            else:
                self._end(key, mesh.stamp_s)

    def on_events(self, events: Iterable[EventRecord]) -> None:
        """Process new events: a failed order is an alarm until a later one succeeds."""
        for event in events:
            if len(event.peers) != 1:
                continue
            drone = event.peers[0]
            if event.kind in _ORDER_FAILURES:
                for key in self._of_orders(drone):
                    del self._alarms[key]
                key = drone, f"{_ORDER_FAILURES[event.kind]}: {event.detail}"
                self._alarms[key] = Alarm(*key, since_s=event.stamp_s)
            elif event.kind in _ORDER_ENDS:
                for key in self._of_orders(drone):
                    self._end(key, event.stamp_s)

    def acknowledge(self, text: str) -> int:
        """Somebody has seen the alarms with this text; returns how many. Those over end."""
        seen = [key for key in self._alarms if key[1] == text]
        for key in seen:
            if self._alarms[key].until_s < math.inf:
                del self._alarms[key]
            else:
                self._alarms[key] = replace(self._alarms[key], acknowledged=True)
        return len(seen)

    def groups(self) -> list[dict[str, Any]]:
        """For pages: nodes with the same alarm together, those that last and are new first.

        An entry without nodes is about the whole mesh.
        """
        found: dict[tuple[bool, bool, bool, str], list[Alarm]] = {}
        for alarm in self._alarms.values():
            is_over, of_node = alarm.until_s < math.inf, alarm.node is not None
            key = alarm.acknowledged, is_over, of_node, alarm.text
            found.setdefault(key, []).append(alarm)
        return [
            {
                "text": text,
                "nodes": sorted(alarm.node for alarm in alarms if alarm.node is not None),
                "since": round(min(alarm.since_s for alarm in alarms), 1),
                "over": over,
                "acknowledged": acknowledged,
            }
            for (acknowledged, over, _of_node, text), alarms in sorted(
                found.items(), key=lambda item: item[0]
            )
        ]

    def saved(self) -> dict[str, Any]:
        """All of it, as plain values that `restore` reads."""
        return {
            "alarms": [
                [node, text, alarm.since_s, _json_time(alarm.until_s), alarm.acknowledged]
                for (node, text), alarm in self._alarms.items()
            ],
            "was_connected": sorted(self._was_connected),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with what `saved` returned."""
        for node, text, since_s, until_s, acknowledged in saved["alarms"]:
            until_s = math.inf if until_s is None else float(until_s)
            node = None if node is None else int(node)
            alarm = Alarm(node, str(text), float(since_s), until_s, bool(acknowledged))
            self._alarms[alarm.node, alarm.text] = alarm
        self._was_connected.update(map(int, saved["was_connected"]))

    def forget(self) -> None:
        """A new run has begun."""
        self._alarms.clear()
        self._was_connected.clear()
        self._flew.clear()

    def _of_orders(self, drone: int) -> list[tuple[int | None, str]]:
        return [key for key in self._alarms if key[0] == drone and _of_order(key[1])]

    def _end(self, key: tuple[int | None, str], now_s: float) -> None:
        alarm = self._alarms[key]
        if alarm.acknowledged:
            del self._alarms[key]
        elif alarm.until_s == math.inf:
            self._alarms[key] = replace(alarm, until_s=now_s)

    def _troubles(self, node: NodeStatus) -> list[str]:
        condition = condition_of(node)
        if condition is Condition.SILENT:
            return ["does not report"]
        found = []
        if node.crashed:
            found.append("crashed")
        if node.shares_id:
            found.append(another_radio(node.id))
        if node.battery <= LOW_BATTERY_PERCENT:  # false if it is not known
            found.append("low battery")
        if node.outside_fence:
            found.append(node.outside_fence)
        is_lost = condition is Condition.DISCONNECTED and node.role == Role.ROUTER
        if is_lost and node.id in self._was_connected - self._flew:
            found.append("lost the gateway")
        return found


def _json_time(time_s: float) -> float | None:
    return time_s if math.isfinite(time_s) else None


def _of_order(text: str) -> bool:
    """Whether an alarm is about an order, and lasts until the next one."""
    return text.startswith(tuple(_ORDER_FAILURES.values()))
