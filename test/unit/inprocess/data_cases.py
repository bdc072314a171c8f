"""Seeded cases: reliable messages while packets get lost and a relay disappears.

Run many of them with `python test/unit/inprocess/data_cases.py 1000`, on one channel that all
nodes share with `... data_cases.py 1000 shared`.
"""

from __future__ import annotations

import random
import sys

from drone_mesh.inprocess import Network
from drone_mesh.nrf24.emulator.links import IdealDisc, ScriptedLoss

SENDER = 9
_LADDER = {  # two ways from the gateway to node 9, with rungs between them
    1: (6.0, 0.0), 2: (12.0, 0.0), 3: (18.0, 0.0),
    4: (0.0, 6.0), 5: (6.0, 6.0), 6: (12.0, 6.0), 7: (18.0, 6.0), 9: (24.0, 3.0),
}  # fmt: skip


def play(seed, radio="disc"):
    """Play the case of this seed: the network, and by source and port what was sent."""
    rng = random.Random(f"data {seed}")
    loss, jitter_s = rng.choice((0.0, 0.02, 0.05, 0.1)), rng.choice((0.0, 0.003))
    if radio == "shared":
        frames = random.Random(f"loss {seed}")
        links = ScriptedLoss(IdealDisc(8.0), lambda _hop: frames.random() < loss)
        network = Network(seed=seed, radio="shared", links=links, max_distance_m=8.0)
    else:
        network = Network(seed=seed, loss=loss, jitter_s=jitter_s, max_distance_m=8.0)
    network.add_gateway(0, 0.0, 0.0)
    for node, (x, y) in _LADDER.items():
        network.add_router(node, x, y)
    if not network.run_until(network.all_connected, 60.0):
        raise RuntimeError(f"case {seed}: the mesh did not connect")
    network.run_for(rng.random() * 10.0)
    sent = {(source, port): [] for source in (0, SENDER) for port in (1, 2)}
    tickets = []

    def send(count):
        for _ in range(count):
            source, port = rng.choice(sorted(sent))
            size = rng.choice((0, 5, 17, 18, 300, 1024))
            payload = bytes(rng.randrange(256) for _ in range(size))
            sent[source, port].append(payload)
            tickets.append(network.send(source, SENDER - source, payload, port))

    send(rng.randint(4, 12))
    network.run_for(rng.random() * 0.06)
    path = network.path_to_gateway(SENDER) or [SENDER, 3, 2, 1, 0]
    relay = rng.choice(path[1:-1]) if len(path) > 2 else 3
    network.power(relay, False)
    network.run_for(rng.random())
    send(rng.randint(1, 8))
    if rng.random() < 0.5:
        network.run_for(rng.random() * 20.0)
        network.power(relay, True)
    network.run_until(lambda: all(ticket.final for ticket in tickets), 250.0)
    return network, sent, tickets


def run_case(seed, radio="disc"):
    """What went wrong in the case of this seed; an empty string: nothing."""
    network, sent, tickets = play(seed, radio)
    lost = [str(ticket) for ticket in tickets if ticket.state.value != "delivered"]
    if lost:
        return "; ".join(lost)
    for (source, port), payloads in sent.items():
        messages = network.received.get(SENDER - source, [])
        got = [message.payload for message in messages if message.port == port]
        if got != payloads:
            return f"port {port} of node {source}: sent {len(payloads)}, received {len(got)}"
    return ""


def main(count=1000, radio="disc"):
    failures = {}
    for seed in range(int(count)):
        problem = run_case(seed, radio)
        if problem:
            failures[seed] = problem
            print(f"case {seed}: {problem}", flush=True)
        if (seed + 1) % 100 == 0:
            print(f"{seed + 1} of {count} cases, {len(failures)} failed", flush=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
