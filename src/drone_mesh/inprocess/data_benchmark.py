"""Throughput of users' data: `python3 -m drone_mesh.inprocess.data_benchmark --help`.

Real drivers on emulated chips, on one channel with exact times, under a virtual clock: the figures
do not depend on the machine. Nodes are in a line, 6 m apart, with a range of 9 m.
"""

from __future__ import annotations

import argparse
import random
import sys
from typing import NamedTuple, Sequence

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.communication.data.packets import MAX_MESSAGE_BYTES, count_of
from drone_mesh.communication.data.ticket import Ticket, TicketState
from drone_mesh.communication.data.transport import ReceivedMessage
from drone_mesh.communication.messages import BODY_BYTES
from drone_mesh.inprocess.network import Network
from drone_mesh.nrf24.emulator.air import CAPTURE_DB
from drone_mesh.nrf24.emulator.links import Hop, IdealDisc
from drone_mesh.nrf24.settings import DATA_RATES, RadioSettings

SPACING_M = 6.0
CONNECT_WITHIN_S = 120.0
END_WITHIN_S = 600.0  # for all messages


class DataCase(NamedTuple):
    """One row of the table."""

    rate: str
    hops: int
    flows: int
    loss: float
    reliable: bool


class Throughput(NamedTuple):
    """The result of a case."""

    kbit_s: float  # of payload, for all flows together
    delivered: float  # share of the messages
    bound_kbit_s: float
    connected: bool  # all nodes, at the end


class LossyDisc(IdealDisc):
    """Like IdealDisc, but a share of the frames arrives damaged, including acknowledgements."""

    def __init__(self, range_m: float, loss: float, rng: random.Random) -> None:
        super().__init__(range_m)
        self._loss = loss
        self._rng = rng

    def bit_errors(self, hop: Hop) -> int | None:
        errors = super().bit_errors(hop)
        return 1 if errors == 0 and self._rng.random() < self._loss else errors


def reuse_distance(settings: RadioSettings) -> int:
    """The least hops between two senders in the line that can send at once, each to its next node.

    A packet and its acknowledgement count as a whole: every frame of one pair has to arrive during
    every frame of the other, by the emulator's own rule of capture. Between the sender of one pair
    and the receiver of the other there is one hop less than between the senders.
    """
    capture_db = CAPTURE_DB[settings.data_rate.value]

    def power_dbm(one: int, other: int) -> float:
        distance_m = SPACING_M * abs(one - other)
        return IdealDisc(MAX_DISTANCE_M).received_dbm(distance_m, settings.power.value, 2400)

    def undisturbed(pair: tuple[int, int], others: tuple[int, int]) -> bool:
        return all(
            power_dbm(other, receiver) <= power_dbm(sender, receiver) - capture_db
            for sender, receiver in (pair, pair[::-1])
            for other in others
        )

    distance = 2  # a node cannot send and receive at once
    while not (
        undisturbed((0, 1), (distance, distance + 1))
        and undisturbed((distance, distance + 1), (0, 1))
    ):
        distance += 1
    return distance


def bound_kbit_s(settings: RadioSettings, hops: int) -> float:
    """The upper bound: one packet and its acknowledgement at a time in each neighbourhood.

    On k hops each packet is sent k times. The first node may send again while the one at the
    reuse distance does.
    """
    packets = count_of(MAX_MESSAGE_BYTES, BODY_BYTES)
    at_a_time = min(hops, reuse_distance(settings))
    return MAX_MESSAGE_BYTES * 8 / packets / settings.acknowledged_s / at_a_time / 1e3


def measure(case: DataCase, messages: int, seed: int) -> Throughput:
    """Send this many messages of 1024 bytes in total from the end of a line to its gateway.

    With several flows the messages come from the last nodes of the line in turn.
    """
    rng = random.Random(f"{seed} loss")
    links = LossyDisc(MAX_DISTANCE_M, case.loss, rng)
    mesh = Network(seed, radio="chips", rate=case.rate, links=links)
    try:
        return _measured(mesh, case, messages)
    finally:
        mesh.stop()


def _measured(mesh: Network, case: DataCase, messages: int) -> Throughput:
    mesh.add_gateway(0, 0.0, 0.0)
    for node in range(1, case.hops + 1):
        mesh.add_router(node, SPACING_M * node, 0.0)
    ends = [case.hops]
    for flow in range(1, case.flows):  # beside the last node, as far from the gateway
        ends.append(case.hops + flow)
        mesh.add_router(ends[-1], SPACING_M * case.hops, 0.1 * flow)
    mesh.run_until(mesh.all_connected, CONNECT_WITHIN_S)
    mesh.run_for(3.0)
    received: list[ReceivedMessage] = []
    tickets: list[Ticket] = []
    mesh.nodes[0].component.data.on_received(received.append)
    started_s, payload = mesh.now_s(), bytes(MAX_MESSAGE_BYTES)
    for number, end in enumerate(ends):
        share = messages // len(ends) + (number < messages % len(ends))
        tickets += [mesh.send(end, 0, payload, reliable=case.reliable) for _ in range(share)]
    mesh.run_until(lambda: all(ticket.final for ticket in tickets), END_WITHIN_S)
    if not case.reliable:  # wait for the last packets
        mesh.run_for(5.0)
    took_s = (received[-1].received_s if received else mesh.now_s()) - started_s
    delivered = len(received) / messages
    if case.reliable:
        delivered = sum(t.state is TicketState.DELIVERED for t in tickets) / messages
    return Throughput(
        len(received) * MAX_MESSAGE_BYTES * 8 / took_s / 1e3,
        delivered,
        bound_kbit_s(RadioSettings(data_rate=DATA_RATES[case.rate]), case.hops),
        mesh.all_connected(),
    )


def cases() -> list[DataCase]:
    """The rows of the table in docs/performance.md."""
    return [
        DataCase(rate, hops, flows, loss, reliable)
        for rate in DATA_RATES
        for hops in (1, 2, 4, 8)
        for flows in (1, 10)
        for loss in (0.0, 0.1)
        for reliable in ((False, True) if flows == 1 else (True,))
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(
        prog="drone_mesh.inprocess.data_benchmark",
        description="Measures the payload that the mesh carries, on emulated radios in simulated "
        "time: rates, hops, flows, lost frames.",
    )
    parser.add_argument(
        "--messages",
        type=int,
        default=40,
        help=f"number of messages of {MAX_MESSAGE_BYTES} bytes in each case (default %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="seed of all random choices (default %(default)s)"
    )
    parser.add_argument("--hops", type=int, help="run only the cases with this number of hops")
    parser.add_argument("--rate", choices=DATA_RATES, help="run only the cases with this rate")
    parsed = parser.parse_args(arguments)
    print("| rate | hops | flows | frames lost | messages | kbit/s | of the bound | delivered |")
    print("|---|---|---|---|---|---|---|---|")
    for case in cases():
        if parsed.hops not in (None, case.hops) or parsed.rate not in (None, case.rate):
            continue
        outcome = measure(case, parsed.messages, parsed.seed)
        kind = "reliable" if case.reliable else "best effort"
        share = outcome.kbit_s / outcome.bound_kbit_s
        note = "" if outcome.connected else ", a node is not connected"
        print(
            f"| {case.rate} | {case.hops} | {case.flows} | {case.loss:.0%} | {kind} | "
            f"{outcome.kbit_s:.1f} | {share:.0%} | {outcome.delivered:.0%}{note} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
