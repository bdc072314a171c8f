"""The seam between a router and its repair strategy: its notifications, its views, its actions.

A strategy is driven like the rest of the mesh software: it has no clock, no thread and no random
numbers of its own. docs/strategies.md shows how to write one.
"""

# ruff: noqa: B027 - a strategy overrides only those of the calls that it needs

from __future__ import annotations

import abc
from typing import Mapping, NamedTuple

from drone_mesh.communication.election import NO_BID
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.router_states import Repair, RouterEvent
from drone_mesh.drone.interfaces import Location

SILENCE_PATIENCE = 5.0  # our choice: how many times longer a node waits if its medium may be down


class Step(NamedTuple):
    """A flight that a drone could make."""

    place: Location
    owner: int = NO_ROUTE  # the node whose place it is; NO_ROUTE: of none; the own id: back there
    home: bool = False  # whether it is the gateway's place


class NeighbourView(NamedTuple):
    """What a router knows of a neighbour."""

    place: Location | None  # where it stands, or will stand; None: it has not said
    age_s: float  # how old that is; infinity if it is not known
    hops: int  # to its gateway, as it said last; 255: it has none


class IRepairActions(abc.ABC):
    """What a strategy sees of its router, and what it may do. Places are in metres, x east."""

    # Views -----------------------------------------------------------------------------------

    @property
    @abc.abstractmethod
    def node_id(self) -> int:
        """The own id."""

    @property
    @abc.abstractmethod
    def now_s(self) -> float:
        """The time, in seconds of the core's clock."""

    @property
    @abc.abstractmethod
    def range_m(self) -> float:
        """How far a radio reaches, as far as known."""

    @property
    @abc.abstractmethod
    def clearance_m(self) -> float:
        """How near to each other drones may come to rest."""

    @property
    @abc.abstractmethod
    def check_period_s(self) -> float:
        """The time between two checks."""

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
    def state(self) -> Repair:
        """What the repair does now."""

    @property
    @abc.abstractmethod
    def silent(self) -> bool:
        """Whether all neighbours, two or more, fell silent together: the medium may be down."""

    @abc.abstractmethod
    def neighbours(self) -> Mapping[int, NeighbourView]:
        """The nodes in direct reach."""

    @abc.abstractmethod
    def reachable(self) -> Mapping[int, NeighbourView]:
        """All nodes to which there is a route and whose place was heard."""

    @abc.abstractmethod
    def reaches(self, node: int) -> bool:
        """Whether there is a route to `node`."""

    @property
    @abc.abstractmethod
    def lost_next_hop(self) -> int:
        """The next hop towards the gateway, before the connection was lost; NO_ROUTE: unknown."""

    @property
    @abc.abstractmethod
    def steps(self) -> list[Step]:
        """The flights back: to the place of the lost next hop, then to that of the gateway."""

    @property
    @abc.abstractmethod
    def gateway_place(self) -> Location | None:
        """Where the preferred gateway is, as heard last."""

    @abc.abstractmethod
    def own_place(self) -> Location | None:
        """Where this drone is; None: it cannot say."""

    @abc.abstractmethod
    def why_not_fly(self) -> str:
        """Why the drone would not fly; empty while it would."""

    @abc.abstractmethod
    def was_at(self, step: Step) -> bool:
        """Whether the drone flew there since it was last connected."""

    # Actions ---------------------------------------------------------------------------------

    @abc.abstractmethod
    def fly(self, step: Step, until_connected: bool = False) -> None:
        """Fly there, and land clear of other drones; `on_landed` reports the landing.

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
        """Send a bid to all neighbours; `node` made it, if it is passed on.

        `about`: the gateway's place, if the bid announces that a drone flies or flew there.
        """

    @abc.abstractmethod
    def ask_places(self) -> None:
        """Ask all nodes in range where they are; the answers come to `on_place`."""

    @abc.abstractmethod
    def ask_place(self, node: int) -> None:
        """Ask one node, along the route to it."""

    @abc.abstractmethod
    def announce_place(self, place: Location) -> None:
        """Send all nodes in range the place where this drone stands, or will stand."""

    @abc.abstractmethod
    def present(self) -> None:
        """Introduce this node to all nodes in range."""

    @abc.abstractmethod
    def wait_until(self, at_s: float) -> None:
        """Have `on_time` called then, and not at an earlier wish; infinity: not at all."""

    @abc.abstractmethod
    def happened(self, event: RouterEvent) -> None:
        """Move the states of the router (see router_states). An election needs this."""

    @abc.abstractmethod
    def end_round(self) -> None:
        """An election is over. The time without a gateway counts from its first check on."""

    @abc.abstractmethod
    def report(self, kind: MeshEventKind, peer: int = NO_ROUTE, detail: str = "") -> None:
        """Report an event to the node's observer."""


class IRepairStrategy(abc.ABC):
    """What a router does about a lost connection. All calls come from one thread, one at a time.

    Only `on_emergency` has to be written. A strategy of a node that is connected or in flight for
    a repair is not asked to do anything.
    """

    # Shown to users, as RepairStatus:
    reason = ""  # why the drone does not fly, in a few words
    own_bid = NO_BID  # in an election
    bid_unit = ""  # of bids above 1
    bids_for = NO_ROUTE  # the node whose place it would take
    winner = NO_ROUTE  # of an election; it has to take off

    def start(self, mesh: IRepairActions) -> None:
        """Called once, before everything else."""
        self.mesh = mesh

    def patience(self, silent: bool) -> float:
        """How often `connection_lost_after` passes until an emergency; `silent`: see the router."""
        return SILENCE_PATIENCE if silent else 1.0

    def on_gateway_lost(self) -> None:
        """A check noticed that no gateway answers."""

    @abc.abstractmethod
    def on_emergency(self) -> None:
        """No gateway answered for `connection_lost_after`. Called at each check from then on."""

    def on_gateway_found(self) -> None:
        """A gateway answers."""

    def on_stopped(self) -> None:
        """The drone flies by an order, or the antenna is off: give up what is under way."""

    def on_neighbour_found(self, node: int) -> None:
        """A node is in reach that was not."""

    def on_neighbour_lost(self, node: int) -> None:
        """A neighbour took no packet any more."""

    def on_place(self, node: int, place: Location) -> None:
        """A node said where it stands, or where it flies to."""

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """`node` bids; the neighbour `from_` sent or passed on that bid.

        `about`: the gateway's place to which that node flies or flew.
        """

    def on_time(self) -> None:
        """The time has come for which the strategy waited."""

    def on_landed(self) -> None:
        """A flight for the repair is over, and the drone stands clear of others."""
