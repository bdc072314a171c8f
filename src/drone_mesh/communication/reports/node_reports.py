"""Nodes report to their gateway, which keeps the reports.

docs/protocol.md, "Node reports".
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drone_mesh.communication.control.parts import NodeParts
from drone_mesh.communication.interfaces import MAX_NODE_ID, IMeshDebugInfo
from drone_mesh.communication.reports.node_report import (
    NOTHING_REPORTED,
    NodeReport,
    NodeWords,
)
from drone_mesh.communication.timing.deadlines import Due
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import TextAssembly

WORDS_AGAIN_REPORTS = 10  # unchanged words are repeated for a new gateway


class NodeReporter:
    """Sends the reports of one router, at most one per period. Called only by its component."""

    def __init__(self, parts: NodeParts, mesh: IMeshDebugInfo) -> None:
        """`mesh` is the component itself."""
        self._parts = parts
        self._mesh = mesh
        self._words = ""  # the last ones sent
        self._words_in = 0  # reports until they are repeated

    def start(self, share: float) -> None:
        """Send the first report after this share of a period, if there is a period."""
        period_s = self._parts.timing.report_period_s
        if period_s:
            self._parts.deadlines.set(Due.NODE_REPORT, self._parts.now_s + share * period_s)

    def on_due(self) -> None:
        """Send a report if a gateway is connected."""
        parts, mesh = self._parts, self._mesh
        parts.deadlines.set(Due.NODE_REPORT, parts.now_s + parts.timing.report_period_s)
        gateway = mesh.get_preferred_gateway()
        connected = mesh.get_connected_to_gateway() and gateway <= MAX_NODE_ID
        if not connected or gateway == parts.node_id:
            return
        why_not, percent = parts.engine.why_not_fly(), parts.engine.battery_percent()
        report = NodeReport(
            neighbours=len(parts.neighbours.ids()),
            hops=mesh.get_hops_from_gateway_away(),
            next_hop=parts.routing.get_direction_to_node(gateway),
            place=parts.pilot.place(),
            battery_percent=None if percent is None else round(max(0.0, min(100.0, percent))),
            flying=parts.pilot.goal is not None,
            can_fly=not why_not,
            tries=parts.antenna.channel_use().tries,
            shares_id=mesh.get_shares_id(),
        )
        parts.delivery.send_own(report.packet(parts.node_id, gateway))
        self._send_words(why_not, gateway)

    def _send_words(self, words: str, gateway: int) -> None:
        self._words_in -= 1
        if words == self._words and (not words or self._words_in > 0):
            return
        self._words, self._words_in = words, WORDS_AGAIN_REPORTS
        for packet in NodeWords.packets(words, self._parts.node_id, gateway):
            self._parts.delivery.send_own(packet)


class ReportedNode(NamedTuple):
    """What another node reported to its gateway."""

    node_id: int
    report: NodeReport
    why_not_fly: str
    heard_s: float  # when the report came, in seconds of the core's clock


class ReportBook:
    """The latest report of each node. Only the component of its gateway writes; any thread reads.

    `_nodes` is never modified, only replaced.
    """

    def __init__(self) -> None:
        self._nodes: dict[int, ReportedNode] = {}
        self._words: dict[int, TextAssembly] = {}

    def nodes(self) -> list[ReportedNode]:
        """All nodes that have reported, by id."""
        return [node for _, node in sorted(self._nodes.items())]

    def on_packet(self, creator: int, kind: int, payload: bytes, now_s: float) -> None:
        """A NODE_REPORT or NODE_WORDS arrived."""
        known = self._nodes.get(creator)
        known = known or ReportedNode(creator, NOTHING_REPORTED, "", -math.inf)
        if kind == MessageType.NODE_REPORT:
            report = NodeReport.from_payload(payload)
            words = "" if report.can_fly else known.why_not_fly
            self._put(ReportedNode(creator, report, words, now_s))
            return
        assembly = self._words.setdefault(creator, TextAssembly())
        whole = assembly.add(*NodeWords.part_in(payload))
        if whole is not None:
            self._put(known._replace(why_not_fly=whole))

    def _put(self, node: ReportedNode) -> None:
        self._nodes = {**self._nodes, node.node_id: node}
