"""Attacks that claim something in other nodes' names, and false beacons.

Like those in `attacks`.
"""

from __future__ import annotations

import functools
import itertools
import random
from typing import Callable, Iterable, Iterator, Sequence

from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    Beacon,
    Below,
    Motion,
    newer,
)
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.radio import InProcessAir
from proofs.stranger import Stranger

CLAIMING_S = 60.0
OUTAGE_S = 300.0  # of the gateway, in which its routers step back to places that they know
FAR_AHEAD = 32_000  # counts
CLAIMS_PER_S = 24
ORDERED = (24, 19, 14, 9, 4, 3, 2, 1)  # drones, those far from the gateway first
ORDERED_M = 3.5  # to the west, where each keeps its neighbours
ORDER_PERIOD_S = 15.0
AHEAD = 10  # numbers of beacons
LIE_M = 8.0  # less than the range
MOST_AHEAD = 127  # of them; one more would be an old one
LONGEST_S = 6.35  # that a beacon can say until the next one
SILENT_TURNS = 32  # of half a second
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
        order_west(stranger, drone)
        periods = stranger.every(1.0 / CLAIMS_PER_S, ORDER_PERIOD_S)
        for _, (kind, name) in zip(periods, claims):
            stranger.say(kind, name, 0, 0, b"\1\0\1")


def beacon_black_hole(stranger: Stranger) -> None:
    """Claim in beacons to be one hop from the gateway, and nearer to it, and forward nothing."""
    _beacons(stranger, ahead=1)


def beacons_ahead(stranger: Stranger) -> None:
    """Claim numbers that the gateway has not reached yet, so that its own seem old."""
    _beacons(stranger, AHEAD)


def beacons_of_all(stranger: Stranger) -> None:
    """Claim in beacons to lead to every drone, anew each time, while the owner orders eight away.

    The newest announcement of a drone counts. The stranger forwards nothing.
    """
    _order_in_turn(stranger)
    drones = tuple(node for node in stranger.network.nodes if node)
    _beacons(stranger, ahead=0, lists=(NONE_BELOW, Below(0, drones)))


def beacons_near_all(stranger: Stranger) -> None:
    """Claim in beacons to hear every drone, while the owner orders eight away."""
    _order_in_turn(stranger)
    drones = [node for node in stranger.network.nodes if node]
    for newest, first in zip(_newest_numbers(stranger), itertools.cycle(range(0, 24, 8))):
        near = tuple(drones[first : first + 8])
        beacon = Beacon(0, newest, 1, 0, NO_ANCESTORS, LONGEST_S, near=near)
        _to_all(stranger, stranger.node_id, beacon)


def beacon_and_silence(stranger: Stranger) -> None:
    """Send one beacon that promises the next one in 6.35 s, the longest time, then be silent."""
    me = stranger.node_id
    for turn, newest in enumerate(_newest_numbers(stranger)):
        if turn % SILENT_TURNS == 1:
            number = (newest + 1) % 256
            _to_all(stranger, me, Beacon(0, number, 1, 0, NO_ANCESTORS, LONGEST_S))


def numbers_of_gateway(stranger: Stranger) -> None:
    """Say in the gateway's name a number that is 127 ahead, the most that counts as newer."""
    for newest in _newest_numbers(stranger):
        number = (newest + MOST_AHEAD) % 256
        _to_all(stranger, 0, Beacon(0, number, 0, NO_ROUTE, NO_ANCESTORS, 0.5))


def replayed_beacons(stranger: Stranger) -> None:
    """Play each beacon that it hears again, a second later, everywhere in the mesh."""
    network = stranger.network
    heard: list[bytes] = []
    stranger.on_packet = heard.append
    for _ in stranger.every(1.0, CLAIMING_S):
        old, heard[:] = list(heard), []
        for payload, node in itertools.product(old, network.nodes):
            creator, _from, kind, _to, _forward = messages.header(payload)
            if kind == MessageType.BEACON and creator != node and not stranger.mute:
                network.inject(node, messages.readdressed(payload, node))


def wormhole(stranger: Stranger) -> None:
    """Carry beacons, and what keys need to know each other, between those near it and the others.

    It carries nothing else, so the nodes of one side take those of the other for neighbours.
    """
    network, air = stranger.network, stranger.network.air
    assert isinstance(air, InProcessAir)
    near = set(stranger.in_range())
    latest: dict[int, bytes] = {}  # by node: its last beacon

    def play(payload: bytes, to: int) -> None:
        network.inject(to, messages.readdressed(payload, to))

    def overhear(payload: bytes) -> bool:
        _creator, from_, kind, to, _forward = messages.header(payload)
        whole = messages.readdressed(payload, BROADCAST)
        others: Iterable[int] = ()
        if from_ not in network.nodes:
            return True  # its own, of a captured node
        if kind in (MessageType.SEAL_CHALLENGE, MessageType.SEAL_ANSWER):
            others = (to,)
        elif kind == MessageType.BEACON and latest.get(from_) != whole:
            latest[from_] = whole
            others = network.nodes
        for other in others:
            if (other in near) != (from_ in near) and other not in network.links(from_):
                network.clock.call_at(network.now_s(), functools.partial(play, payload), other)
        return True

    if not stranger.mute:
        air.carries = overhear
    network.run_for(CLAIMING_S)
    air.carries = None


