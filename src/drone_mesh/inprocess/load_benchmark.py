"""What users' messages do to a mesh: `python3 -m drone_mesh.inprocess.load_benchmark --help`.

A grid of nodes, 6 m apart with a range of 9 m, on the fast model of the shared channel or on
emulated chips. Random nodes send reliable messages to the gateway, at random moments; then the
busiest relay dies, or none.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections import Counter
from typing import NamedTuple, Sequence

from drone_mesh.arguments import MOST, whole
from drone_mesh.errors import QueueFull
from drone_mesh.inprocess.chip_air import ChipAir
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.shared_air import SharedAir
from drone_mesh.nrf24.settings import DATA_RATES

SPACING_M = 6.0
MESSAGE_BYTES = 16
CONNECT_WITHIN_S = 120.0
BEFORE_S = 20.0  # of load, before the death
SETTLE_S = 30.0  # after it


class Load(NamedTuple):
    """What the mesh did with a load."""

    offered: float  # messages/s that the nodes' queues took
    delivered: float  # messages/s that reached the gateway
    connected: float  # mean share of the nodes with a path
    frames: float  # per second
    fairness: float  # Jain's index of the share delivered, over senders at equal hops; the least


class _Traffic:
    """Random messages to the gateway."""

    def __init__(self, network: Network, rate: float, seed: int) -> None:
        self._network = network
        self._rate = rate
        self._rng = random.Random(f"{seed} load")
        self.senders = sorted(set(network.nodes) - {0})
        self.offered: Counter[int] = Counter()

    def begin(self) -> None:
        """Send from now on."""
        if self._rate:
            self._later()

    def _later(self) -> None:
        at_s = self._network.now_s() + self._rng.expovariate(self._rate)
        self._network.clock.call_at(at_s, self._send, None)

    def _send(self, _argument: None) -> None:
        sender = self._rng.choice(self.senders)
        try:
            self._network.send(sender, 0, bytes(MESSAGE_BYTES))
            self.offered[sender] += 1
        except QueueFull:
            pass  # it is not offered to the mesh
        self._later()


def measure(
    nodes: int,
    rate: float,
    seconds: float,
    seed: int,
    data_rate: str = "250k",
    unharmed: bool = False,
    radio: str = "shared",
) -> Load:
    """Offer `rate` messages/s to a mesh of so many nodes, of which one dies unless `unharmed`."""
    network = Network(seed=seed, radio=radio, rate=data_rate)
    network.add_fleet(routers=nodes - 1, gridsize=math.isqrt(nodes - 1), spacing=SPACING_M)
    network.run_until(network.all_connected, CONNECT_WITHIN_S)
    network.run_for(10.0)
    traffic = _Traffic(network, rate, seed)
    traffic.begin()
    network.run_for(BEFORE_S)
    if not unharmed:
        dead = busiest_relay(network)
        traffic.senders.remove(dead)
        network.power(dead, False)
    network.run_for(SETTLE_S)
    traffic.offered.clear()
    frames, received = _frames(network), len(network.received.get(0, ()))
    connected = 0.0
    for _ in range(round(seconds)):
        network.run_for(1.0)
        with_path = set(network.shortest_hops()) - {0}
        connected += sum(map(network.connected, with_path)) / len(with_path) / round(seconds)
    arrived = Counter(message.sender for message in network.received.get(0, [])[received:])
    return Load(
        sum(traffic.offered.values()) / seconds,
        sum(arrived.values()) / seconds,
        connected,
        (_frames(network) - frames) / seconds,
        fairness(network.shortest_hops(), traffic.offered, arrived),
    )


def busiest_relay(network: Network) -> int:
    """The router on most paths to the gateway."""
    paths = [network.path_to_gateway(node) or [] for node in network.nodes]
    return Counter(relay for path in paths for relay in path[1:-1]).most_common(1)[0][0]


def fairness(hops: dict[int, int], offered: Counter[int], arrived: Counter[int]) -> float:
    """Jain's index of the share delivered, among senders at equal hops; the least of all hops."""
    least = 1.0
    for distance in set(hops.values()):
        shares = [arrived[n] / offered[n] for n in hops if hops[n] == distance and offered[n]]
        if any(shares):
            squares = sum(share * share for share in shares)
            least = min(least, sum(shares) ** 2 / (len(shares) * squares))
    return least


def _frames(network: Network) -> int:
    assert isinstance(network.air, (SharedAir, ChipAir))
    return network.air.frames


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table, row by row."""
    parser = argparse.ArgumentParser(
        prog="drone_mesh.inprocess.load_benchmark",
        description="Offers a rising load of users' messages to a mesh that loses a relay.",
    )
    parser.add_argument("--nodes", type=whole(0, MOST), nargs="+", default=[26, 50])
    parser.add_argument("--offered", type=float, nargs="+", default=[0, 5, 10, 20, 40])
    parser.add_argument("--seconds", type=float, default=90.0, help="measured; %(default)s")
    parser.add_argument(
        "--seed", type=whole(0, MOST), default=1, help="of all choices; %(default)s"
    )
    parser.add_argument("--rate", choices=DATA_RATES, default="250k")
    parser.add_argument("--radio", choices=("shared", "chips"), default="shared")
    parser.add_argument("--unharmed", action="store_true", help="no relay dies")
    parsed = parser.parse_args(arguments)
    print("| nodes | offered/s | taken/s | delivered/s | connected | frames/s | fairness |")
    print("|---|---|---|---|---|---|---|")
    for nodes in parsed.nodes:
        for offered in parsed.offered:
            load = measure(
                nodes,
                offered,
                parsed.seconds,
                parsed.seed,
                parsed.rate,
                parsed.unharmed,
                parsed.radio,
            )
            print(
                f"| {nodes} | {offered:g} | {load.offered:.1f} | {load.delivered:.1f} | "
                f"{load.connected:.1%} | {load.frames:.0f} | {load.fairness:.2f} |"
            )
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
