"""Fuzzing with mutated packets: a node must drop or handle each of them and keep working."""

from __future__ import annotations

import random
from collections import deque
from typing import Callable, Iterable, Iterator, NamedTuple

from drone_mesh.communication.interfaces import BROADCAST, PAYLOAD_BYTES
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.inprocess.network import Network
from proofs.stranger import RecordedPacket, Tap

NODES = 6
SPACING_M = 6.0
PACKETS_PER_S = 500  # the capacity of a channel at 250 kbit/s
REPORT_EVERY = 10_000
_CORE = "drone_mesh.communication"
_ROUND = 50  # packets after which simulated time advances


class FuzzResult(NamedTuple):
    """The state of a mesh after mutated packets."""

    moved: int  # drones that have moved
    connected: int  # routers, a minute after the last packet


class Tables(NamedTuple):
    """How much the tables of some nodes hold."""

    largest: int  # entries of the largest one
    entries: int  # of all together


def fuzz(
    packets: int,
    seed: int,
    key: Keys | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> FuzzResult:
    """Send mutated packets, derived from recorded ones, to the nodes of a small mesh.

    Raises AssertionError, which quotes the packet, if a node raises an exception.
    """
    rng = random.Random(seed)
    network = _connected_mesh(seed, key)
    record: list[RecordedPacket] = []
    taps = {node: Tap(network, node, record) for node in network.nodes}
    for node, tap in taps.items():
        network.nodes[node].receiver = tap
    network.order(1, 3.0, 0.0, allow_shared_place=True)
    network.order(1, 0.0, 0.0, allow_shared_place=True)
    network.run_for(60.0)
    models = [recorded.payload for recorded in record]
    for node, tap in taps.items():
        network.nodes[node].receiver = tap.tapped
    places = {node: network.location(node) for node in network.nodes}
    for _ in _flood(network, packets, progress):
        receiver, payload = rng.randrange(NODES), mutated(rng.choice(models), rng)
        try:
            network.inject(receiver, payload)
        except Exception as error:
            raise AssertionError(f"packet {payload.hex()} for node {receiver}") from error
    network.run_for(60.0)
    moved = sum(network.location(node) != place for node, place in places.items())
    return FuzzResult(moved, sum(map(network.connected, places)) - 1)


def crowd(
    packets: int,
    seed: int,
    key: Callable[[int], Keys | None] | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Tables]:
    """Send packets of 254 invented nodes, all types and any bodies, to a small mesh.

    Returns what the tables of all nodes held after each half.
    """
    rng = random.Random(seed)
    network = _connected_mesh(seed, key)
    held = []
    for done in _flood(network, packets, progress):
        if done == packets // 2:
            held.append(tables(node.receiver for node in network.nodes.values()))
        receiver = rng.randrange(NODES)
        head = [rng.randrange(254), rng.randrange(254), rng.randrange(256), receiver]
        head.append(rng.choice((receiver, BROADCAST, rng.randrange(254))))
        body = bytes(rng.getrandbits(8) for _ in range(PAYLOAD_BYTES - len(head)))
        network.inject(receiver, bytes(head) + body)
    return [*held, tables(node.receiver for node in network.nodes.values())]


def _connected_mesh(seed: int, key: Keys | Callable[[int], Keys | None] | None) -> Network:
    network = Network(seed, key=key)
    network.add_fleet(1, NODES - 1, 3, SPACING_M)
    network.run_until(network.all_connected, within_s=60.0)
    return network


def _flood(network: Network, packets: int, progress: Callable[[int], None]) -> Iterator[int]:
    """Yield the number of each packet; simulated time passes after every _ROUND of them."""
    for done in range(packets):
        yield done
        if done % _ROUND == 0:
            network.run_for(_ROUND / PACKETS_PER_S)
        if done % REPORT_EVERY == 0:
            progress(done)


def tables(roots: Iterable[object]) -> Tables:
    """All tables of these objects and of the objects of the mesh core that they hold."""
    waiting, seen = list(roots), set()
    largest = entries = 0
    while waiting:
        item = waiting.pop()
        if id(item) in seen:
            continue
        seen.add(id(item))
        if isinstance(item, (dict, list, tuple, set, frozenset, deque)):
            largest, entries = max(largest, len(item)), entries + len(item)
            waiting += item.values() if isinstance(item, dict) else item
        elif type(item).__module__.startswith(_CORE):
            slots = [name for cls in type(item).__mro__ for name in getattr(cls, "__slots__", ())]
            waiting += [getattr(item, name) for name in slots if hasattr(item, name)]
            waiting += getattr(item, "__dict__", {}).values()
    return Tables(largest, entries)


def mutated(payload: bytes, rng: random.Random) -> bytes:
    """The packet with some changes, rarely of another length."""
    changed = bytearray(payload)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        at = rng.randrange(len(changed))
        changed[at] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))
    if rng.random() < 0.02:
        return bytes(changed[: rng.randrange(PAYLOAD_BYTES)])
    return bytes(changed) + bytes(rng.random() < 0.01)