def resigned_gateway(stranger: Stranger) -> None:
    """Say once a second, in the gateway's name, that it has no internet, to every node."""
    near = stranger.in_range()
    for _ in stranger.every(1.0, CLAIMING_S):
        for node in stranger.network.nodes:
            if node:
                to = node if node in near else near[-1]
                stranger.say(MessageType.HEARTBEAT, 0, to, node, bytes((0, NO_ROUTE, 0)))
        for node in near:
            if node:
                stranger.say(MessageType.PRESENT, 0, node, BROADCAST, bytes((NO_ROUTE, 0)))


def false_departures(stranger: Stranger) -> None:
    """Say once a second, in the name of each neighbour, that it is about to fly far away."""
    for _ in stranger.every(1.0, CLAIMING_S):
        for node, name in itertools.permutations(stranger.in_range(), 2):
            now_s = stranger.network.now_s()
            notice = messages.own_location(ELSEWHERE, True, now_s, name, node)
            stranger.say(MessageType.LOCATION, name, node, BROADCAST, messages.body(notice))


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


def order_west(stranger: Stranger, drone: int) -> None:
    """The owner sends a drone away, to the west."""
    network = stranger.network
    here = network.location(drone)
    goal = stranger.ordered[drone] = here._replace(longitude=here.longitude - ORDERED_M)
    network.order(drone, goal.longitude, goal.latitude, allow_shared_place=True)


def _order_in_turn(stranger: Stranger) -> None:
    """The owner sends eight drones away, and no message, which would find the stranger out."""
    network = stranger.network
    for turn, drone in enumerate(ORDERED, 1):
        at_s = network.now_s() + turn * CLAIMING_S / 10
        network.clock.call_at(at_s, functools.partial(order_west, stranger), drone)


def _to_all(stranger: Stranger, name: int, beacon: Beacon) -> None:
    body = beacon.to_body(BEACON_ROOM)
    for node in stranger.in_range():
        if node != name:
            stranger.say(MessageType.BEACON, name, node, BROADCAST, body)


def _beacons(stranger: Stranger, ahead: int, lists: Sequence[Below] = (NONE_BELOW,)) -> None:
    """Send beacons of a node beside the gateway, so many numbers ahead of its newest one.

    They take turns with the `lists` of the nodes below.
    """
    for newest, below in zip(_newest_numbers(stranger), itertools.cycle(lists)):
        motion = None if below.listed else _nearer_place(stranger)
        beacon = Beacon(0, (newest + ahead) % 256, 1, 0, NO_ANCESTORS, 0.5, motion, below=below)
        _to_all(stranger, stranger.node_id, beacon)


def _nearer_place(stranger: Stranger) -> Motion:
    """Where it says it is: nearer to the gateway, as far as those beside it believe."""
    here, there = stranger.drone.get_location(), stranger.network.location(0)
    part = min(1.0, LIE_M / max(LIE_M, here.distance_m(there)))
    x, y = (a + part * (b - a) for a, b in zip(here.to_vector()[:2], there.to_vector()[:2]))
    return Motion(Location.from_vector((x, y, 0.0)), (0.0, 0.0, 0.0))


def _newest_numbers(stranger: Stranger) -> Iterator[int]:
    """Twice a second the newest number of the gateway's that it has heard, of whatever node."""
    newest: int | None = None

    def note(payload: bytes) -> None:
        nonlocal newest
        _creator, _from, kind, _to, _forward = messages.header(payload)
        if kind == MessageType.BEACON:
            beacon = Beacon.from_body(messages.body(payload), None)
            if beacon is not None and beacon.gateway == 0:
                known = beacon.number if newest is None else newest
                newest = beacon.number if newer(beacon.number, known) > 0 else known

    stranger.on_packet = note
    for _ in stranger.every(0.5, CLAIMING_S):
        yield newest or 0


BY_BEACONS: tuple[Callable[[Stranger], None], ...] = (
    beacon_black_hole,
    beacons_ahead,
    beacons_of_all,
    beacons_in_names,
    beacons_of_far_places,
    beacons_near_all,
    beacon_and_silence,
    numbers_of_gateway,
    replayed_beacons,
    wormhole,
)
"""Those on meshes with the technique `beacon`."""
FOR_PACKETS_DOWN = (beacons_of_all, beacons_near_all)
"""Those on the packets of the gateway; the others are on those for it."""
