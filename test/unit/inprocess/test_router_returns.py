"""Whatever happens to a router in whatever state: with a path to a gateway, it is connected again.

The cases are generated: each state that `router_states` declares, as a mesh reaches it that lost a
relay or flies by order, and a few moments later; each event, alone and while an answer is awaited.
"""

from __future__ import annotations

import functools
import struct
from typing import NamedTuple

import pytest

from drone_mesh.communication.control.router_states import ConnectionState, RepairState
from drone_mesh.errors import GoalRefused
from drone_mesh.inprocess import Network

PERIODS_S = 30.0  # three check periods
NEIGHBOUR = {1: 0, 3: 2, 4: 2}  # from which each router hears orders and claims
LATER_S = (0.0, 0.15, 0.45, 2.0)  # after the beginning of a state
# With each of these an answer is awaited and the relay returns, or not: for each pair of the three
# there is a case.
WAYS = [
    (later_s, awaits, awaits != bool(number % 2))
    for number, later_s in enumerate(LATER_S)
    for awaits in (False, True)
]


class Moment(NamedTuple):
    """The state of a router, and when it begins."""

    connection: ConnectionState
    repair: RepairState
    on_ground: bool
    router: int
    at_s: float


def mesh(strategy):
    """Gateway 0, relays 1 and 2, and behind 2 the routers 3 and 4, of which 4 is farther away."""
    network = Network(seed=1, repair=strategy)
    network.add_gateway(0, 0.0, 0.0)
    for router, x in ((1, 7.0), (2, 14.0), (3, 20.0), (4, 21.5)):
        network.add_router(router, x, 0.0)
    network.clock.call_at(10.0, lambda _: network.power(2, False), None)
    network.clock.call_at(12.0, lambda _: give_order(network, 1, 6.0, 3.0), None)
    return network


@functools.lru_cache(maxsize=None)
def moments(strategy):
    """The first moment of each state of each router, without any event."""
    network, found, last = mesh(strategy), {}, {}
    while network.now_s() < 100.0:
        network.clock.run_until(network.clock.next_event_s())
        for router in (1, 3, 4):
            component = network.nodes[router].component
            states, on_ground = component._states, component.get_repair_status().landed
            state = (states.connection, states.repair, on_ground, router)
            if last.setdefault(router, state) != state:
                last[router] = state
                found.setdefault(state, Moment(*state, network.now_s()))
    return tuple(found.values())


def give_order(network, router, x, y):
    """An order to (x, y) that gateway 0 sent arrives."""
    body = struct.pack("<ffh", y, x, 0)
    network.inject(
        router, (bytes((0, NEIGHBOUR[router], 6, router, router)) + body).ljust(32, b"\0")
    )


def claim_a_gateway(network, router):
    """A neighbour says that it is connected to gateway 9; the router sends a heartbeat there."""
    neighbour = NEIGHBOUR[router]
    heartbeat = bytes((neighbour, neighbour, 4, router, router, 1, 9, 2))
    network.inject(router, heartbeat.ljust(32, b"\0"))


# The events. Each returns what ends it, if anything does.


def antenna_off(network, router):
    network.power(router, False)
    return lambda: network.power(router, True)


def medium_lost(network, _router):
    network.air.carries = lambda _payload: False

    def back():
        network.air.carries = None

    return back


def order_near_a_relay(network, router):
    give_order(network, router, *((7.0, -3.0) if router == 1 else (13.0, -3.0)))


def order_a_step_aside(network, router):
    here = network.location(router)
    give_order(network, router, here.longitude - 1.0, here.latitude)


def goals_refused(network, router):
    def refuse(*_goal):
        raise GoalRefused("no path")

    drone = network.nodes[router].drone
    drone.set_goal = refuse
    order_near_a_relay(network, router)
    return lambda: vars(drone).pop("set_goal")


def goals_lost(network, router):
    """The engine is told of a goal and does not fly."""
    drone = network.nodes[router].drone
    drone.set_goal = lambda *_goal: None
    order_near_a_relay(network, router)
    return lambda: vars(drone).pop("set_goal")


def restart(network, router):
    network.restart(router)


def battery_empty(network, router):
    """The drone comes down where it is, and remains there."""
    drone = network.nodes[router].drone
    here = drone.get_location()
    drone.set_goal(here.latitude, here.longitude, 0.0)
    drone._why_not_fly = "its battery is empty"


THAT_END = [antenna_off, goals_lost, medium_lost, goals_refused]
EVENTS = [*THAT_END, order_near_a_relay, order_a_step_aside, restart, battery_empty]


def test_the_cases_contain_each_declared_state():
    assert {moment.repair for moment in moments("thesis")} == set(RepairState)
    assert {moment.connection for moment in moments("thesis")} == set(ConnectionState)
    assert any(moment.on_ground for moment in moments("thesis"))


@pytest.mark.parametrize(
    ("strategy", "event", "lasts_s"),
    [
        ("thesis", antenna_off, 0.7),
        *(
            pytest.param(strategy, event, lasts_s, marks=pytest.mark.slow)
            for strategy in ("thesis", "follow")
            for event, lasts_s in [*((e, 0.7) for e in EVENTS), *((e, 12.0) for e in THAT_END)]
            if (strategy, event, lasts_s) != ("thesis", antenna_off, 0.7)
        ),
    ],
)
def test_a_router_with_a_path_is_connected_again_within_three_check_periods(
    strategy, event, lasts_s
):
    """Of `follow` only those moments in which a strategy has something to decide.

    Its other base, `nearest`, has no states of its own.
    """
    failed = []
    for moment in moments(strategy):
        if strategy != "thesis" and moment.repair is RepairState.AT_REST:
            continue
        for later_s, awaits, relay_returns in WAYS:
            network = mesh(strategy)
            network.run_for(moment.at_s + later_s)
            if awaits:
                claim_a_gateway(network, moment.router)
            end = event(network, moment.router)
            network.run_for(lasts_s)
            if end is not None:
                end()
            if relay_returns:
                network.power(2, True)
            cut_off = cut_off_in_spite_of_a_path(network)
            if cut_off is not None:
                failed.append((moment, later_s, awaits, relay_returns, cut_off))
    assert failed == []


def cut_off_in_spite_of_a_path(network):
    """A node that rests with a path for three check periods and is not a connected relay.

    None as soon as all such nodes have worked for more than a check period.
    """
    works_s = dict.fromkeys(network.nodes, network.now_s())  # until when it worked or had no path
    troubled_s = network.now_s()  # until when any did not
    for _ in range(50):
        network.run_for(1.0)
        now_s, with_path = network.now_s(), network.shortest_hops()
        for node, at in network.nodes.items():
            states = getattr(at.component, "_states", None)
            is_relay = states is None or states.repair is not RepairState.FLYING
            flies = at.drone.path is not None
            works = flies or node not in with_path or (is_relay and network.connected(node))
            if works:
                works_s[node] = now_s
            if flies or not works:
                troubled_s = now_s
            if now_s - works_s[node] > PERIODS_S:
                return node
        if now_s - troubled_s > 1.2 * PERIODS_S / 3:
            break
    return None
