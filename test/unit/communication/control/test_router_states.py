"""The states of a router and their transitions."""

from __future__ import annotations

import itertools

import pytest

from drone_mesh.communication.control.router_states import (
    CONNECTION_TRANSITIONS,
    REPAIR_TRANSITIONS,
    ConnectionState,
    RepairState,
    RouterEvent,
    RouterStates,
)


def at(connection, repair):
    states = RouterStates()
    states.connection, states.repair = connection, repair
    return states


def test_a_router_begins_searching_and_at_rest():
    states = RouterStates()
    assert (states.connection, states.repair) == (ConnectionState.SEARCHING, RepairState.AT_REST)
    assert not states.connected
    assert not states.awaiting


def test_each_event_moves_one_of_the_two_states_at_least():
    assert set(RouterEvent) == set(CONNECTION_TRANSITIONS) | set(REPAIR_TRANSITIONS)


def test_each_state_can_be_reached():
    known = {(ConnectionState.SEARCHING, RepairState.AT_REST)}
    while True:
        reached = set(known)
        for (connection, repair), event in itertools.product(known, RouterEvent):
            states = at(connection, repair)
            try:
                states.happened(event)
            except RuntimeError:
                continue
            reached.add((states.connection, states.repair))
        if reached == known:
            break
        known = reached
    assert {connection for connection, _ in known} == set(ConnectionState)
    assert {repair for _, repair in known} == set(RepairState)


@pytest.mark.parametrize(
    ("connection", "repair", "event"),
    [
        (ConnectionState.SEARCHING, RepairState.AT_REST, RouterEvent.ANSWER_MISSED),
        (ConnectionState.CONNECTED, RepairState.AT_REST, RouterEvent.LOSS_NOTICED),
        (ConnectionState.SEARCHING, RepairState.FLYING, RouterEvent.LOSS_NOTICED),
        (ConnectionState.SEARCHING, RepairState.AT_REST, RouterEvent.BID),
        (ConnectionState.SEARCHING, RepairState.FLYING, RouterEvent.BID),
        (ConnectionState.SEARCHING, RepairState.LOST, RouterEvent.BIDS_COUNTED),
        (ConnectionState.CONNECTED, RepairState.AT_REST, RouterEvent.LANDED),
    ],
)
def test_an_event_that_cannot_happen_is_refused_and_changes_nothing(connection, repair, event):
    states = at(connection, repair)
    with pytest.raises(RuntimeError, match=f"{event.name} cannot happen"):
        states.happened(event)
    assert (states.connection, states.repair) == (connection, repair)


def test_a_connected_router_that_awaits_an_answer_still_counts_as_connected():
    states = at(ConnectionState.CONNECTED, RepairState.AT_REST)
    states.happened(RouterEvent.HEARTBEAT_SENT)
    assert states.connected
    assert states.awaiting
    states.happened(RouterEvent.ANSWER_MISSED)
    assert not states.connected


def test_a_lost_router_stays_lost_while_it_tries_another_gateway():
    states = at(ConnectionState.SEARCHING, RepairState.LOST)
    states.happened(RouterEvent.HEARTBEAT_SENT)
    assert (states.connection, states.repair) == (
        ConnectionState.AWAITING_FIRST_ANSWER,
        RepairState.LOST,
    )
    states.happened(RouterEvent.GATEWAY_ANSWERED)
    assert (states.connection, states.repair) == (ConnectionState.CONNECTED, RepairState.AT_REST)


def test_switching_the_antenna_off_does_not_end_a_flight():
    states = at(ConnectionState.CONNECTED, RepairState.FLYING)
    states.happened(RouterEvent.ANTENNA_OFF)
    assert (states.connection, states.repair) == (ConnectionState.SEARCHING, RepairState.FLYING)
