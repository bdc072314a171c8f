"""The states of a router, and every transition between them.

A router is in two states at once. They are independent: a lost router still tries the gateways that
its neighbours offer, and an answer may reach a router in flight.

* `ConnectionState`: whether a gateway answers.
* `RepairState`: the router's reaction to a lost connection.

An event without an entry for the current state is a bug and raises RuntimeError.
"""

from __future__ import annotations

import enum
from typing import Mapping


class ConnectionState(enum.Enum):
    """The connection to the preferred gateway."""

    __hash__ = object.__hash__  # each is one object; Enum's own hash is a Python function

    SEARCHING = "searching"  # not connected
    AWAITING_FIRST_ANSWER = "awaiting the first answer"  # a heartbeat is under way
    CONNECTED = "connected"
    AWAITING_ANSWER = "awaiting an answer"  # connected; a heartbeat is under way


class RepairState(enum.Enum):
    """The router's reaction to a lost connection."""

    __hash__ = object.__hash__

    AT_REST = "at rest"  # nothing: it is connected, or no check has noticed the loss
    LOST = "lost"  # waits for a gateway until the time is up
    ASKING = "asking"  # waits for the places of its neighbours
    NEGOTIATING = "negotiating"  # has bid, and waits for the bids of its group
    WATCHING = "watching"  # waits for the winner to take off
    FLYING = "flying"


class RouterEvent(enum.Enum):
    """An event that may change a router's states."""

    __hash__ = object.__hash__

    HEARTBEAT_SENT = "a heartbeat to the gateway leaves"
    ANSWER_MISSED = "the gateway did not answer in time, or the heartbeat could not be sent"
    ROUTE_LOST = "no neighbour leads to a gateway any longer"
    GATEWAY_ANSWERED = "a heartbeat of the gateway arrives"
    LOSS_NOTICED = "a check finds the router unconnected"
    ASKED_FOR_PLACES = "the time is up, or a neighbour bids: it asks where its neighbours are"
    BID = "the router bids for the flight"
    BIDS_COUNTED = "another router has won"
    WINNER_MISSED = "the winner did not take off"
    ROUND_OVER = "the router has won, the winner took off, or no router bids"
    NO_NEIGHBOURS = "the time is up and there is no neighbour to negotiate with"
    TOOK_OFF = "a flight starts, or changes its goal"
    LANDED = "the flight is over"
    ANTENNA_OFF = "the antenna has no power"


_CONNECTED = frozenset((ConnectionState.CONNECTED, ConnectionState.AWAITING_ANSWER))
_AWAITING = frozenset((ConnectionState.AWAITING_FIRST_ANSWER, ConnectionState.AWAITING_ANSWER))

_ALL_TO_SEARCHING = {state: ConnectionState.SEARCHING for state in ConnectionState}
_ALL_BUT_FLYING_TO_REST = {
    **{state: RepairState.AT_REST for state in RepairState},
    RepairState.FLYING: RepairState.FLYING,
}

CONNECTION_TRANSITIONS: Mapping[RouterEvent, Mapping[ConnectionState, ConnectionState]] = {
    RouterEvent.HEARTBEAT_SENT: {
        ConnectionState.SEARCHING: ConnectionState.AWAITING_FIRST_ANSWER,
        ConnectionState.AWAITING_FIRST_ANSWER: ConnectionState.AWAITING_FIRST_ANSWER,
        ConnectionState.CONNECTED: ConnectionState.AWAITING_ANSWER,
        ConnectionState.AWAITING_ANSWER: ConnectionState.AWAITING_ANSWER,
    },
    RouterEvent.ANSWER_MISSED: {
        ConnectionState.AWAITING_FIRST_ANSWER: ConnectionState.SEARCHING,
        ConnectionState.AWAITING_ANSWER: ConnectionState.SEARCHING,
    },
    RouterEvent.ROUTE_LOST: _ALL_TO_SEARCHING,
    RouterEvent.GATEWAY_ANSWERED: {state: ConnectionState.CONNECTED for state in ConnectionState},
    RouterEvent.LOSS_NOTICED: {
        ConnectionState.SEARCHING: ConnectionState.SEARCHING,
        ConnectionState.AWAITING_FIRST_ANSWER: ConnectionState.SEARCHING,
    },
    RouterEvent.TOOK_OFF: _ALL_TO_SEARCHING,
    RouterEvent.LANDED: _ALL_TO_SEARCHING,
    RouterEvent.ANTENNA_OFF: _ALL_TO_SEARCHING,
}
"""An event without an entry leaves the connection unchanged."""

REPAIR_TRANSITIONS: Mapping[RouterEvent, Mapping[RepairState, RepairState]] = {
    RouterEvent.GATEWAY_ANSWERED: _ALL_BUT_FLYING_TO_REST,
    RouterEvent.LOSS_NOTICED: {RepairState.AT_REST: RepairState.LOST},
    RouterEvent.ASKED_FOR_PLACES: {RepairState.LOST: RepairState.ASKING},
    RouterEvent.BID: {RepairState.ASKING: RepairState.NEGOTIATING},
    RouterEvent.BIDS_COUNTED: {RepairState.NEGOTIATING: RepairState.WATCHING},
    RouterEvent.WINNER_MISSED: {RepairState.WATCHING: RepairState.NEGOTIATING},
    RouterEvent.ROUND_OVER: {
        RepairState.ASKING: RepairState.AT_REST,
        RepairState.NEGOTIATING: RepairState.AT_REST,
        RepairState.WATCHING: RepairState.AT_REST,
    },
    RouterEvent.NO_NEIGHBOURS: {RepairState.LOST: RepairState.AT_REST},
    RouterEvent.TOOK_OFF: {state: RepairState.FLYING for state in RepairState},
    RouterEvent.LANDED: {RepairState.FLYING: RepairState.AT_REST},
    RouterEvent.ANTENNA_OFF: _ALL_BUT_FLYING_TO_REST,
}
"""An event without an entry leaves the repair unchanged."""


class RouterStates:
    """The current states of one router. Its attributes change only in `happened`.

    Read for each packet, hence plain attributes.
    """

    def __init__(self) -> None:
        self.connection = ConnectionState.SEARCHING
        self.repair = RepairState.AT_REST
        self.connected = False  # the gateway answered the last heartbeat, or may still answer it
        self.awaiting = False  # a heartbeat to the gateway is under way
        self.nothing_to_repair = False  # connected, and the repair at rest

    def happened(self, event: RouterEvent) -> None:
        """Change the states. Raises RuntimeError and changes nothing if `event` is impossible."""
        connections = CONNECTION_TRANSITIONS.get(event)
        repairs = REPAIR_TRANSITIONS.get(event)
        try:
            connection = self.connection if connections is None else connections[self.connection]
            repair = self.repair if repairs is None else repairs[self.repair]
        except KeyError:
            raise RuntimeError(
                f"{event.name} cannot happen to a router that is {self.connection.value} "
                f"and {self.repair.value}"
            ) from None
        self.connection, self.repair = connection, repair
        self.connected = connection in _CONNECTED
        self.awaiting = connection in _AWAITING
        self.nothing_to_repair = self.connected and repair is RepairState.AT_REST
