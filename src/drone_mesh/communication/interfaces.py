"""The interfaces between the mesh software and its surroundings (docs/protocol.md, "Interfaces").

Everything here is driven from outside: time comes in as `now_s`, in seconds of the caller's clock.
One thread at a time works in a component; the getters of IMeshDebugInfo are snapshots and may be
read from any thread.
"""

from __future__ import annotations

import abc
import enum
from typing import Final, NamedTuple, Sequence

from drone_mesh.communication.timing import UNDISTURBED, ChannelUse, Medium
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.location import Location

PAYLOAD_BYTES: Final = 32  # nRF24L01+ Product Specification 1.0, 7.3.4: a payload is 0..32 bytes
MAX_NODE_ID: Final = MAX_DRONES - 1  # docs/wire.md, "Identity"
BROADCAST: Final = 254  # final addressee: every node in range
NO_ROUTE: Final = 255  # "no such route", "no such node"
UNLIMITED_ROOM = 2**31


class IMeshNetwork(abc.ABC):
    """The functions of a mesh component that its antenna may call."""

    @abc.abstractmethod
    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Handle one packet from the air before returning. Any bytes are allowed."""

    @abc.abstractmethod
    def get_node_id(self) -> int:
        """This node's id, 0..253."""

    @abc.abstractmethod
    def on_delivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """The neighbour in byte 3 received a queued packet after `tries`, the radio's included."""

    @abc.abstractmethod
    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """The antenna gives up a queued packet for the neighbour in byte 3."""

    @abc.abstractmethod
    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """The antenna was switched on or off."""

    @abc.abstractmethod
    def on_antenna_registered(self, now_s: float) -> None:
        """The medium has registered the antenna again, for example after a simulator restart."""


class IMeshDebugInfo(abc.ABC):
    """Read-only snapshots of a component, for display."""

    @abc.abstractmethod
    def get_node_id(self) -> int:
        """This node's id, 0..253."""

    @abc.abstractmethod
    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered the last heartbeat; stays true while it may still answer.

        Of a gateway: true while its internet works; otherwise whether it reaches another one.
        """

    @abc.abstractmethod
    def get_total_message_sent(self) -> int:
        """Packets sent successfully, own and forwarded ones, not counting broadcasts."""

    @abc.abstractmethod
    def get_preferred_gateway(self) -> int:
        """Id of the gateway this node uses, or NO_ROUTE while it knows none."""

    @abc.abstractmethod
    def get_hops_from_gateway_away(self) -> int:
        """Hops to the preferred gateway; 0 for a gateway with internet, 255 while unknown."""

    @abc.abstractmethod
    def get_shares_id(self) -> bool:
        """Whether another radio with this node's id was heard lately."""

    @abc.abstractmethod
    def get_last_good_known_location_id(self) -> int:
        """Id of the node whose place this one would fly to, or NO_ROUTE."""

    @abc.abstractmethod
    def get_router_tech_table_size(self) -> int:
        """Known nodes; a node known through two neighbours counts twice."""


class KnownNode(NamedTuple):
    """What a gateway knows about another node."""

    node_id: int
    next_hop: int  # the neighbour that leads to it; NO_ROUTE: there is none now
    hops: int  # of its last heartbeat to this gateway, or report; NO_ROUTE: none yet
    heard_s: float  # when it was last heard, in seconds of the core's clock; -inf: never


class IGatewayCommands(abc.ABC):
    """The commands that a gateway accepts from the outside world."""

    @abc.abstractmethod
    def send_goal_request_to_drone(
        self,
        node_id: int,
        latitude: float,
        longitude: float,
        height: int,
        now_s: float,
        allow_shared_place: bool = False,
    ) -> bool:
        """Send a drone to a place (metres). Raises GoalRefused for an invalid order.

        Raises PlaceTaken for the place of another drone, unless `allow_shared_place`: where it
        stands, flies to or was last heard.

        True: a next hop took the order, or a search for the drone has begun. `get_orders` returns
        the outcome.
        """

    @abc.abstractmethod
    def get_node_id(self) -> int:
        """The gateway's own id, 0..253."""

    @abc.abstractmethod
    def get_known_nodes(self) -> list[KnownNode]:
        """All other nodes that it has a route to or has heard, by id."""

    @abc.abstractmethod
    def set_internet(self, works: bool, now_s: float) -> None:
        """Tell the gateway whether its connection to the outside world works."""

    def get_orders(self) -> Sequence[OrderRecord]:
        """The orders that it remembers, oldest first, with their outcomes."""
        return ()


