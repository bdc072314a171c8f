"""Attacks that claim something in other nodes' names, and false beacons.

Like those in `attacks`.
"""

from __future__ import annotations

import functools
import itertools
import random
from typing import Callable, Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, NONE_BELOW, Beacon, Below
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.lab.proofs.stranger import Stranger

CLAIMING_S = 60.0
FAR_AHEAD = 32_000  # counts
CLAIMS_PER_S = 24
ORDERED = (24, 19, 14, 9, 4, 3, 2, 1)  # drones, those far from the gateway first
ORDERED_M = 3.5  # to the west, where each keeps its neighbours
ORDER_PERIOD_S = 15.0
AHEAD = 10  # numbers of beacons
BEACON_ROOM = 20  # bytes, also with a seal


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
    newest = 0

    def note(payload: bytes) -> None:
        nonlocal newest
        creator, _from, kind, _to, _forward = messages.header(payload)
        if kind == MessageType.BEACON and creator == 0:
            beacon = Beacon.from_body(messages.body(payload), None)
            newest = newest if beacon is None else beacon.number

    stranger.on_packet = note
    for _, below in zip(stranger.every(0.5, CLAIMING_S), itertools.cycle(lists)):
        beacon = Beacon(0, (newest + ahead) % 256, 1, 0, NO_ANCESTORS, 0.5, below=below)
        body = beacon.to_body(BEACON_ROOM)
        for node in stranger.in_range():
            stranger.say(MessageType.BEACON, stranger.node_id, node, BROADCAST, body)


BY_BEACONS: tuple[Callable[[Stranger], None], ...] = (
    beacon_black_hole,
    beacons_ahead,
    beacons_of_all,
    beacons_in_names,
)
"""Those on meshes with the technique `beacon`."""
FOR_PACKETS_DOWN = (beacons_of_all,)
"""Those on the packets of the gateway; the others are on those for it."""
