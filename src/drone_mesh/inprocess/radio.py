"""The in-process radio: an ideal disc that can lose, delay and cut."""

from __future__ import annotations

import math
import random
from typing import Callable, Iterable, Mapping

from drone_mesh.communication.interfaces import IMeshDebugInfo, IMeshNetwork
from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.communication.wire.messages import copies_for, hop
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.close_pairs import ClosePairs, by_axis
from drone_mesh.inprocess.interfaces import Host, IInProcessAir, IInProcessAntenna

HOP_DELAY_S = 0.002  # an acknowledged packet takes 1.9 ms on the air (nRF24L01+, 250 kbit/s)

Deliver = Callable[[bytes], None]
"""Passes a packet to the mesh component of one node and schedules its next tick."""


def _ignore(_payload: bytes) -> None:
    """A packet reached an antenna without power, or one that was stopped."""


class InProcessAir(IInProcessAir):
    """Which nodes hear each other, and which packets are lost, delayed or cut off."""

    clock: VirtualClock
    hears: Callable[[int, int], bool] | None

    def __init__(
        self,
        clock: VirtualClock,
        rng: random.Random,
        max_distance_m: float = RANGE_M,
        loss: float = 0.0,
        delay_s: float = HOP_DELAY_S,
        jitter_s: float = 0.0,
    ) -> None:
        """`loss`: share of packets that do not arrive; the sender notices the loss.

        A packet arrives after `delay_s` and a random part of `jitter_s`.
        """
        self.clock = clock
        self._rng = rng
        self.max_distance_m = max_distance_m
        self.loss = loss
        self._delay_s = delay_s
        self._jitter_s = jitter_s
        self._antennas: dict[int, InProcessAntenna] = {}
        self._ids: set[int] = set()  # of all antennas, also before they start and after they stop
        self._cut: set[frozenset[int]] = set()
        self.hears = None
        self.jammed = False  # a jammer, heard everywhere: no packet arrives; set by experiments
        # Whether two places within range hear each other; set if there are obstacles.
        self.sees: Callable[[Location, Location], bool] | None = None
        # Whether a packet may arrive at all; set by experiments that count packets or lose some.
        self.carries: Callable[[bytes], bool] | None = None
        # The links between nodes at rest: looked up for each packet, and changed only when a node
        # appears, disappears or flies.
        self._links: dict[int, dict[int, InProcessAntenna]] = {}
        self._standing: dict[int, Location] = {}  # their positions
        self._flying: set[int] = set()
        # Of nodes at rest, in the order of `_standing`; None: to be found.
        self._pairs: ClosePairs | None = None
        # Packets that leave at one time also arrive at one time: one event of the clock for all.
        self._under_way: list[tuple[InProcessAntenna, bytes]] = []
        self._left_s = -math.inf  # when those left
        self._delivered = 0  # before those

    @property
    def delivered(self) -> int:
        """The number of packets so far that a node receives or has received."""
        return self._delivered + len(self._under_way)

    def antenna(self, host: Host, rng: random.Random) -> InProcessAntenna:
        self._ids.add(host.node_id)
        return InProcessAntenna(self, host)

    def add(self, antenna: InProcessAntenna) -> None:
        """Add an antenna."""
        self._antennas[antenna.node_id] = antenna
        self._link(antenna.node_id)

    def remove(self, antenna: InProcessAntenna) -> None:
        """Remove an antenna."""
        self._unlink(antenna.node_id)
        self._antennas.pop(antenna.node_id, None)

    def flight(self, node: int, started: bool) -> None:
        if started:
            self._unlink(node)
            self._flying.add(node)
        else:
            self._flying.discard(node)
            self._link(node)

    def moved(self, nodes: Iterable[int]) -> None:
        """Pilots have flown these drones to other places; their links follow."""
        moved, standing = [node for node in nodes if node in self._standing], self._standing
        pairs = self._pairs
        if pairs is None or self.sees is not None:  # obstacles: each line of sight may differ
            for node in moved:
                self._unlink(node)
            for node in moved:
                self._link(node)
            if self.sees is None:
                self._pairs = ClosePairs(self.max_distance_m, by_axis(standing.values()))
            return
        for node in moved:
            standing[node] = self._antennas[node].drone.get_location()
        ids = list(standing)
        for one, other, near in pairs.moved_to(by_axis(standing.values())):
            self._set_link(ids[one], ids[other], near)

    def _set_link(self, one: int, other: int, near: bool) -> None:
        if not near:
            self._links[one].pop(other, None)
            self._links[other].pop(one, None)
        elif not self.is_cut(one, other):
            self._links[one][other] = self._antennas[other]
            self._links[other][one] = self._antennas[one]

    def cut(self, one: int, other: int, off: bool = True) -> None:
        """Cut the link between two nodes, or restore it. Raises ValueError for an unknown pair."""
        if one == other or not {one, other} <= self._ids:
            raise ValueError(f"no link between {one} and {other}: name two different nodes")
        (self._cut.add if off else self._cut.discard)(frozenset((one, other)))
        self._unlink(one)
        self._link(one)

    def is_cut(self, one: int, other: int) -> bool:
        """Whether `cut` ended the link between two nodes, wherever they are."""
        return frozenset((one, other)) in self._cut

    def in_range(self, node: int) -> dict[int, InProcessAntenna]:
        """By id: the antennas that `node` could reach if they were on. Do not modify."""
        links = self._links.get(node)
        if links is None:
            return self._heard_by(node, self._places(self._antennas))
        if self._flying:
            return {**links, **self._heard_by(node, self._places(self._flying))}
        return links

    def _places(self, nodes: Iterable[int]) -> dict[int, Location]:
        """The positions of those of these nodes that have an antenna."""
        antennas = self._antennas
        return {node: antennas[node].drone.get_location() for node in nodes if node in antennas}

    def _heard_by(self, node: int, others: Mapping[int, Location]) -> dict[int, InProcessAntenna]:
        antennas = self._antennas
        if node not in antennas:
            return {}
        here = antennas[node].drone.get_location()
        reach_m = self.max_distance_m
        heard = {
            other: antennas[other]
            for other, there in others.items()
            if math.dist(here, there) < reach_m
        }
        heard.pop(node, None)
        if self.sees is not None:
            heard = {n: heard[n] for n in heard if self.sees(here, others[n])}
        if self._cut:
            return {n: heard[n] for n in heard if not self.is_cut(node, n)}
        return heard

    def _link(self, node: int) -> None:
        """Find the links of a node at rest; nothing for a node in flight or without an antenna."""
        self._pairs = None
        if node in self._antennas and node not in self._flying:
            links = self._heard_by(node, self._standing)
            self._links[node] = links
            self._standing[node] = self._antennas[node].drone.get_location()
            for other in links:
                self._links[other][node] = self._antennas[node]

    def _unlink(self, node: int) -> None:
        self._pairs = None
        self._standing.pop(node, None)
        for other in self._links.pop(node, ()):
            del self._links[other][node]

    def send(self, payload: bytes) -> bool:
        """Send a packet; returns whether the sender learns that the receiver gets it."""
        if self.carries is not None and not self.carries(payload):
            return False
        from_, to = hop(payload)
        if self.hears is not None and not self.hears(from_, to):
            return False
        if self._flying and (from_ in self._flying or to in self._flying):
            other = self._heard_by(from_, self._places((to,))).get(to)
            taken = other is not None and self._hand_over(payload, other)
        else:
            try:
                other = self._links[from_][to]
            except KeyError:  # rarely: most packets are for a neighbour
                return False
            taken = self._hand_over(payload, other)
        return taken and (self.hears is None or self.hears(to, from_))  # its acknowledgement

    def broadcast(self, payload: bytes, node: int) -> None:
        """Hand a packet to each antenna in range of `node`, with its id in byte 3."""
        others, carries = self.in_range(node), self.carries
        if self.hears is not None:
            others = {other: others[other] for other in others if self.hears(node, other)}
        for copy, other in zip(copies_for(payload, others), others.values()):
            if carries is None or carries(copy):
                self._hand_over(copy, other)

    def _hand_over(self, payload: bytes, other: InProcessAntenna) -> bool:
        if not other.powered or self.jammed:
            return False
        if self.loss and self._rng.random() < self.loss:
            return False
        now_s = self.clock.now_s
        if now_s != self._left_s:
            self._next_to_leave(now_s)
        self._under_way.append((other, payload))
        return True

    def _next_to_leave(self, now_s: float) -> None:
        """The following packets leave at `now_s`; with jitter only one."""
        self._delivered += len(self._under_way)
        self._under_way = []
        at_s = now_s + self._delay_s
        if self._jitter_s:
            at_s += self._rng.random() * self._jitter_s
            self.clock.call_at(at_s, self._arrive, self._under_way)
        else:
            self._left_s = now_s
            self.clock.call_in_line(at_s, self._arrive, self._under_way)

    def _arrive(self, packets: list[tuple[InProcessAntenna, bytes]]) -> None:
        self._left_s = -math.inf  # without a delay, the answers leave at this time, too
        for antenna, payload in packets:
            deliver = antenna.deliver  # calling a local is faster than antenna.deliver(...)
            deliver(payload)