class IWirelessCommunication(abc.ABC):
    """A radio for 32-byte packets. No method raises for a lost packet."""

    @property
    def medium(self) -> Medium:
        """The properties of the medium. Constant."""
        return UNDISTURBED

    def channel_use(self) -> ChannelUse:
        """This node's use of a shared channel. Any thread."""
        return ChannelUse()

    def hears_power(self) -> bool | None:
        """Whether there is power in its channel now, of whatever sender; None: it cannot tell."""
        return None

    def works(self) -> bool:
        """False if its radio is known not to work. Then nothing tells where its drone is."""
        return True

    def patience(self) -> float:
        """The number of check periods for which the mesh should not probe what is known to work.

        0 on a quiet channel: everything is probed in each period. More on a busy one.
        """
        return 0.0

    def limit_tries(self, most: int) -> None:  # noqa: B027 (only a shared channel has tries)
        """Give up a packet after so many tries at most; if its sender begins anew, after one."""

    def data_room(self) -> int:
        """How many packets of users it would accept now without delaying those of the mesh."""
        return UNLIMITED_ROOM

    @abc.abstractmethod
    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Start receiving as this node, and pass each packet to `mesh`."""

    @abc.abstractmethod
    def stop_antenna(self) -> None:
        """Stop and release the resources of start_antenna. A second call changes nothing."""

    @abc.abstractmethod
    def send_message_to(self, payload: bytes) -> bool:
        """Send to the node in byte 3. True: that node received it.

        On a shared medium True means that the antenna has queued the packet; it calls
        `on_delivered` or `on_undelivered` later.
        """

    def send_messages(self, payloads: Sequence[bytes]) -> list[bool]:
        """Send each to the node in its byte 3, in this order; returns for each whether it arrived.

        A radio that can send many at once overrides this.
        """
        return [self.send_message_to(payload) for payload in payloads]

    @abc.abstractmethod
    def broadcast_message(self, payload: bytes) -> None:
        """Send to every node in range; each finds its own id in byte 3."""

    @abc.abstractmethod
    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Start or stop displaying `info` together with the antenna's own state."""

    def switch_power(self, on: bool) -> None:  # noqa: B027 (a medium may know each id only once)
        """Switch it off or on, and inform the mesh."""

    @abc.abstractmethod
    def on(self) -> bool:
        """Whether the antenna has power."""


class IMeshSeals:
    """What the key of a mesh adds to a node's packets. As it stands here: a mesh without a key."""

    has_key = False

    def reserved_bytes(self, kind: int) -> int:
        """How many of the 27 bytes after the header of a packet the seal needs."""
        return 0

    def seal_message(self, creator: int, to: int, place: bytes, payload: bytes) -> bytes:
        """A user's message, readable only by `to`; unchanged without a key."""
        return payload

    def open_message(self, creator: int, to: int, place: bytes, sealed: bytes) -> bytes | None:
        """The message; None unless `creator` sealed it for `to` and this place."""
        return sealed

    def acknowledgement_tag(self, creator: int, to: int, body: bytes) -> bytes:
        """Proves that `creator` acknowledges this to `to`; empty without a key."""
        return b""

    def without_proof(self, payload: bytes) -> bytes:
        """A packet that this node created, as it was before the seal proved that."""
        return payload

    def may_be_gateway(self, node: int) -> bool:
        """Whether `node` has proved to this node that it is a gateway; True without a key.

        A control plane asks this before it prefers a gateway by the word of others.
        """
        return True

    def foreign_neighbour(self) -> str:
        """Why a neighbour seems to have another key or none; empty: nothing points to that."""
        return ""


NO_SEALS = IMeshSeals()


class IInternetConnection(abc.ABC):
    """A gateway's connection to the outside world."""

    @abc.abstractmethod
    def connect(self, commands: IGatewayCommands) -> None:
        """Connect, and pass incoming orders to `commands`."""

    @abc.abstractmethod
    def disconnect(self) -> None:
        """Disconnect. A second call changes nothing."""


class OrderState(enum.Enum):
    """The progress of an order; `in_words` is how logs, events, services and pages tell it."""

    is_open: bool  # whether the gateway still follows the order

    def __new__(cls, words: str, is_open: bool = False) -> OrderState:
        member = object.__new__(cls)
        member._value_ = words
        member.is_open = is_open
        return member

    SENT = "sent", True  # the next hop has it
    ACCEPTED = "accepted", True  # by the drone, which flies there
    ARRIVED = "arrived"
    REPLACED = "replaced"  # the drone has a later order
    REFUSED = "refused"  # by the drone
    NO_ROUTE = "no route"  # it did not reach the drone
    LOST_CONTACT = "lost contact"  # the drone may still fly there; if it reports, the state changes
    GIVEN_UP = "given up"  # the flight ended elsewhere

    def in_words(self, reason: str = "") -> str:
        """The state and its reason, such as: replaced by order 8; refused: battery at 9 %."""
        if not reason:
            return str(self.value)
        continues = self in (OrderState.REPLACED, OrderState.LOST_CONTACT)
        return f"{self.value}{'' if continues else ':'} {reason}"


class OrderRecord(NamedTuple):
    """One order as known to its gateway."""

    number: int  # 1..65535, unique among the orders that the gateway remembers
    drone: int
    goal: Location
    state: OrderState
    reason: str  # of the state, as in `OrderState.in_words`; empty: none
    ordered_s: float  # when, in seconds of the core's clock
    changed_s: float  # time of the last change of state
