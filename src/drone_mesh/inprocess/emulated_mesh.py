"""A whole mesh on emulated radios: the real core on the real driver, under either clock.

Each node has three threads, as on a Raspberry Pi: two of the antenna, which receive and send, and
one that runs the mesh component. For tests and experiments, the benchmark, and for running the
programs without hardware.
"""

from __future__ import annotations

import random
from collections import deque
from typing import Any, Callable

from drone_mesh.channel.runtime import Task
from drone_mesh.communication.assembly import assemble_component
from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.gateway import MeshnetworkGateway
from drone_mesh.communication.observer import MeshEvent
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.inprocess.node import NoInternet
from drone_mesh.nrf24.airtime import NS_PER_S
from drone_mesh.nrf24.emulator.air import Air, Position
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import EmulatorClock
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings

Work = Callable[[float], None]

_STEP_S = 0.1  # period at which run_until checks its condition
_FLIGHT_STEP_S = 0.1  # a flying antenna moves in steps of this


class _AirTime:
    """The air's clock for drones in the same process."""

    def __init__(self, clock: EmulatorClock) -> None:
        self._clock = clock

    @property
    def now_s(self) -> float:
        return self._clock.runtime.now_s()

    def call_at(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        self._clock.call_at(round(at_s * NS_PER_S), function, argument)


class EmulatedNode:
    """One node. The antenna's threads fill its queue and the working thread empties it."""

    def __init__(
        self,
        air: Air,
        node_id: int,
        place: Position,
        settings: RadioSettings,
        rng: random.Random,
    ) -> None:
        self.node_id = node_id
        self.chip = EmulatedChip(air, f"node {node_id}", place)
        self._time = _AirTime(air.clock)
        self.drone = InProcessDrone(self._time, Location.from_vector(place), self._moves)
        self.radio = NRF24LowLevelInterface(
            self.chip.spi,
            self.chip.ce,
            self.chip.irq,
            node_id=node_id,
            settings=settings,
            runtime=air.clock.runtime,
            rng=rng,
        )
        self.antenna = NRF24HighLevelInterface(self.radio, self.submit, runtime=air.clock.runtime)
        self.component: MeshnetworkComponent
        self._runtime = air.clock.runtime
        self._queue: deque[Work] = deque()
        self._news = air.clock.signal()
        self._running = True
        self._working: Task | None = None

    def submit(self, work: Work) -> None:
        """Run this in the working thread."""
        self._queue.append(work)
        self._news.notify()

    def _moves(self, started: bool) -> None:
        """Move the antenna with the drone: in each step of a flight, and at its end."""
        self.chip.position = self.drone.get_location().to_vector()
        if started or self.drone.path is not None:
            self._time.call_at(self._time.now_s + _FLIGHT_STEP_S, self._moves, False)

    def start(self) -> None:
        """Start the mesh software."""
        self._working = self._runtime.start(self._work, f"mesh {self.node_id}")

    def stop(self) -> None:
        """Stop the mesh software, and wait until its threads have ended."""
        self._running = False
        self._news.notify()
        if self._working is not None:
            self._working.join()

    def _work(self) -> None:
        clock, component = self._runtime, self.component
        component.start(clock.now_s())
        while self._running:
            if self._queue:
                self._queue.popleft()(clock.now_s())
                continue
            left_s = component.next_tick_s - clock.now_s()
            if left_s <= 0:
                component.tick(clock.now_s())
            else:
                self._news.wait_for(lambda: bool(self._queue) or not self._running, left_s)
        component.stop()


class EmulatedMesh:
    """Nodes on one air. All calls come from the thread that created it."""

    def __init__(
        self,
        clock: EmulatorClock,
        links: LinkModel,
        seed: int = 1,
        *,
        settings: RadioSettings = RadioSettings(),  # noqa: B008 (frozen)
        timing: MeshTiming | None = None,
    ) -> None:
        self.clock = clock
        self.air = Air(self.clock, links, random.Random(f"{seed} air"))
        self.nodes: dict[int, EmulatedNode] = {}
        self.events: list[MeshEvent] = []  # appended by the nodes' threads
        self._seed = seed
        self._settings = settings
        self._timing = timing or MeshTiming()

    def add_gateway(self, node_id: int, place: Position) -> None:
        """Add and start a gateway."""
        self._add(node_id, place, gateway=True)

    def add_router(self, node_id: int, place: Position) -> None:
        """Add and start a router."""
        self._add(node_id, place, gateway=False)

    def _add(self, node_id: int, place: Position, *, gateway: bool) -> None:
        rng = random.Random(f"{self._seed} radio {node_id}")
        node = EmulatedNode(self.air, node_id, place, self._settings, rng)
        node.component = assemble_component(
            node_id,
            node.antenna,
            node.drone,
            random.Random(f"{self._seed} mesh {node_id}"),
            internet=NoInternet() if gateway else None,
            timing=self._timing,
            observer=self.events.append,
        )
        self.nodes[node_id] = node
        node.start()

    def now_s(self) -> float:
        """The time of the nodes."""
        return self.clock.runtime.now_s()

    def run_for(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.runtime.sleep(seconds)

    def run_until(self, condition: Callable[[], bool], within_s: float) -> bool:
        """Let time pass until the condition holds; False if it does not hold in time."""
        until_s = self.now_s() + within_s
        while not condition():
            if self.now_s() >= until_s:
                return False
            self.run_for(_STEP_S)
        return True

    def power(self, node_id: int, on: bool) -> None:
        """Switch a node's antenna, in that node's own thread."""
        antenna = self.nodes[node_id].antenna
        self.nodes[node_id].submit(lambda _now_s: antenna.switch_power(on))

    def order(self, node_id: int, x: float, y: float, height: int = 0, gateway: int = 0) -> None:
        """Order a drone to (x, y, height) metres through a gateway, in that gateway's thread."""
        component = self.nodes[gateway].component
        if not isinstance(component, MeshnetworkGateway):
            raise ValueError(f"node {gateway} is a router: orders go through a gateway")

        def send(now_s: float) -> None:
            component.send_goal_request_to_drone(node_id, y, x, height, now_s)

        self.nodes[gateway].submit(send)

    def connected(self, node_id: int) -> bool:
        """Whether a node is connected to a gateway."""
        return self.nodes[node_id].component.get_connected_to_gateway()

    def hops(self, node_id: int) -> int:
        """Hops to the gateway; 255 while not connected."""
        component = self.nodes[node_id].component
        return component.get_hops_from_gateway_away()

    def all_connected(self) -> bool:
        """Whether each node with power has a gateway, and there is at least one."""
        on = [node for node in self.nodes.values() if node.antenna.on()]
        return bool(on) and all(node.component.get_connected_to_gateway() for node in on)

    def stop(self) -> None:
        """Stop all nodes and end their threads."""
        for node in self.nodes.values():
            node.stop()
