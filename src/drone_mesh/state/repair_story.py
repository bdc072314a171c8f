"""RepairStory: a repair in sentences, from one state of the mesh to the next.

It reads only states, so it works for a live mesh and for a recording.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Iterable, Sequence

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import REPAIR_STATES, MeshStatus, NodeStatus

# Strategy -> meaning of a bid, its unit, what the highest is, and why it wins. Others only bid.
_BIDS = {
    "thesis": (
        "its distance to the gateway", " m", "is farthest",
        "The farthest from the gateway flies, because the fewest others depend on it",
    ),
    "nearest": (
        "how near it is to that place", "", "is nearest",
        "The nearest flies, because it is there soonest",
    ),
}  # fmt: skip
_ON_ITS_WAY = (
    " It was on the route of {} to the gateway, and is not missed before a heartbeat of theirs "
    "stays without an answer"
)
_NO_BIDS = "", "", "bids most", ""
_ELECTION = (RepairState.ASKING, RepairState.NEGOTIATING, RepairState.WATCHING)


@dataclass(frozen=True)
class StoryStep:
    """One sentence. Times are simulated seconds."""

    at_s: float  # when the step began
    text: str
    until_s: float = math.inf  # the mesh waits until then; inf: it does not wait


class RepairStory:
    """Adds a step for each new development, and rewrites the last step while it continues.

    Belongs to one thread.
    """

    def __init__(self) -> None:
        self.steps: list[StoryStep] = []
        self._key: tuple[object, ...] | None = None  # of the step that lasts
        self._before: dict[int, NodeStatus] = {}
        self._had_gateway: set[int] = set()
        self._lost: set[int] = set()  # since all were last connected
        self._lost_at_s = math.inf
        self._fell_silent: dict[int, float] = {}  # node -> when it was switched off
        self._bids: dict[int, float] = {}
        self._fliers: dict[int, int] = {}  # node -> the node whose position it took
        self._has_taken_off: set[int] = set()

    def add(self, text: str, at_s: float, until_s: float = math.inf) -> None:
        """Add a sentence of the caller."""
        self._key = None
        self.steps.append(StoryStep(at_s, text, until_s))

    def update(self, mesh: MeshStatus) -> None:
        """Advance to this state, which is newer than the last one and no longer changes."""
        nodes = {node.id: node for node in mesh.nodes}
        self._describe_power(nodes, mesh.stamp_s)
        routers = [node for node in nodes.values() if node.on and node.role == Role.ROUTER]
        by_state = {
            state: [node for node in routers if REPAIR_STATES[node.repair_state] is state]
            for state in RepairState
        }
        if by_state[RepairState.FLYING]:
            self._describe_flights(by_state[RepairState.FLYING], mesh)
        elif any(by_state[state] for state in _ELECTION):
            self._describe_bids([n for state in _ELECTION for n in by_state[state]], mesh)
        elif by_state[RepairState.LOST]:
            self._describe_loss(by_state[RepairState.LOST], mesh)
        elif self._lost and all(node.connected for node in routers if node.id in self._lost):
            self._describe_end(mesh)
        elif unnoticed := [n.id for n in by_state[RepairState.AT_REST] if self._has_lost(n)]:
            self._describe_silence(unnoticed, mesh.stamp_s)
        self._had_gateway.update(node.id for node in routers if node.connected)
        self._before = nodes

    @property
    def is_over(self) -> bool:
        return not self._lost

    def _describe_power(self, nodes: dict[int, NodeStatus], now_s: float) -> None:
        off = [n for n, node in nodes.items() if not node.on and self._was(n).on]
        for node_id in off:
            self._fell_silent[node_id] = now_s
            behind = [n.id for n in self._before.values() if node_id in list(n.route)[1:-1]]
            way = _ON_ITS_WAY.format(and_(behind)) if behind else ""
            self.add(f"{self._name(node_id)} is switched off.{way}", now_s)

    def _has_lost(self, node: NodeStatus) -> bool:
        return node.id in self._had_gateway and not node.connected

    def _describe_silence(self, ids: Sequence[int], now_s: float) -> None:
        """Describe nodes whose loss of the gateway no check of theirs has found yet."""
        begins = _each(ids, "It begins", "Each begins")
        text = (
            f"{and_(ids)} {_each(ids, 'has', 'have')} no gateway. {begins} to wait at its periodic "
            "check (every 10 s by default), so that what is lost only for a moment sets nothing in "
            "motion"
        )
        self._last(("silence",), text, now_s)

    def _describe_loss(self, waiting: Sequence[NodeStatus], mesh: MeshStatus) -> None:
        """Describe nodes that wait for another route to a gateway."""
        now_s, ids = mesh.stamp_s, [node.id for node in waiting]
        if not self._lost:
            self._lost_at_s = now_s
        self._lost.update(ids)
        until_s = now_s + min(node.emergency_in for node in waiting)
        text = f"{and_(ids)} lost the gateway: no heartbeat is answered"
        if self._fliers:
            helped = [n.id for n in mesh.nodes if n.id in self._fliers and n.connected]
            text = f"{and_(ids)} still {_each(ids, 'has', 'have')} no gateway"
            text = (
                f"{and_(helped)} {_each(helped, 'is', 'are')} connected; {text}" if helped else text
            )
        waits = _each(ids, "It waits", "Each waits")
        text += f". {waits} for another route before it negotiates: a route costs no flight"
        self._last(("lost", len(self._fliers)), text, now_s, until_s)

    def _describe_bids(self, group: Sequence[NodeStatus], mesh: MeshStatus) -> None:
        now_s = mesh.stamp_s
        if self._key is None or self._key[0] not in ("asking", "bids"):
            self._bids.clear()
        ids = sorted(node.id for node in group)
        self._lost.update(ids)
        ago = f" {now_s - self._lost_at_s:.0f} s ago" if self._lost_at_s < now_s else ""
        lost = f"{and_(ids)} lost the gateway{ago}"
        bidding = [n for n in group if REPAIR_STATES[n.repair_state] is not RepairState.ASKING]
        if not bidding:
            asks = _each(ids, "it asks", "each asks")
            self._last(("asking",), f"{lost}; {asks} its neighbours for their positions", now_s)
            return
        for node in bidding:
            self._bids[node.id] = node.bid
        bids = sorted((n for n in bidding if n.bid >= 0), key=lambda n: (-n.bid, n.id))
        what, unit, _is_best, _because = _BIDS.get(mesh.repair_strategy, _NO_BIDS)
        parts = [lost]
        if bids:
            bids_text = ", ".join(f"{n.id} bids {_bid(n.bid, unit)}" for n in bids)
            meaning = f" (a bid is {what})" if what else ""
            parts.append(
                f"to take the place of {and_({n.place_of for n in bids})}, {bids_text}{meaning}"
            )
        abstain: dict[str, list[int]] = {}
        for node in bidding:
            if node.bid < 0:
                abstain.setdefault(node.repair_reason, []).append(node.id)
        for why, ids in abstain.items():
            parts.append(f"{and_(ids)} {_each(ids, 'does', 'do')} not bid{why and f': {why}'}")
        self._last(("bids", len(self._fliers)), "; ".join(parts), now_s)

    def _describe_flights(self, fliers: Sequence[NodeStatus], mesh: MeshStatus) -> None:
        for node in fliers:
            self._lost.add(node.id)
            self._fliers[node.id] = node.place_of
            self._describe_flight(node, mesh)

    def _describe_flight(self, node: NodeStatus, mesh: MeshStatus) -> None:
        now_s, place = mesh.stamp_s, self._place(node.place_of)
        if len(node.path):
            self._has_taken_off.add(node.id)
        elif node.id in self._has_taken_off:
            text = (
                f"{node.id} has landed at {place}; it checks whether another drone is there, "
                "and introduces itself"
            )
            self._last(("landed", node.id), text, now_s)
            return
        others = sorted(self._lost - {node.id} - set(self._fliers))
        rest = f"; {and_(others)} wait{_each(others, 's', '')} for it" if others else ""
        _what, unit, is_best, because = _BIDS.get(mesh.repair_strategy, _NO_BIDS)
        bids = {n: bid for n, bid in self._bids.items() if bid >= 0}
        if not self._bids:
            why = f"{node.id} has no neighbours left and flies"
        elif list(bids) == [node.id]:
            why = f"only {node.id} bids, so it flies"
        else:
            bid = f" ({_bid(bids[node.id], unit)})" if node.id in bids else ""
            why = f"{node.id} {is_best}{bid} and flies"
        text = f"{why} to {place}{rest}"
        if because and len(bids) > 1:
            text += f". {because}: after its flight it passes on for all of them"
        self._last(("flies", node.id, node.place_of), text, now_s)

    def _describe_end(self, mesh: MeshStatus) -> None:
        now_s = mesh.stamp_s
        text = f"{and_(sorted(self._lost))} {_each(self._lost, 'is', 'are')} connected again"
        silent = [(at_s, node_id) for node_id, at_s in self._fell_silent.items()]
        if silent:
            at_s, node_id = max(silent)
            text += f", {now_s - at_s:.0f} s after node {node_id} fell silent"
        for flier, place_of in self._fliers.items():
            text += f"; {flier} is at {self._place(place_of)}"
        self._last(("over",), text, now_s)
        self._lost.clear()
        self._bids.clear()
        self._fliers.clear()
        self._has_taken_off.clear()
        self._lost_at_s = math.inf
        self._key = None

    def _last(
        self, key: tuple[object, ...], text: str, now_s: float, until_s: float = math.inf
    ) -> None:
        """Add a step, or write the last one anew if it has this key."""
        if key == self._key:
            self.steps[-1] = replace(self.steps[-1], text=text, until_s=until_s)
        else:
            self.add(text, now_s, until_s)
            self._key = key

    def _was(self, node_id: int) -> NodeStatus:
        return self._before.get(node_id, NodeStatus(node_id, on=False))

    def _name(self, node_id: int) -> str:
        is_gateway = self._was(node_id).role == Role.GATEWAY
        return f"{'Gateway' if is_gateway else 'Router'} {node_id}"

    def _place(self, node_id: int) -> str:
        return "the place that it knows" if node_id == NO_ROUTE else f"node {node_id}'s place"


def and_(ids: Iterable[int]) -> str:
    """3 · 3 and 4 · 3, 4 and 5."""
    words = [str(node_id) for node_id in sorted(ids)]
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _bid(bid: float, unit: str) -> str:
    return f"{bid:.1f}{unit}" if unit else f"{bid:.2f}"


def _each(ids: Iterable[int], one: str, several: str) -> str:
    return one if len(list(ids)) == 1 else several
