"""Mutated packets: whatever arrives, a node drops or handles it, and keeps working."""

from __future__ import annotations

import random
from typing import Callable, NamedTuple

from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.communication.keys import Keys
from drone_mesh.drone.interfaces import Location
from drone_mesh.inprocess.network import Network
from drone_mesh.lab.stranger import Recorded, Tap

NODES = 6
SPACING_M = 6.0
PACKETS_PER_S = 500  # what a channel at 250 kbit/s takes
REPORT_EVERY = 10_000
_ROUND = 50  # packets between which simulated time passes


class FuzzResult(NamedTuple):
    """What became of a mesh in which mutated packets arrived."""

    packets: int
    moved: int  # drones that are not where they were
    connected: int  # routers, a minute after the last packet


def fuzz(
    packets: int,
    seed: int,
    key: Keys | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> FuzzResult:
    """Send so many packets to the nodes of a small mesh, each a recorded one with changes.

    An exception of a node ends it with an AssertionError that quotes the packet.
    """
    rng = random.Random(seed)
    network = Network(seed, key=key)
    network.add_fleet(1, NODES - 1, 3, SPACING_M)
    network.run_until(network.all_connected, within_s=60.0)
    record: list[Recorded] = []
    taps = {node: Tap(network, node, record) for node in network.nodes}
    for node, tap in taps.items():
        network.nodes[node].receiver = tap
    network.order(1, 3.0, 0.0)
    network.order(1, 0.0, 0.0)
    network.run_for(60.0)
    models = [recorded.payload for recorded in record]
    for node, tap in taps.items():
        network.nodes[node].receiver = tap.tapped
    places = {node: network.location(node) for node in network.nodes}
    for done in range(packets):
        receiver, payload = rng.randrange(NODES), mutated(rng.choice(models), rng)
        try:
            network.inject(receiver, payload)
        except Exception as error:
            raise AssertionError(f"packet {payload.hex()} for node {receiver}") from error
        if done % _ROUND == 0:
            network.run_for(_ROUND / PACKETS_PER_S)
        if done % REPORT_EVERY == 0:
            progress(done)
    network.run_for(60.0)
    return FuzzResult(packets, _moved(network, places), sum(map(network.connected, places)) - 1)


def mutated(payload: bytes, rng: random.Random) -> bytes:
    """The packet with some changes; seldom of another length."""
    changed = bytearray(payload)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        at = rng.randrange(len(changed))
        changed[at] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))
    if rng.random() < 0.02:
        return bytes(changed[: rng.randrange(PAYLOAD_BYTES)])
    return bytes(changed) + bytes(rng.random() < 0.01)


def _moved(network: Network, places: dict[int, Location]) -> int:
    return sum(network.location(node) != place for node, place in places.items())
