"""One drone of the in-process network with its mesh software."""

from __future__ import annotations

import functools
import math
import random
from typing import Callable

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection, IMeshNetwork
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.inprocess.interfaces import IInProcessAir


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
    ) -> None:
        """`rng`: the random numbers of the antenna."""
        self.node_id = node_id
        self.is_gateway = is_gateway
        self._clock = air.clock
        self.drone = InProcessDrone(
            air.clock, start, functools.partial(air.flight, node_id), why_not_fly
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
