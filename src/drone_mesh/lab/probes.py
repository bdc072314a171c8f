"""Probes: messages and echoes between two nodes that had a path to each other at the time.

Up, down and echo are between a gateway and a random router; those of kind "any" between two random
nodes.
"""

from __future__ import annotations

import contextlib
import random
from dataclasses import dataclass

from drone_mesh.communication.data.outgoing import TO_GATEWAY
from drone_mesh.communication.data.transport import EchoAnswer
from drone_mesh.errors import MeshError
from drone_mesh.inprocess import Network
from drone_mesh.lab.network_sample import gateways_of, physical_graph
from drone_mesh.lab.scenario import Probes

KINDS = ("up", "down", "echo", "any")
PORT = 77  # of these messages


@dataclass
class ProbeFate:
    """One message or echo, and its fate."""

    kind: str  # one of KINDS
    node: int  # the router; of kind "any" the receiver
    sent_s: float
    shortest: int  # hops of the shortest path over existing links
    delay_s: float | None = None  # until it arrived, or until the answer; None: not in time
    hops: int | None = None  # echo: of its way out


class ProbeSender:
    """Sends the probes of one run, at random times and for random drones of a stream of its own."""

    def __init__(self, network: Network, probes: Probes, end_s: float, rng: random.Random) -> None:
        self.sent: list[ProbeFate] = []
        self._network, self._probes = network, probes
        last_s = end_s - probes.within_s
        count = int(probes.per_s * max(0.0, last_s - probes.from_s))
        for kind in KINDS[:-1] if probes.between == "gateway" else KINDS[-1:]:
            for _ in range(count):
                at_s, draws = rng.uniform(probes.from_s, last_s), [rng.random()]
                if kind == "any":  # first the sender, then the receiver
                    draws.append(rng.random())
                network.clock.call_at(at_s, self._send, (kind, draws))

    def results(self) -> list[ProbeFate]:
        """The probes with the fates of the messages; to be called once, at the end."""
        arrived = {
            int.from_bytes(message.payload, "big"): (node, message.received_s)
            for node, messages in self._network.received.items()
            for message in messages
            if message.port == PORT
        }
        gateways = set(gateways_of(self._network))
        for number, probe in enumerate(self.sent):
            if probe.kind == "echo" or number not in arrived:
                continue
            node, received_s = arrived[number]
            if node in gateways if probe.kind == "up" else node == probe.node:
                self._note(probe, received_s - probe.sent_s)
        return self.sent

    def _send(self, what: tuple[str, list[float]]) -> None:
        kind, (*draw_sender, draw) = what
        network, graph = self._network, physical_graph(self._network)
        reliable = self._probes.reliable
        senders = gateways_of(network)
        if draw_sender:
            nodes = sorted(graph.near)
            senders = [nodes[int(draw_sender[0] * len(nodes))]]
        hops = graph.hops_from(senders)
        fit = [node for node in sorted(hops) if node not in senders]
        if not fit:
            return
        node = fit[int(draw * len(fit))]
        payload = len(self.sent).to_bytes(4, "big")
        probe = ProbeFate(kind, node, network.clock.now_s, hops[node])
        self.sent.append(probe)
        with contextlib.suppress(MeshError):  # its queue is full, for example: the probe is lost
            if kind == "up":
                network.send(node, TO_GATEWAY, payload, PORT, reliable)
                return
            sender = next(one for one in senders if graph.hops_from([one]).get(node) == hops[node])
            if kind == "echo":
                network.echo(sender, node, lambda answer: self._answered(probe, answer))
            else:
                network.send(sender, node, payload, PORT, reliable)

    def _answered(self, probe: ProbeFate, answer: EchoAnswer) -> None:
        probe.hops = answer.hops
        self._note(probe, answer.round_trip_s)

    def _note(self, probe: ProbeFate, delay_s: float) -> None:
        if delay_s <= self._probes.within_s:
            probe.delay_s = delay_s
