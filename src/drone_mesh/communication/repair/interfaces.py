"""The interface between a router and its repair strategy: notifications, views, actions.

A strategy is driven like the rest of the mesh software: without a clock, thread or randomness of
its own. docs/strategies.md shows how to write one.
"""

# ruff: noqa: B027 - a strategy overrides only those of the calls that it needs

from __future__ import annotations

import abc
from typing import Mapping, NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.medium import UNDISTURBED, Medium
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.communication.router_states import RepairState, RouterEvent
from drone_mesh.drone.location import Location

SILENCE_PATIENCE = 5.0  # our choice: the factor on a node's patience if its medium may be down


class Step(NamedTuple):
    """A possible flight of a drone."""

    place: Location
    owner: int = NO_ROUTE  # the node at that place; NO_ROUTE: none; own id: a return
    home: bool = False  # whether it is the gateway's place


class NeighbourView(NamedTuple):
    """What a router knows about a neighbour."""

    place: Location | None  # where it is, or its destination; None: not reported
    age_s: float  # age of the place; infinity if unknown
    hops: int  # to its gateway, as last reported; 255: it has none


class IRepairActions(abc.ABC):
    """A strategy's view of its router, and its possible actions. Places in metres, x east."""

    # Views -----------------------------------------------------------------------------------

    @property
    @abc.abstractmethod
    def node_id(self) -> int:
        """The node's own id."""

    @property
    @abc.abstractmethod
    def now_s(self) -> float:
        """The time, in seconds of the core's clock."""

    @property
    def medium(self) -> Medium:
        """The properties of the antenna's medium. Constant."""
        return UNDISTURBED

    @property
    @abc.abstractmethod
    def range_m(self) -> float:
        """The range of the radio, as far as known."""

    @property
    @abc.abstractmethod
    def clearance_m(self) -> float:
        """The least distance between drones at rest."""

    @property
    @abc.abstractmethod
    def check_period_s(self) -> float:
        """The time between two checks."""

    @property
    @abc.abstractmethod
    def bids_within_s(self) -> float:
        """For so long a bid counts, and the bids of neighbours are awaited."""

    @property
    @abc.abstractmethod
    def connection_lost_after_s(self) -> float:
        """The time without a gateway until the emergency."""

    @property
    @abc.abstractmethod
    def connected(self) -> bool:
        """Whether a gateway answers."""

    @property
    @abc.abstractmethod
    def state(self) -> RepairState:
        """The current repair state."""

    @property
    @abc.abstractmethod
    def silent(self) -> bool:
        """Whether all neighbours (2 or more) fell silent together, so the medium may be down."""

    @abc.abstractmethod
    def hears_power(self) -> bool | None:
        """Whether there is power in the channel of its radio now; None: it cannot measure it."""

    @abc.abstractmethod
    def neighbours(self) -> Mapping[int, NeighbourView]:
        """The nodes in direct reach."""

    @abc.abstractmethod
    def reachable(self) -> Mapping[int, NeighbourView]:
        """All nodes with a route to them and a reported place."""

    @abc.abstractmethod
    def reaches(self, node: int) -> bool:
        """Whether there is a route to `node`."""

    @property
    @abc.abstractmethod
    def lost_next_hop(self) -> int:
        """The next hop to the gateway before the connection was lost; NO_ROUTE: unknown."""

    @property
    @abc.abstractmethod
    def steps(self) -> list[Step]:
        """The flights back: to the lost next hop, the gateway, and where it was connected last.

        The last one has the owner NO_ROUTE; it is for a drone that has no other.
        """

    @property
    @abc.abstractmethod
    def gateway_place(self) -> Location | None:
        """The last reported place of the preferred gateway."""

    @abc.abstractmethod
    def own_place(self) -> Location | None:
        """The position of this drone; None: unknown."""

    @abc.abstractmethod
    def why_not_fly(self) -> str:
        """Why the drone cannot fly for a repair; empty if it can."""

    @abc.abstractmethod
    def goal_of(self, step: Step) -> Location:
        """Where a flight for this step would end, clear of other drones, silent ones included."""

    @abc.abstractmethod
    def was_at(self, step: Step) -> bool:
        """Whether the drone flew there since it was last connected, or since `try_again`."""

    # Actions ---------------------------------------------------------------------------------

    @abc.abstractmethod
    def try_again(self) -> None:
        """Let it fly once more to where it was in vain; it lands at another side of each place."""

    @abc.abstractmethod
    def fly(self, step: Step, until_connected: bool = False) -> None:
        """Fly there and land clear of other drones; `on_landed` reports the landing.

        `until_connected`: land as soon as a gateway answers. The routes are forgotten.
        """

    @abc.abstractmethod
    def bid(
        self,
        score: float,
        node: int | None = None,
        but_not_to: int = NO_ROUTE,
        about: Location | None = None,
    ) -> None:
        """Send a bid to all neighbours; `node` is its creator if it is relayed.

        `about`: the gateway's place, if the bid announces that a drone flies or flew there.
        """

    @abc.abstractmethod
    def ask_places(self) -> None:
        """Request the places of all nodes in range; the answers arrive in `on_place`."""

    @abc.abstractmethod
    def ask_place(self, node: int) -> None:
        """Request the place of one node, along the route to it."""

    @abc.abstractmethod
    def announce_place(self, place: Location) -> None:
        """Send the place where this drone is or will be to all nodes in range."""

    @abc.abstractmethod
    def present(self) -> None:
        """Introduce this node to all nodes in range."""

    @abc.abstractmethod
    def wait_until(self, at_s: float) -> None:
        """Call `on_time` at this time instead of an earlier request; infinity: not at all."""

    @abc.abstractmethod
    def happened(self, event: RouterEvent) -> None:
        """Change the states of the router (see router_states). An election needs this."""

    @abc.abstractmethod
    def end_round(self) -> None:
        """An election is over. Count the time without a gateway from its first check."""

    @abc.abstractmethod
    def report(self, kind: MeshEventKind, peer: int = NO_ROUTE, detail: str = "") -> None:
        """Report an event to the node's observer."""


