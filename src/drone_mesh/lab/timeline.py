"""Executes the faults of a scenario in a running network."""

from __future__ import annotations

import contextlib
import math
import random
from dataclasses import dataclass
from typing import Callable, ContextManager, Iterable, Iterator, NamedTuple, Sequence

from drone_mesh.communication.data.outgoing import Ticket
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.errors import GoalRefused, QueueFull
from drone_mesh.inprocess import Network
from drone_mesh.lab.flights import Flights
from drone_mesh.lab.formations import Formations
from drone_mesh.lab.impairments import Impairments
from drone_mesh.lab.network_sample import NetworkSample, gateways_of
from drone_mesh.lab.picking import pick_drones
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.scenario_network import put_noise
from drone_mesh.lab.scenario_parts import Fault, StartCondition, parse_condition

HEALING_STARTS_WITH = frozenset({"kill", "mute", "deaf", "cut_link", "jam", "gateway_off"})
"""Faults from which the time to heal is measured."""

_FIRST = {
    MeshEventKind.FLIGHT_DECIDED: "the first flight",
    MeshEventKind.FLIGHT_ORDERED: "the first flight",
    MeshEventKind.LANDED: "the first landing",
    MeshEventKind.DISCONNECTED: "the first loss",
}


class Happened(NamedTuple):
    """One fault as it happened."""

    at_s: float
    action: str
    nodes: tuple[int, ...]


@dataclass
class OrderAttempt:
    """One flight order: when it was sent, and whether a next hop took it."""

    at_s: float
    node: int
    taken: bool


Observing = Callable[[], ContextManager[None]]
"""Observes the network before and after each fault that must be healed."""


class HandedIn(NamedTuple):
    """A user's message that a router took."""

    sender: int
    ticket: Ticket


