"""The packet types of the mesh: one declaration per type (docs/wire.md, "Packets").

Everything that differs by type follows from here: the checks of a component, the kinds that pages
show, the counters of the lab and, through `scripts/packet_tables`, the table in docs/wire.md and
the Wireshark dissector.
"""

from __future__ import annotations

import enum
import struct
from typing import NamedTuple

TECHNIQUE_TYPES = range(8, 64)
DATA_TYPES = range(128, 256)  # users' data; data/packets.py describes their bodies
_CODES = {"bool": "?", "uint8": "B", "int16": "h", "uint16": "H", "uint32": "I", "float32": "f"}


class PacketKind(enum.Enum):
    """The subject of a packet, as a legend shows it."""

    HEARTBEAT = "heartbeat"
    INTRODUCTION = "introduction"
    POSITION = "position"
    REPAIR = "repair"  # a node is missing, or a bid to fly
    ORDER = "order"  # to fly, and the answers to it
    REPORT = "report"  # of a node to the gateway
    DATA = "data"  # of users
    OTHER = "other"  # of a routing technique, of keys, or of unknown type


class Priority(enum.IntEnum):
    """Which packets an antenna sends first."""

    CONTROL = 0  # packets of the mesh itself
    DATA = 1


class Handler(enum.Enum):
    """Who handles a packet when it has arrived; the values are words of docs/wire.md."""

    NODE = "every node"
    ROUTER = "a router"  # a gateway ignores it
    GATEWAY = "a gateway"
    SEAL = "the seals"  # without a key, a node at most reports that a neighbour has one
    CONTROL = "the control plane"
    TECHNIQUE = "the routing technique"
    USERS = "the users' data service"
    NOBODY = "no node"


class PacketType(NamedTuple):
    """What is declared about a type."""

    kind: PacketKind
    handler: Handler
    body: str = ""  # its fields in their order, as "uint8 name" or "bytes[10] name"
    made_of: str = "Message"  # the class that encodes it
    priority: Priority = Priority.CONTROL
    answered: bool = True  # whether a broadcast of it makes several nodes send
    jittered: bool = True  # whether many nodes would send it at the same moment
    once: bool = False  # whether its sender begins anew when it is lost, so the radio need not

    @property
    def layout(self) -> struct.Struct:
        """Packs and unpacks the body."""
        forms = [field.split()[0] for field in self.body.split(", ")]
        # a number, or bytes[10]
        return struct.Struct("<" + "".join(_CODES.get(form) or f"{form[6:-1]}s" for form in forms))

    @property
    def floats(self) -> struct.Struct | None:
        """Unpacks the floats of the body. A packet with one that is not finite is bad."""
        if "float32" not in self.body:
            return None
        forms = [_CODES[field.split()[0]] for field in self.body.split(", ")]
        return struct.Struct(
            "<" + "".join(f if f == "f" else f"{struct.calcsize(f)}x" for f in forms)
        )

    @property
    def has_place(self) -> bool:
        """Whether it carries a place, in the coordinates of its creator (see frames)."""
        return " latitude" in self.body


_UNKNOWN = PacketType(PacketKind.OTHER, Handler.NOBODY)
_TECHNIQUE = PacketType(PacketKind.OTHER, Handler.TECHNIQUE)
_DATA = PacketType(PacketKind.DATA, Handler.USERS, priority=Priority.DATA)
_NODE, _ROUTER, _GATEWAY, _SEAL = Handler.NODE, Handler.ROUTER, Handler.GATEWAY, Handler.SEAL
_CONTROL = Handler.CONTROL
# Bodies that fill a line
_PLACE = "float32 latitude, float32 longitude, int16 height"
_LOCATION = f"{_PLACE}, uint32 timeSincePosix"
_PRESENT = "uint8 hopsUntilGateway, bool knowGateway"
_HEARTBEAT = "bool knowGateway, uint8 preferredGateway, uint8 hops"
_REPLY = "uint16 order, uint8 outcome, uint8 part, bytes[10] text"
_REPORT = (
    "uint8 neighbours, uint8 hopsUntilGateway, uint8 nextHop, int16 latitudeSteps, "
    "int16 longitudeSteps, int16 heightSteps, uint8 battery, uint8 flags, uint8 tries"
)
_BEACON = (
    "uint8 flags, uint8 interval, uint8 gateway, uint8 number, uint8 hops, uint8 parent, "
    "bytes[3] ancestors"
)
_SEARCH = "uint8 node, uint16 number, uint8 hopsLeft"
_WORDS = "uint8 part, bytes[13] text"
_LAST_PLACE = f"uint16 age, uint8 node, {_PLACE}"
_GATEWAY_PLACE = f"uint16 agePlusOne, uint8 gateway, {_PLACE}"