class IRepairStrategy(abc.ABC):
    """A router's reaction to a lost connection. All calls come from one thread, one at a time.

    Only `on_emergency` is required. A strategy is not asked for actions while its node is connected
    or flies for a repair.
    """

    # Read by the router, most of them shown to users as RepairStatus:
    reason = ""  # why the drone does not fly, as short text
    listens = False  # it must not connect yet
    own_bid = NO_BID  # in an election
    bid_unit = ""  # of bids above 1
    bids_for = NO_ROUTE  # the node whose place it would take
    winner = NO_ROUTE  # of an election; it must take off

    def start(self, mesh: IRepairActions) -> None:
        """Called once, before everything else."""
        self.mesh = mesh

    def patience(self, silent: bool) -> float:
        """The wait before an emergency, as a multiple of `connection_lost_after`.

        Called after `on_gateway_lost`, at each check from then on until the emergency, and when a
        node is heard after a silence, from which moment the time counts anew. `silent`: see
        IRepairActions.silent.
        """
        return SILENCE_PATIENCE if silent else 1.0

    def on_gateway_lost(self) -> None:
        """A check found that no gateway answers."""

    @abc.abstractmethod
    def on_emergency(self) -> None:
        """No gateway answered for `connection_lost_after`. Called at each check from then on."""

    def on_gateway_found(self) -> None:
        """A gateway answers."""

    def on_stopped(self) -> None:
        """The drone flies by order, or the antenna is off: give up what is under way."""

    def on_neighbour_found(self, node: int) -> None:
        """A new node is in reach."""

    def on_neighbour_lost(self, node: int) -> None:
        """A neighbour no longer takes packets."""

    def on_place(self, node: int, place: Location) -> None:
        """A node reported where it is, or where it flies to."""

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """`node` bids; the neighbour `from_` sent or relayed that bid.

        `about`: the gateway's place to which that node flies or flew.
        """

    def on_time(self) -> None:
        """The timer of `wait_until` has expired."""

    def on_landed(self) -> None:
        """A flight for the repair is over, and the drone is clear of others."""