class Timeline:
    """The faults of one run, on the network's clock."""

    def __init__(
        self,
        scenario: Scenario,
        network: Network,
        impairments: Impairments,
        flights: Flights,
        streams: Streams,
        observing: Observing,
    ) -> None:
        """Schedule the faults on the network's clock."""
        self.happened: list[Happened] = []
        self.orders: list[OrderAttempt] = []
        self.messages: list[HandedIn] = []
        self.messages_since_s = 0.0  # those that count
        self.first_disruption_s: float | None = None
        self._network, self._impairments, self._flights = network, impairments, flights
        self._scenario, self._streams = scenario, streams
        self._observing = observing
        self.formations = Formations(network, self.send_order)
        self._waiting: list[tuple[StartCondition, int]] = []
        self._seen: dict[str, float] = {}  # when a condition's event was first true
        self._events_read = 0
        for index, fault in enumerate(scenario.faults):
            if fault.at_s is not None:
                network.clock.call_at(fault.at_s, self._start, index)
            else:
                self._waiting.append((parse_condition(str(fault.when)), index))

    def check(self, sample: NetworkSample) -> None:
        """Start faults that wait for a condition; to be called with every sample."""
        if not self._waiting:
            return
        self._note_events(sample)
        waiting, self._waiting = self._waiting, []
        for condition, index in waiting:
            seen_s = self._seen.get(condition.event)
            if seen_s is None:
                self._waiting.append((condition, index))
            else:
                at_s = max(seen_s + condition.delay_s, sample.now_s)
                self._network.clock.call_at(at_s, self._start, index)

    def _note_events(self, sample: NetworkSample) -> None:
        if sample.alive and sample.served == sample.alive:
            self._seen.setdefault("all connected", sample.now_s)
            if self.first_disruption_s is not None and sample.now_s > self.first_disruption_s:
                self._seen.setdefault("healed", sample.now_s)
        died = {(item.at_s, node) for item in self.happened for node in item.nodes}
        for event in self._network.events[self._events_read :]:
            # A drone that is switched off loses its own connection at that moment: no such loss.
            is_death = (event.now_s, event.node) in died
            if event.kind in _FIRST and not is_death:
                self._seen.setdefault(_FIRST[event.kind], event.now_s)
        self._events_read = len(self._network.events)

    def _start(self, index: int) -> None:
        fault = self._scenario.faults[index]
        rng = self._streams.generator(f"fault {index}")
        act = getattr(self, f"_{fault.action}")
        if fault.action in HEALING_STARTS_WITH:
            nodes: list[int] = []
            with self.disruption(fault.action, nodes):
                nodes += act(fault, rng)
        else:
            self.note(fault.action, act(fault, rng))

    @contextlib.contextmanager
    def disruption(self, action: str, nodes: Sequence[int]) -> Iterator[None]:
        """Observe the network before and after a fault of these nodes, which must be healed."""
        if self.first_disruption_s is None:
            self.first_disruption_s = self._network.clock.now_s
        with self._observing():
            yield
            self.note(action, nodes)

    def note(self, action: str, nodes: Sequence[int]) -> None:
        self.happened.append(Happened(self._network.clock.now_s, action, tuple(nodes)))

    def _after(self, seconds: float | None, undo: Callable[[object], None]) -> None:
        if seconds is not None:
            self._network.clock.call_at(self._network.clock.now_s + seconds, undo, None)

    def _routers(self, alive: bool | None = None) -> list[int]:
        """All routers by id; those with power (or without) if `alive` is given."""
        return [
            node_id
            for node_id, node in sorted(self._network.nodes.items())
            if not node.is_gateway and alive in (None, node.antenna.powered)
        ]

    def _power(self, nodes: Iterable[int], on: bool) -> None:
        for node in nodes:
            self._network.power(node, on)

    def _picked(self, fault: Fault, rng: random.Random, alive: bool = True) -> list[int]:
        return pick_drones(fault.what, alive, self._network, self._impairments, rng)

    def _kill(self, fault: Fault, rng: random.Random) -> list[int]:
        nodes = self._picked(fault, rng)
        self._power(nodes, False)
        return nodes

    def _revive(self, fault: Fault, rng: random.Random) -> list[int]:
        nodes = self._picked(fault, rng, alive=False)
        self._power(nodes, True)
        return nodes

    def _mute(self, fault: Fault, rng: random.Random) -> list[int]:
        return self._break(fault, rng, self._impairments.one_way.mute)

    def _deaf(self, fault: Fault, rng: random.Random) -> list[int]:
        return self._break(fault, rng, self._impairments.one_way.deaf)

    def _break(self, fault: Fault, rng: random.Random, broken: set[int]) -> list[int]:
        nodes = self._picked(fault, rng)
        broken.update(nodes)
        self._after(fault.what.for_s, lambda _: broken.difference_update(nodes))
        return nodes

    def _cut_link(self, fault: Fault, rng: random.Random) -> list[int]:
        air, what = self._impairments.disc, fault.what
        if what.between is not None:
            links = [tuple(what.between)]
        else:
            links = sorted(
                (a, b) for a in sorted(self._network.nodes) for b in air.in_range(a) if a < b
            )
            links = rng.sample(links, min(what.number, len(links)))
        for a, b in links:
            air.cut(a, b)

        def restore(_: object) -> None:
            for a, b in links:
                air.cut(a, b, off=False)

        self._after(what.for_s, restore)
        return sorted({node for link in links for node in link})

    def _jam(self, fault: Fault, rng: random.Random) -> list[int]:
        what, jams = fault.what, self._impairments.jams
        if self._scenario.radio.kind != "disc":
            stop = put_noise(self._network, what, self._scenario.range_m, rng)
            self._after(what.for_s, lambda _: stop())
            return []
        jams.append(what)
        self._after(what.for_s, lambda _: jams.remove(what))
        return []

    def _gateway_off(self, fault: Fault, _rng: random.Random) -> list[int]:
        node = fault.what.id
        self._network.power(node, False)
        self._after(fault.what.for_s, lambda _: self._network.power(node, True))
        return [node]

    def _loss(self, fault: Fault, _rng: random.Random) -> list[int]:
        impairments, before = self._impairments, self._impairments.loss
        impairments.loss = fault.what.share
        self._after(fault.what.for_s, lambda _: setattr(impairments, "loss", before))
        return []

    def _battery(self, fault: Fault, rng: random.Random) -> list[int]:
        what, clock = fault.what, self._network.clock
        routers = self._routers()
        nodes = sorted(rng.sample(routers, round(what.share * len(routers))))
        if what.fly_m is not None:
            self._flights.limit(nodes, what.fly_m, self._die)
        if what.live_min is not None:
            for node in nodes:
                clock.call_at(clock.now_s + 60.0 * what.live_min, self._die, node)
        return nodes

    def _die(self, node: int) -> None:
        if self._network.nodes[node].antenna.powered:
            with self.disruption("battery empty", [node]):
                self._network.power(node, False)

    def _churn(self, fault: Fault, rng: random.Random) -> list[int]:
        what, clock = fault.what, self._network.clock
        end_s = math.inf if what.for_s is None else clock.now_s + what.for_s
        end_s = min(end_s, self._scenario.duration_s)
        for alive, per_min in ((True, what.deaths_per_min), (False, what.births_per_min)):
            at_s = clock.now_s
            while per_min:
                at_s += rng.expovariate(per_min / 60.0)
                if at_s >= end_s:
                    break
                clock.call_at(at_s, self._churn_one, (alive, rng.random()))
        routers, at_s = self._routers(), clock.now_s
        while what.switched and at_s < end_s:
            chosen = sorted(rng.sample(routers, min(what.switched, len(routers))))
            clock.call_at(at_s, self._switch, chosen)
            at_s += what.every_s
        return []

    def _switch(self, chosen: list[int]) -> None:
        powered = [n for n in chosen if self._network.nodes[n].antenna.powered]
        self._die_or_return(powered, False)
        self._die_or_return([n for n in chosen if n not in powered], True)

    def _die_or_return(self, nodes: list[int], on: bool) -> None:
        with self.disruption("birth" if on else "death", nodes):
            self._power(nodes, on)

    def _churn_one(self, what: tuple[bool, float]) -> None:
        alive, draw = what
        fit = self._routers(alive)
        if fit:
            self._die_or_return([fit[int(draw * len(fit))]], not alive)

    def _order(self, fault: Fault, rng: random.Random) -> list[int]:
        what = fault.what
        if what.id is not None:
            x, y, height = (*what.to, 0.0)[:3]
            self.send_order(what.id, x, y, int(height))
            return [what.id]
        clock = self._network.clock
        end_s = self._scenario.duration_s - 1.0
        if what.for_s is not None:
            end_s = min(end_s, clock.now_s + what.for_s)
        at_s = clock.now_s
        while at_s < end_s:
            clock.call_at(at_s, self._random_order, (rng.random(), rng.random(), what.within_m))
            at_s += what.every_s
        return []

    def _random_order(self, draws: tuple[float, float, float]) -> None:
        which, direction, within_m = draws
        fit = self._routers(alive=True)
        if fit:
            node = fit[int(which * len(fit))]
            here, angle = self._network.location(node), 2 * math.pi * direction
            x = here.longitude + within_m * math.cos(angle)
            y = here.latitude + within_m * math.sin(angle)
            self.send_order(node, x, y, 0)

    def _layouts(self, fault: Fault, rng: random.Random) -> list[int]:
        what, cases = fault.what, list(fault.what.cases)
        if what.shuffled:
            rng.shuffle(cases)
        self.formations.fly(cases, what.apart_s, what.at_once, what.ring_m)
        return []

    def send_order(self, node: int, x: float, y: float, height: int) -> None:
        """Order a drone to x, y (m) through the first gateway that is on.

        A goal outside the fence is refused to whoever gives the order, so there is none.
        """
        gateway = next(
            (g for g in gateways_of(self._network) if self._network.nodes[g].antenna.powered), None
        )
        try:
            taken = gateway is not None and self._network.order(
                node, x, y, height, gateway, allow_shared_place=True
            )
        except GoalRefused:
            return
        self.orders.append(OrderAttempt(self._network.clock.now_s, node, taken))

    def _send(self, fault: Fault, _rng: random.Random) -> list[int]:
        what, gateway = fault.what, gateways_of(self._network)[0]
        senders = [what.ids[number % len(what.ids)] for number in range(what.number)]
        self.messages_since_s = self.messages_since_s or self._network.clock.now_s
        for node in senders:
            with contextlib.suppress(QueueFull):  # the mesh was not offered it
                ticket = self._network.send(node, gateway, bytes(what.size), reliable=what.reliable)
                self.messages.append(HandedIn(node, ticket))
        return sorted(set(senders))

    def _load(self, fault: Fault, rng: random.Random) -> list[int]:
        what, clock = fault.what, self._network.clock
        self.messages_since_s = clock.now_s + what.counted_after_s
        at_s = clock.now_s
        while what.per_s:
            at_s += rng.expovariate(what.per_s)
            if at_s >= self._scenario.duration_s:
                break
            clock.call_at(at_s, self._send_one, (rng.random(), bytes(what.size)))
        return []

    def _send_one(self, what: tuple[float, bytes]) -> None:
        draw, payload = what
        fit = self._routers(alive=True)
        if not fit:
            return
        node, gateway = fit[int(draw * len(fit))], gateways_of(self._network)[0]
        with contextlib.suppress(QueueFull):  # the mesh was not offered it
            ticket = self._network.send(node, gateway, payload)
            if self._network.clock.now_s >= self.messages_since_s:
                self.messages.append(HandedIn(node, ticket))

    def _wind(self, fault: Fault, _rng: random.Random) -> list[int]:
        drones = [node.drone for node in self._network.nodes.values()]
        calm_m_s = self._scenario.speed_m_s

        def blow(speed_m_s: float) -> None:
            for drone in drones:
                drone.speed_m_s = speed_m_s

        blow(calm_m_s * fault.what.speed_factor)
        self._after(fault.what.for_s, lambda _: blow(calm_m_s))
        return []
