"""Nodes report to their gateway, which keeps the reports (docs/protocol.md, "Node reports").

Types 66 and 67; both bodies fit into 14 bytes, so that they leave room for a seal. Nothing in the
mesh depends on a report.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IMeshDebugInfo,
    IWirelessCommunication,
)
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import HEADER_BYTES
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import TextAssembly, split
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

STEPS_PER_M = 5  # places are encoded in steps of 0.2 m: 5000 m fit into an int16
UNKNOWN = 255  # in a field of one byte
NO_PLACE = -(2**15)
WORDS_BYTES = 13  # in one packet
_FLYING, _CAN_FLY, _SHARES_ID = 1, 2, 4


@dataclass(frozen=True)
class NodeReport:
    """NODE_REPORT: the state of its creator in figures."""

    TYPE: ClassVar[MessageType] = MessageType.NODE_REPORT
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    neighbours: int
    hops: int  # to its gateway; 255: not known
    next_hop: int  # towards its gateway; 255: none
    place: Location | None  # to 0.2 m; None: not known
    battery_percent: int | None
    flying: bool
    can_fly: bool
    tries: float  # per packet, to 0.1; 0: not known
    shares_id: bool = False  # another radio uses its id

    def packet(self, creator: int, gateway: int) -> bytes:
        steps = [NO_PLACE] * 3
        if self.place is not None:
            steps = [_int16(round(metres * STEPS_PER_M)) for metres in self.place]
        body = self.BODY.pack(
            min(self.neighbours, UNKNOWN),
            self.hops,
            self.next_hop,
            *steps,
            UNKNOWN if self.battery_percent is None else self.battery_percent,
            self.flying * _FLYING | self.can_fly * _CAN_FLY | self.shares_id * _SHARES_ID,
            min(UNKNOWN, round(self.tries * 10)),
        )
        return messages.packet(self.TYPE, creator, creator, gateway, gateway, body)

    @classmethod
    def from_payload(cls, payload: bytes) -> NodeReport:
        """Decode; any bytes are a valid report."""
        body = cls.BODY.unpack_from(payload, HEADER_BYTES)
        neighbours, hops, next_hop, *steps, battery, flags, tries = body
        place = None if NO_PLACE in steps else Location(*(step / STEPS_PER_M for step in steps))
        return cls(
            neighbours,
            hops,
            next_hop,
            place,
            battery if battery <= 100 else None,
            bool(flags & _FLYING),
            bool(flags & _CAN_FLY),
            tries / 10,
            bool(flags & _SHARES_ID),
        )


class NodeWords:
    """NODE_WORDS: a part of why its creator cannot fly: the part byte, and text."""

    TYPE: ClassVar[MessageType] = MessageType.NODE_WORDS
    BODY: ClassVar[struct.Struct] = TYPE.about.layout


NOTHING_REPORTED = NodeReport(0, NO_ROUTE, NO_ROUTE, None, None, False, False, 0.0)


def _int16(number: int) -> int:
    return max(NO_PLACE + 1, min(2**15 - 1, number))


WORDS_AGAIN_REPORTS = 10  # unchanged words are repeated for a new gateway
LOOK_PERIOD_S = 1.0  # how often a node looks whether it flies, and the shortest period of reports


@dataclass(eq=False)
class NodeReporter:
    """Sends the reports of one router: one per period, in flight more. Called by its component."""

    _node: IMeshDebugInfo  # the component itself
    _control: IControlPlane
    _period_s: float  # between two reports; 0: none
    _deadlines: Deadlines
    _antenna: IWirelessCommunication
    _pilot: Pilot
    _engine: IDroneEngine

    def __post_init__(self) -> None:
        self._words = ""  # the last ones sent
        self._words_in = 0  # regular reports until they are repeated
        self._regular_s = -math.inf  # when the next one is due, also if it stands
        self._sent_s = -math.inf
        self._has_moved = False  # since the last one

    def start(self, share: float) -> None:
        """Send the first report after this share of a period, if there is a period."""
        if self._period_s:
            self._regular_s = self._deadlines.now_s + share * self._period_s
            self._deadlines.set(Due.NODE_REPORT, self._regular_s)

    @due(Due.NODE_REPORT)
    def on_due(self) -> None:
        """Send a report if it is time for one, and a gateway is connected."""
        now_s = self._deadlines.now_s
        is_regular = now_s >= self._regular_s
        if is_regular:
            self._regular_s = now_s + self._period_s
        self._deadlines.set(Due.NODE_REPORT, min(self._regular_s, now_s + LOOK_PERIOD_S))
        if not (is_regular or self._is_moving_report_due(now_s)):
            return
        control, me = self._control, self._node.get_node_id()
        gateway = control.gateway
        connected = control.connected and gateway <= MAX_NODE_ID
        if not connected or gateway == me:
            return
        why_not, percent = self._engine.why_not_fly(), self._engine.battery_percent()
        report = NodeReport(
            neighbours=len(control.neighbours.ids()),
            hops=control.hops,
            next_hop=control.routes.get_direction_to_node(gateway),
            place=self._pilot.place(),
            battery_percent=None if percent is None else round(max(0.0, min(100.0, percent))),
            flying=self._pilot.goal is not None,
            can_fly=not why_not,
            tries=self._antenna.channel_use().tries,
            shares_id=self._node.get_shares_id(),
        )
        control.delivery.send_own(report.packet(me, gateway))
        self._sent_s, self._has_moved = now_s, report.flying
        self._words_in -= is_regular
        self._send_words(why_not, me, gateway)

    def _is_moving_report_due(self, now_s: float) -> bool:
        """Whether a drone in flight, or one that has just landed, is to report again.

        A report takes a frame on each hop. It waits where packets collide, and for the messages of
        users. Nobody counts who else flies: within h hops there may be as many as h squared.
        """
        self._has_moved = self._has_moved or self._pilot.goal is not None
        antenna, hops = self._antenna, self._control.hops
        frames = hops * max(1.0, hops / 2)
        period_s = antenna.medium.report_frame_s * frames * (1.0 + antenna.patience())
        is_due = now_s >= self._sent_s + max(LOOK_PERIOD_S, period_s)
        return self._has_moved and is_due and antenna.data_room() > 0

    def _send_words(self, words: str, me: int, gateway: int) -> None:
        if words == self._words and (not words or self._words_in > 0):
            return
        self._words, self._words_in = words, WORDS_AGAIN_REPORTS
        for part in split(words, WORDS_BYTES):
            body = NodeWords.BODY.pack(*part)
            packet = messages.packet(NodeWords.TYPE, me, me, gateway, gateway, body)
            self._control.delivery.send_own(packet)


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

    def __init__(self, deadlines: Deadlines) -> None:
        self._deadlines = deadlines
        self._nodes: dict[int, ReportedNode] = {}
        self._words: dict[int, TextAssembly] = {}

    def nodes(self) -> list[ReportedNode]:
        """All nodes that have reported, by id."""
        return [node for _, node in sorted(self._nodes.items())]

    @receives(MessageType.NODE_REPORT)
    def on_report(self, payload: bytes, creator: int, _from: int) -> None:
        report = NodeReport.from_payload(payload)
        words = "" if report.can_fly else self._known(creator).why_not_fly
        self._put(ReportedNode(creator, report, words, self._deadlines.now_s))

    @receives(MessageType.NODE_WORDS)
    def on_words(self, payload: bytes, creator: int, _from: int) -> None:
        assembly = self._words.setdefault(creator, TextAssembly())
        whole = assembly.add(*NodeWords.BODY.unpack_from(payload, HEADER_BYTES))
        if whole is not None:
            self._put(self._known(creator)._replace(why_not_fly=whole))

    def _known(self, node: int) -> ReportedNode:
        return self._nodes.get(node) or ReportedNode(node, NOTHING_REPORTED, "", -math.inf)

    def _put(self, node: ReportedNode) -> None:
        self._nodes = {**self._nodes, node.node_id: node}
