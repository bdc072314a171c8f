"""The control plane of a node: who is a neighbour, whether a gateway is reached, which way to send.

The node hands every packet, every outcome of a transmission and the time to its control plane and
asks it for next hops. There are two: `heartbeats`, the document's way, with a routing technique to
choose among routes; and `beacon`, in which one broadcast per node and period decides everything.
A node has no further idea of a neighbour, a connection or a route than its control plane.
"""

# ruff: noqa: B027 - a host or a plane overrides what concerns it

from __future__ import annotations

import abc
import math
import random
from dataclasses import dataclass
from typing import Callable, Sequence

from drone_mesh.communication.control.delivery import IDelivery, IRoutes
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import Claims, CommonFrame, KnownPlaces
from drone_mesh.communication.control.router_states import RouterEvent, RouterStates
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import Reporter
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.timing import Deadlines, MeshTiming

Learn = Callable[[int, int, int, bytes], bool]
Forward = Callable[[bytes, int, int, int, int, float], None]

NUMBERS_PER_S = 16  # of searches and orders: a restarted gateway starts at another number


class IControlHost:
    """What a control plane tells its node. The defaults are those of a node that never flies."""

    def may_connect(self, node: int, know_gateway: bool) -> bool:
        """Whether to connect through `node` now (NO_ROUTE: through any); see ConnectionRepair."""
        return True

    def on_connected(self) -> None:
        """A gateway is reached again."""

    def on_unconnected_check(self, due_s: float) -> None:
        """A check, due at `due_s`, finds no gateway."""

    def on_neighbour_lost(self, node: int) -> None:
        """A neighbour is out of reach; the routes are already updated."""

    def on_looks(self, neighbour: int) -> None:
        """A neighbour looks for a gateway; only if it does not tell its place once it has one."""

    def on_leads(self, neighbour: int) -> None:
        """A neighbour shows that this node is its next hop; only if no question for places does."""

    def on_node_heard(self, node: int, hops: int) -> None:
        """At a gateway: a packet of `node` proves a path of so many hops."""

    def on_node_missing(self, node: int, told: bool) -> None:
        """Another node has no route to `node`.

        `told`: it told this node alone, as after it dropped an order of it, not all neighbours.
        """


@dataclass(frozen=True)
class ControlledNode:
    """What a control plane works with. It hands each of its own parts only what that one uses.

    All belongs to the thread of the node's component.
    """

    node_id: int
    host: IControlHost
    states: RouterStates | None  # of a router; a gateway has none
    timing: MeshTiming
    deadlines: Deadlines  # the clock of the node, too
    report: Reporter
    complaints: Complaints
    places: KnownPlaces
    frame: CommonFrame
    claims: Claims
    pilot: Pilot
    antenna: IWirelessCommunication
    seals: IMeshSeals
    rng: random.Random  # spreads simultaneous actions of many nodes
    range_m: float  # of the radio, as far as the node knows


