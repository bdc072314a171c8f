"""Attacks that claim something in other nodes' names, and false beacons.

Like those in `attacks`.
"""

from __future__ import annotations

import functools
import itertools
import random
from typing import Callable, Iterator, Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    Beacon,
    Below,
    Motion,
)
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.lab.proofs.stranger import Stranger

CLAIMING_S = 60.0
OUTAGE_S = 300.0  # of the gateway, in which its routers step back to places that they know
FAR_AHEAD = 32_000  # counts
CLAIMS_PER_S = 24
ORDERED = (24, 19, 14, 9, 4, 3, 2, 1)  # drones, those far from the gateway first
ORDERED_M = 3.5  # to the west, where each keeps its neighbours
ORDER_PERIOD_S = 15.0
AHEAD = 10  # numbers of beacons
BEACON_ROOM = 20  # bytes, also with a seal
ELSEWHERE = Location(1500.0, 1500.0, 0.0)  # 2.1 km away; beacons tell places within 3.2 km


def far_counter(stranger: Stranger) -> None:
    """Claim, in a broadcast of each neighbour, a counter that is far ahead of its own.

    Epochs travel in the clear, when nodes answer challenges. An outsider has no network key.
    """
    chance = random.Random(stranger.node_id)
    stranger.listen()
    for _ in stranger.every(2.0, CLAIMING_S):
        near = stranger.in_range()
        victim, name = chance.sample(near, 2)
        junk = messages.packet(MessageType.HEARTBEAT, name, name, victim, victim, bytes(3))
        stranger.play(victim, junk[:-1] + b"\1")  # its receiver challenges `name`
        present = messages.present(name, NO_ROUTE, know_gateway=False)
        for node, (epoch, count) in stranger.epochs().items():
            for receiver in near:
                if node == name != receiver:
                    claim = messages.readdressed(present, receiver)
                    stranger.play(receiver, stranger.sealed_to_all(claim, epoch, count + FAR_AHEAD))


def own_names(stranger: Stranger) -> None:
    """Hand each neighbour packets that it seems to have created itself, as if they came back."""
    for _ in stranger.every(1.0 / CLAIMS_PER_S, CLAIMING_S):
        near = stranger.in_range()
        for place, node in enumerate(near):
            stranger.say(MessageType.HEARTBEAT, node, node, 0, b"\1\0\2", relay=near[place - 1])


def claimed_nonces(stranger: Stranger) -> None:
    """Claim nonces at the gateway in the names of drones, while the owner sends eight away."""
    network = stranger.network
    names = [node for node in network.nodes if node]
    kinds = (MessageType.PRESENT, MessageType.HEARTBEAT)
    claims = itertools.cycle(itertools.product(kinds, names))
    for drone in ORDERED:
        _order_away(stranger, drone)
        periods = stranger.every(1.0 / CLAIMS_PER_S, ORDER_PERIOD_S)
        for _, (kind, name) in zip(periods, claims):
            stranger.say(kind, name, 0, 0, b"\1\0\1")


def beacon_black_hole(stranger: Stranger) -> None:
    """Claim in beacons to be beside the gateway, with its next numbers, and forward nothing."""
    _beacons(stranger, ahead=1)


def beacons_ahead(stranger: Stranger) -> None:
    """Claim numbers that the gateway has not reached yet, so that its own seem old."""
    _beacons(stranger, AHEAD)


def beacons_of_all(stranger: Stranger) -> None:
    """Claim in beacons to lead to every drone, anew each time, while the owner sends eight away.

    The newest announcement of a drone counts. The stranger forwards nothing.
    """
    network = stranger.network
    for turn, drone in enumerate(ORDERED, 1):
        at_s = network.now_s() + turn * CLAIMING_S / 10
        network.clock.call_at(at_s, functools.partial(_order_away, stranger), drone)
    drones = tuple(node for node in network.nodes if node)
    _beacons(stranger, ahead=0, lists=(NONE_BELOW, Below(0, drones)))


def beacons_in_names(stranger: Stranger) -> None:
    """Say in beacons of each neighbour that it has no gateway and will be silent for long."""
    lost = Beacon(NO_ROUTE, 0, NO_ROUTE, NO_ROUTE, NO_ANCESTORS, 12.0).to_body(BEACON_ROOM)
    for _ in stranger.every(0.5, CLAIMING_S):
        for node, name in itertools.permutations(stranger.in_range(), 2):
            stranger.say(MessageType.BEACON, name, node, BROADCAST, lost)


def beacons_of_far_places(stranger: Stranger) -> None:
    """Say in beacons that the gateway, or who sends them, is far away; then the gateway is off."""
    motions = itertools.cycle((Motion(ELSEWHERE, (0.0, 0.0, 0.0)), None))
    for newest, motion in zip(_newest_numbers(stranger), motions):
        gateway_place = ELSEWHERE if motion is None else None
        for node, name in itertools.product(stranger.in_range(), _names(stranger)):
            hops, parent = (1, 0) if name else (0, NO_ROUTE)
            number = (newest + AHEAD) % 256
            beacon = Beacon(0, number, hops, parent, NO_ANCESTORS, 0.5, motion, gateway_place)
            if node != name:
                body = beacon.to_body(BEACON_ROOM)
                stranger.say(MessageType.BEACON, name, node, BROADCAST, body)
    stranger.network.power(0, False)
    stranger.network.run_for(OUTAGE_S)
    stranger.network.power(0, True)
    stranger.network.run_for(CLAIMING_S)


def _names(stranger: Stranger) -> list[int]:
    """Its own, and those of the nodes that hear it."""
    return [stranger.node_id, *stranger.in_range()]


def _order_away(stranger: Stranger, drone: int) -> None:
    """The owner sends a drone away."""
    network = stranger.network
    here = network.location(drone)
    goal = stranger.ordered[drone] = here._replace(longitude=here.longitude - ORDERED_M)
    network.order(drone, goal.longitude, goal.latitude, allow_shared_place=True)


def _beacons(stranger: Stranger, ahead: int, lists: Sequence[Below] = (NONE_BELOW,)) -> None:
    """Send beacons of a node beside the gateway, so many numbers ahead of its newest one.

    They take turns with the `lists` of the nodes below.
    """
    for newest, below in zip(_newest_numbers(stranger), itertools.cycle(lists)):
        beacon = Beacon(0, (newest + ahead) % 256, 1, 0, NO_ANCESTORS, 0.5, below=below)
        body = beacon.to_body(BEACON_ROOM)
        for node in stranger.in_range():
            stranger.say(MessageType.BEACON, stranger.node_id, node, BROADCAST, body)


def _newest_numbers(stranger: Stranger) -> Iterator[int]:
    """Twice a second the number of the gateway's latest beacon."""
    newest = 0

    def note(payload: bytes) -> None:
        nonlocal newest
        creator, _from, kind, _to, _forward = messages.header(payload)
        if kind == MessageType.BEACON and creator == 0:
            beacon = Beacon.from_body(messages.body(payload), None)
            newest = newest if beacon is None else beacon.number

    stranger.on_packet = note
    for _ in stranger.every(0.5, CLAIMING_S):
        yield newest


BY_BEACONS: tuple[Callable[[Stranger], None], ...] = (
    beacon_black_hole,
    beacons_ahead,
    beacons_of_all,
    beacons_in_names,
    beacons_of_far_places,
)
"""Those on meshes with the technique `beacon`."""
FOR_PACKETS_DOWN = (beacons_of_all,)
"""Those on the packets of the gateway; the others are on those for it."""
