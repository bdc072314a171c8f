"""The states of a router and their transitions."""

from __future__ import annotations

import itertools

import pytest

from drone_mesh.communication.router_states import (
    LINK_TRANSITIONS,
    REPAIR_TRANSITIONS,
    Link,
    Repair,
    RouterEvent,
    RouterStates,
)


def at(link, repair):
    states = RouterStates()
    states.link, states.repair = link, repair
    return states


def test_a_router_begins_searching_and_at_rest():
    states = RouterStates()
    assert (states.link, states.repair) == (Link.SEARCHING, Repair.AT_REST)
    assert not states.connected
    assert not states.awaiting


def test_each_event_moves_one_of_the_two_states_at_least():
    assert set(RouterEvent) == set(LINK_TRANSITIONS) | set(REPAIR_TRANSITIONS)


def test_each_state_can_be_reached():
    known = {(Link.SEARCHING, Repair.AT_REST)}
    while True:
        reached = set(known)
        for (link, repair), event in itertools.product(known, RouterEvent):
            states = at(link, repair)
            try:
                states.happened(event)
            except RuntimeError:
                continue
            reached.add((states.link, states.repair))
        if reached == known:
            break
        known = reached
    assert {link for link, _ in known} == set(Link)
    assert {repair for _, repair in known} == set(Repair)


@pytest.mark.parametrize(
    ("link", "repair", "event"),
    [
        (Link.SEARCHING, Repair.AT_REST, RouterEvent.ANSWER_MISSED),
        (Link.CONNECTED, Repair.AT_REST, RouterEvent.LOSS_NOTICED),
        (Link.SEARCHING, Repair.FLYING, RouterEvent.LOSS_NOTICED),
        (Link.SEARCHING, Repair.AT_REST, RouterEvent.BID),
        (Link.SEARCHING, Repair.FLYING, RouterEvent.BID),
        (Link.SEARCHING, Repair.LOST, RouterEvent.BIDS_COUNTED),
        (Link.CONNECTED, Repair.AT_REST, RouterEvent.LANDED),
    ],
)
def test_an_event_that_cannot_happen_is_refused_and_changes_nothing(link, repair, event):
    states = at(link, repair)
    with pytest.raises(RuntimeError, match=f"{event.name} cannot happen"):
        states.happened(event)
    assert (states.link, states.repair) == (link, repair)


def test_a_connected_router_that_awaits_an_answer_still_counts_as_connected():
    states = at(Link.CONNECTED, Repair.AT_REST)
    states.happened(RouterEvent.HEARTBEAT_SENT)
    assert states.connected
    assert states.awaiting
    states.happened(RouterEvent.ANSWER_MISSED)
    assert not states.connected


def test_a_lost_router_stays_lost_while_it_tries_another_gateway():
    states = at(Link.SEARCHING, Repair.LOST)
    states.happened(RouterEvent.HEARTBEAT_SENT)
    assert (states.link, states.repair) == (Link.AWAITING_FIRST_ANSWER, Repair.LOST)
    states.happened(RouterEvent.GATEWAY_ANSWERED)
    assert (states.link, states.repair) == (Link.CONNECTED, Repair.AT_REST)


def test_switching_the_antenna_off_does_not_end_a_flight():
    states = at(Link.CONNECTED, Repair.FLYING)
    states.happened(RouterEvent.ANTENNA_OFF)
    assert (states.link, states.repair) == (Link.SEARCHING, Repair.FLYING)