class IControlPlane(abc.ABC):
    """Decides neighbours, connection and routes of one node. Belongs to its component's thread.

    See node_part for how it declares the packets and timers that it handles. Below, first what each
    plane must do, then the events and questions that may concern it.
    """

    delivery: IDelivery
    routes: IRoutes
    neighbours: Neighbours  # the one table of the node; the plane makes it

    @property
    def parts(self) -> Sequence[object]:
        """What of it handles packets and timers."""
        return (self,)

    bids_within_s: float
    """For so long a bid for a repair counts and is awaited: by then a group has noticed a loss."""

    # Attributes that hold functions, because each packet calls one of them.
    learn: Learn
    """(creator, from, type, payload): a packet of another node came in. False: drop it."""

    forward: Forward
    """(payload, creator, from, type, addressee, now_s): pass on a packet for another node."""

    @abc.abstractmethod
    def start(self) -> None:
        """The node starts."""

    @abc.abstractmethod
    def introduce(self) -> None:
        """Make this node known to all in range, now."""

    @abc.abstractmethod
    def on_power(self, on: bool) -> None:
        """The antenna was switched on or off."""

    @abc.abstractmethod
    def on_registered(self) -> None:
        """The medium has registered the antenna again."""

    @abc.abstractmethod
    def own_came_back(self, from_: int) -> None:
        """A packet of this node came back through `from_`."""

    @abc.abstractmethod
    def says_connected(self, kind: int, payload: bytes) -> bool:
        """Whether it is the introduction of a node that a gateway answers."""

    @abc.abstractmethod
    def on_undelivered(self, payload: bytes, tries: int) -> None:
        """The antenna gave up a queued packet: send it another way, or drop it."""

    @property
    @abc.abstractmethod
    def gateway(self) -> int:
        """The preferred gateway, a gateway with internet itself; NO_ROUTE: none is known.

        With a key any node can still say that it is one, so those that have proved it come first
        (`IMeshSeals.may_be_gateway`); test_captured_gateway.py tries every technique.
        """

    @property
    @abc.abstractmethod
    def hops(self) -> int:
        """Hops to it; NO_ROUTE: unknown."""

    @property
    @abc.abstractmethod
    def connected(self) -> bool:
        """Whether it answered the last heartbeat, or may still answer; of a gateway, `hops`."""

    @abc.abstractmethod
    def next_hop(self) -> int:
        """The next hop to the preferred gateway, or NO_ROUTE."""

    @abc.abstractmethod
    def end(self, event: RouterEvent) -> None:
        """The connection ends because of `event`."""

    # Events ----------------------------------------------------------------------------------

    def check(self, due_s: float) -> None:
        """The periodic check, with the antenna on, was due at `due_s`."""

    def on_internet(self, works: bool) -> None:
        """A gateway's connection to the outside world works again, or no longer."""

    def on_delivered(self, neighbour: int, tries: int) -> None:
        """A neighbour received a queued packet after `tries` transmissions."""

    def neighbour_leaves(self, neighbour: int) -> None:
        """A neighbour or this node flies, and they will be out of reach of each other."""

    def flies_far(self) -> None:
        """This node sets out by order, and leaves its links behind until it has landed."""

    def gateway_sent_place(self) -> None:
        """The preferred gateway itself reported its place."""

    def give_up_routes(self) -> None:
        """Forget every route to the preferred gateway."""

    def leave(self) -> None:
        """Give up the connection and tell the neighbours: this node flies away by itself."""

    # Questions -------------------------------------------------------------------------------

    def search(self, node: int) -> bool:
        """Look for a node without a known route. False: not now, but after `search_pause_s`."""
        return False

    def way_up(self, but: int) -> int:
        """The next hop of users' data for nodes without a route, not `but`; NO_ROUTE: none.

        It leads to the preferred gateway, which knows more nodes than a router.
        """
        return NO_ROUTE

    def seek(self, node: int) -> bool:
        """Users' data for `node` has no way from here: search for it. False: this is no gateway."""
        return False

    def heard_s(self, node: int) -> float:
        """When `node`, no neighbour, was last known to be there; -inf: not recorded. Any thread."""
        return -math.inf

    def told_of_gateway(self, gateway: int) -> bool:
        """Another node tells of a gateway. Returns whether it is, or becomes, the preferred one."""
        return gateway == self.gateway


class ITechnique(abc.ABC):  # noqa: B024 (what each kind must do differs)
    """What `routing:=` names: an IRoutingTechnique or an IControlTechnique."""

    connection_lost_after_s = 30.0  # where the timing of a node leaves it to the technique


class IControlTechnique(ITechnique):
    """A way to decide neighbours, connection and routes that may be chosen by name."""

    @abc.abstractmethod
    def control_plane(self, node: ControlledNode) -> IControlPlane:
        """The control plane of one node."""
