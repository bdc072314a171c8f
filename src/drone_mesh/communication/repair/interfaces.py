"""The interface of a repair strategy: what its router reports to it.

A strategy is driven like the rest of the mesh software: without a clock, thread or randomness of
its own. docs/strategies.md shows how to write one.
"""

# ruff: noqa: B027 - a strategy overrides only those of the calls that it needs

from __future__ import annotations

import abc

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.actions import RepairActions
from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.drone.location import Location

SILENCE_PATIENCE = 5.0  # the factor on a node's patience if its medium may be down


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

    def start(self, mesh: RepairActions) -> None:
        """Called once, before everything else."""
        self.mesh = mesh

    def patience(self, silent: bool) -> float:
        """The wait before an emergency, as a multiple of `connection_lost_after`.

        Called after `on_gateway_lost`, at each check from then on until the emergency, and when a
        node is heard after a silence, from which moment the time counts anew. `silent`: see
        RepairActions.silent.
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

        `about`: the goal of its flight, or the gateway's place to which it flew in vain.
        """

    def on_time(self) -> None:
        """The timer of `wait_until` has expired."""

    def on_landed(self) -> None:
        """A flight for the repair is over, and the drone is clear of others."""
