"""One drone of the in-process network with its mesh software, and the state of all of them."""

from __future__ import annotations

import functools
import math
import random
from typing import Callable, Iterable, Mapping

from drone_mesh.communication.events.observer import MeshEvent
from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection, IMeshNetwork
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.state.links import route_to_gateway
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.observation import describe_component, path_ahead, peers_of, record_of


class NoInternet(IInternetConnection):
    """No connection: orders come from the owner of the network."""

    def connect(self, commands: IGatewayCommands) -> None:
        """Does nothing."""

    def disconnect(self) -> None:
        """Does nothing."""


class InProcessNode:
    """One drone of the network with its mesh software, driven by the clock of its air."""

    def __init__(
        self,
        air: IInProcessAir,
        node_id: int,
        start: Location,
        rng: random.Random,
        is_gateway: bool,
        why_not_fly: str = "",
        fence: Fence = Fence(),  # noqa: B008 (frozen)
    ) -> None:
        """`rng`: the random numbers of the antenna."""
        self.node_id = node_id
        self.is_gateway = is_gateway
        self._clock = air.clock
        self.drone = InProcessDrone(
            air.clock, start, functools.partial(air.flight, node_id), why_not_fly, fence
        )
        self.antenna = air.antenna(self, rng)
        self.component: MeshnetworkComponent
        self.deadlines: Deadlines  # of the component
        self.receiver: IMeshNetwork  # receives the packets: the component or its sealed antenna
        self._planned_s = math.inf

    def start(self) -> None:
        """Start the mesh software."""
        self.component.start(self._clock.now_s)
        self.plan()

    def hear(self, payload: bytes) -> None:
        """A packet has arrived."""
        self.receiver.on_msg(payload, self._clock.now_s)
        if self.deadlines.next_s != self._planned_s:
            self.plan()

    def submit(self, work: Callable[[float], None]) -> None:
        """Run this in the component."""
        work(self._clock.now_s)
        if self.component.next_tick_s != self._planned_s:
            self.plan()

    def plan(self) -> None:
        """Schedule the component's next tick; to be called after every call into it."""
        self._planned_s = self.deadlines.next_s
        if self._planned_s < math.inf:
            self._clock.call_at(self._planned_s, self._tick, self._planned_s)

    def _tick(self, planned_s: float) -> None:
        if planned_s == self._planned_s:  # otherwise it was rescheduled
            self.component.tick(self._clock.now_s)
            self.plan()


def mesh_status(
    nodes: Mapping[int, InProcessNode], now_s: float, max_distance_m: float
) -> MeshStatus:
    """The content of /mesh/state for these nodes now; it does not change afterwards."""
    known = {node_id: _node_status(node_id, nodes[node_id], now_s) for node_id in sorted(nodes)}
    for status in known.values():
        status.route = route_to_gateway(status.id, known)
    return MeshStatus(now_s, list(known.values()), max_distance_m)


def event_records(events: Iterable[MeshEvent]) -> list[EventRecord]:
    """The content of /mesh/events for these events, oldest first."""
    return [record_of(event, peers_of(event)) for event in events]


def _node_status(node_id: int, node: InProcessNode, now_s: float) -> NodeStatus:
    status = NodeStatus(node_id, Role.GATEWAY if node.is_gateway else Role.ROUTER)
    describe_component(status, node.component, node.antenna.on(), now_s)
    status.position = node.drone.get_location().to_vector()
    percent = node.drone.battery_percent()
    status.battery = math.nan if percent is None else percent
    status.why_not_fly = node.drone.why_not_fly()
    path = node.drone.path
    status.path = () if path is None else path_ahead(path, now_s)
    return status
