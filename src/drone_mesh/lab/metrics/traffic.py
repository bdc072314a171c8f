"""Metrics of traffic: packets by type, load of the air, orders."""

from __future__ import annotations

import math
import statistics
from collections import Counter, defaultdict
from typing import Sequence

from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.lab.impairments import Traffic
from drone_mesh.lab.metrics.registry import (
    METRICS,
    NAN,
    Metric,
    less,
    mean,
    metric,
    metrics,
    more,
    per_drone_and_s,
    ratio,
)
from drone_mesh.lab.record import RunRecord

NO_TRAFFIC = Traffic()
DELIVERED_WITHIN_S = 10.0  # an order that arrives later counts as lost


@less("packets", "packets handed to the radio; on the disc all tries, broadcasts once per receiver")
def packets(run: RunRecord) -> float:
    return sum(one.own + one.forwarded for one in run.traffic.values())


@less("1/s", "packets per drone and second")
def packet_rate(run: RunRecord) -> float:
    return per_drone_and_s(run, packets(run))


@less("bytes", "32 bytes for each of these packets")
def payload_bytes(run: RunRecord) -> float:
    return 32.0 * packets(run)


@metric(
    "share", "airtime of all frames per time, overlapping frames each counted; shared radio only"
)
def air_load(run: RunRecord) -> float:
    return NAN if run.air is None else run.air.airtime_s / run.end_s


@less("frames", "receptions that another frame destroyed; shared radio only")
def frames_destroyed(run: RunRecord) -> float:
    return NAN if run.air is None else run.air.destroyed


@less("", "tries of the driver per packet with a receiver; shared radio only")
def tries_per_packet(run: RunRecord) -> float:
    return NAN if run.air is None else ratio(run.air.tries, run.air.sent)


@less("packets", "packets that the driver gave up; shared radio only")
def given_up(run: RunRecord) -> float:
    return NAN if run.air is None else run.air.given_up


@metric("", "flight orders that were given")
def orders(run: RunRecord) -> float:
    return len(run.orders)


@metrics(
    "share",
    "more",
    order_delivery="orders whose drone set out within 10 s; empty: no orders",
    order_prompt="orders whose drone set out within 2 s; empty: no orders",
)
def orders_in_time(run: RunRecord) -> list[float]:
    delays = [math.inf if delay is None else delay for delay in _order_delays(run)]
    return [mean(delay <= most_s for delay in delays) for most_s in (DELIVERED_WITHIN_S, 2.0)]


@less("", "orders that neither arrived nor were reported as lost by the gateway")
def orders_unreported(run: RunRecord) -> float:
    reported = [
        (event.stamp_s, set(event.peers))
        for event in run.events
        if event.kind == MeshEventKind.NO_ROUTE.value and event.node in run.gateways
    ]
    return sum(
        delay is None
        and not any(
            order.node in peers and 0.0 <= stamp_s - order.at_s <= DELIVERED_WITHIN_S
            for stamp_s, peers in reported
        )
        for order, delay in zip(run.orders, _order_delays(run))
    )


@less("ms", "median time from an order to its drone's departure")
def order_delay_ms(run: RunRecord) -> float:
    delays = [delay for delay in _order_delays(run) if delay is not None]
    return 1000.0 * statistics.median(delays) if delays else NAN


@more("kbit/s", "users' data that arrived, from the first hand-in to the last arrival")
def data_rate(run: RunRecord) -> float:
    if not run.received:
        return 0.0 if run.messages else NAN
    seconds = max(message.received_s for message in run.received) - run.messages_since_s
    return ratio(sum(len(message.payload) for message in run.received) * 8 / 1000, seconds)


@more("share", "users' messages that arrived; reliable ones: as their sender knows")
def data_delivered(run: RunRecord) -> float:
    if run.messages and run.messages[0].ticket.reliable:
        return mean(one.ticket.state is TicketState.DELIVERED for one in run.messages)
    return ratio(len(run.received), len(run.messages))


@metric("1/s", "users' messages that the queues of the drones took")
def taken_rate(run: RunRecord) -> float:
    return ratio(len(run.messages), _counted_s(run))


@more("1/s", "users' messages that arrived")
def arrival_rate(run: RunRecord) -> float:
    return ratio(len(run.received), _counted_s(run))


def _counted_s(run: RunRecord) -> float:
    """The time in which messages count."""
    return max(0.0, run.end_s - run.messages_since_s)


@more("", "Jain's index of the share that arrived, over senders at equal hops; least of all hops")
def data_fairness(run: RunRecord) -> float:
    taken = Counter(one.sender for one in run.messages)
    arrived = Counter(message.sender for message in run.received)
    hops = run.end.graph.hops_from(run.gateways)
    shares: dict[int, list[float]] = defaultdict(list)
    for node in hops.keys() & taken.keys():
        shares[hops[node]].append(arrived[node] / taken[node])
    return min((jain_index(some) for some in shares.values() if any(some)), default=NAN)


def jain_index(values: Sequence[float]) -> float:
    """1: all are equal; 1/n: all but one are 0 (Jain, Chiu, Hawe 1984)."""
    return sum(values) ** 2 / (len(values) * sum(value * value for value in values))


def _order_delays(run: RunRecord) -> list[float | None]:
    """From each order to the departure that it caused, if there was one in time.

    A drone can have several orders under way: each departure belongs to the first that can have
    caused it.
    """
    departures: dict[int, list[float]] = defaultdict(list)
    for event in run.events:
        if event.kind == MeshEventKind.FLIGHT_ORDERED.value:
            departures[event.node].append(event.stamp_s)
    delays: list[float | None] = []
    for order in run.orders:
        left = departures[order.node]
        in_time = (s for s in left if 0.0 <= s - order.at_s <= DELIVERED_WITHIN_S)
        stamp_s = next(in_time, None) if order.taken else None
        if stamp_s is None:
            delays.append(None)
        else:
            left.remove(stamp_s)
            delays.append(stamp_s - order.at_s)
    return delays


def _note_traffic() -> None:
    """Register two columns per message type: sent by its creator, and forwarded."""
    for kind in MessageType:
        word = kind.name.lower()
        for attribute, name, words in (
            ("own", "own", "sent by their creators"),
            ("forwarded", "fwd", "forwarded for others"),
        ):

            def count(run: RunRecord, kind: int = int(kind), attribute: str = attribute) -> float:
                return float(getattr(run.traffic.get(kind, NO_TRAFFIC), attribute))

            METRICS[f"{name}_{word}"] = Metric(
                "packets", f"packets of this type {words}, tries included", count, "less",
                family=f"{name}_TYPE",
            )  # fmt: skip


_note_traffic()