class InProcessAntenna(IInProcessAntenna):
    """One node's radio."""

    powered: bool

    def __init__(self, air: InProcessAir, host: Host) -> None:
        self.node_id = host.node_id
        self.drone = host.drone
        self.powered = True
        self._air = air
        self._host = host
        self._mesh: IMeshNetwork | None = None
        self.deliver: Deliver = _ignore  # called with each packet that arrives

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        self._mesh = mesh
        self._listen()
        self._air.add(self)

    def stop_antenna(self) -> None:
        self._mesh = None
        self._listen()
        self._air.remove(self)

    def send_message_to(self, payload: bytes) -> bool:
        return self.powered and self._air.send(payload)

    def broadcast_message(self, payload: bytes) -> None:
        if self.powered:
            self._air.broadcast(payload, self.node_id)

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Does nothing: the owner of the network can read its nodes."""

    def hears_power(self) -> bool | None:
        """Whether a jammer is on; a real chip is tuned to its channel and measures it (RPD)."""
        return self._air.jammed

    def switch_power(self, on: bool) -> None:
        self.powered = on
        self._listen()
        mesh = self._mesh
        if mesh is not None:
            self._host.submit(lambda now_s: mesh.on_antenna_power(on, now_s))

    def _listen(self) -> None:
        self.deliver = self._host.hear if self.powered and self._mesh is not None else _ignore