class MessageType(enum.IntEnum):
    """Byte 2, with what is declared about it. See also the three ranges above."""

    about: PacketType

    def __new__(cls, number: int, about: PacketType = _UNKNOWN) -> MessageType:
        member = int.__new__(cls, number)
        member._value_ = number
        member.about = about
        return member

    NOTDEFINED = 0, _UNKNOWN
    # The position of its creator, and the question for it
    LOCATION = 1, PacketType(PacketKind.POSITION, _NODE, _LOCATION, "LocationMessage")
    REQUESTLOCATION = 2, PacketType(PacketKind.POSITION, _NODE)
    # Introduces its creator to every node in range
    PRESENT = (
        3,
        PacketType(PacketKind.INTRODUCTION, _CONTROL, _PRESENT, "IntroduceMessage", once=True),
    )
    # Proof of a path; counts its hops
    HEARTBEAT = 4, PacketType(PacketKind.HEARTBEAT, _CONTROL, _HEARTBEAT, "HeartbeatMessage")
    # Its creator can no longer reach a node
    MISSING = 5, PacketType(PacketKind.REPAIR, _CONTROL, "uint8 missing", "MissingMessage")
    # An order to fly
    MOVE_TO_LOCATION = 6, PacketType(PacketKind.ORDER, _NODE, _PLACE, "GoToLocationMessage")
    # The bid of its creator to fly
    MOVEMENT_NEGOTIATION = (
        7,
        PacketType(PacketKind.REPAIR, _ROUTER, "float32 cost", "MovementNegotiationMessage"),
    )
    # The technique beacon: how a node stands to its gateway, neighbours and the nodes below it
    BEACON = (
        40,
        PacketType(
            PacketKind.INTRODUCTION, _CONTROL, _BEACON, "Beacon", answered=False, jittered=False
        ),
    )
    # It looks for a node, which answers; a question for a sign of life
    SEARCH = 41, PacketType(PacketKind.REPORT, _CONTROL, _SEARCH, "Search", answered=False)
    FOUND = 42, PacketType(PacketKind.REPORT, _CONTROL, "uint8 node", "Found")
    PROBE = 43, PacketType(PacketKind.HEARTBEAT, _CONTROL)
    # A drone's reply to a numbered order, and the question for it
    ORDER_REPLY = 64, PacketType(PacketKind.ORDER, _GATEWAY, _REPLY, "OrderReply")
    ORDER_QUERY = 65, PacketType(PacketKind.ORDER, _NODE, "uint16 order", "OrderQuery")
    # The state of its creator, and why that cannot fly
    NODE_REPORT = 66, PacketType(PacketKind.REPORT, _GATEWAY, _REPORT, "NodeReport")
    NODE_WORDS = 67, PacketType(PacketKind.REPORT, _GATEWAY, _WORDS, "NodeWords")
    # A gateway looks for a node
    NODE_SEARCH = (
        68,
        PacketType(PacketKind.REPORT, _CONTROL, "uint8 node, uint16 number", "NodeSearch"),
    )
    # Where another node was last heard, for a drone that is about to land near there
    LAST_PLACE = 69, PacketType(PacketKind.POSITION, _NODE, _LAST_PLACE, "LastPlace")
    # Where a gateway was, in a mesh with a key
    GATEWAY_PLACE = 125, PacketType(PacketKind.POSITION, _ROUTER, _GATEWAY_PLACE, "GatewayPlace")
    # Asks a neighbour to prove that it has the key, and the proof
    SEAL_CHALLENGE = 126, PacketType(PacketKind.OTHER, _SEAL, made_of="HopSeal", once=True)
    SEAL_ANSWER = (
        127,
        PacketType(PacketKind.OTHER, _SEAL, made_of="HopSeal", jittered=False, once=True),
    )


ABOUT = tuple(
    {
        **dict.fromkeys(range(256), _UNKNOWN),
        **dict.fromkeys(TECHNIQUE_TYPES, _TECHNIQUE),
        **dict.fromkeys(DATA_TYPES, _DATA),
        **{int(kind): kind.about for kind in MessageType},
    }.values()
)
"""What is declared about each number, also about those that are no MessageType."""

FLOATS = {number: about.floats for number, about in enumerate(ABOUT) if about.floats is not None}
"""What unpacks the floats of bodies, by the numbers of the types that have any."""

TYPES_WITH_PLACES = frozenset(number for number in range(256) if ABOUT[number].has_place)
