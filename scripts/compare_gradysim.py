"""Moving nodes in gradysim: what scripts/compare.py runs beside drone_mesh and ns-3."""

from __future__ import annotations

import math
import random
import time
from typing import Mapping, Sequence

from gradysim.protocol.interface import IProtocol
from gradysim.protocol.messages.communication import BroadcastMessageCommand, SendMessageCommand
from gradysim.protocol.messages.mobility import GotoCoordsMobilityCommand, SetSpeedMobilityCommand
from gradysim.simulator.handler.communication import CommunicationHandler, CommunicationMedium
from gradysim.simulator.handler.mobility import (
    MasslessMobilityConfiguration,
    MasslessMobilityHandler,
)
from gradysim.simulator.handler.timer import TimerHandler
from gradysim.simulator.simulation import SimulationBuilder, SimulationConfiguration

BEACON_S, SILENT_S, STEP_S = 1.0, 2.5, 0.1
FAR = 99  # hops of a node without a way to node 0


class Gradient(IProtocol):
    """Each node says how many hops it is from node 0; a message goes to whoever is nearest."""

    knots: Mapping[int, Sequence[tuple[float, float, float, float]]]
    messages: Sequence[tuple[int, int, float]]  # from, to, time
    arrived: dict[int, float]  # by message

    def initialize(self) -> None:
        self.me, self.near = self.provider.get_id(), {}
        for leg, (at_s, *_place) in enumerate(self.knots[self.me][:-1]):
            self.provider.schedule_timer(f"fly {leg}", at_s)
        for number, (source, _sink, at_s) in enumerate(self.messages):
            if source == self.me:
                self.provider.schedule_timer(f"send {number}", at_s)
        self.provider.schedule_timer("beacon", random.random() * BEACON_S)

    def handle_timer(self, timer: str) -> None:
        kind, _, number = timer.partition(" ")
        if kind == "send":
            self.forward(f"m {number} {FAR}")
        elif kind == "fly":
            (t, *at, _z), (then, *to, _w) = self.knots[self.me][int(number) :][:2]
            speed_m_s = math.dist(at, to) / (then - t)
            self.provider.send_mobility_command(SetSpeedMobilityCommand(speed_m_s))
            self.provider.send_mobility_command(GotoCoordsMobilityCommand(*to, 0.0))
        else:
            hops = min(self.nearest()[0] + 1, FAR) if self.me else 0
            self.provider.send_communication_command(BroadcastMessageCommand(f"b {self.me} {hops}"))
            self.provider.schedule_timer("beacon", self.provider.current_time() + BEACON_S)

    def nearest(self) -> tuple[int, int]:
        """Hops and id of the neighbour that is nearest to node 0, of those heard recently."""
        since_s = self.provider.current_time() - SILENT_S
        fresh = ((hops, node) for node, (hops, at_s) in self.near.items() if at_s > since_s)
        return min(fresh, default=(FAR, 0))

    def forward(self, message: str) -> None:
        _kind, number, left = message.split()
        hops, node = self.nearest()
        if hops < FAR and int(left):
            command = SendMessageCommand(f"m {number} {int(left) - 1}", node)
            self.provider.send_communication_command(command)

    def handle_packet(self, message: str) -> None:
        kind, one, other = message.split()
        if kind == "b":
            self.near[int(one)] = int(other), self.provider.current_time()
        elif self.me:
            self.forward(message)
        else:
            self.arrived.setdefault(int(one), self.provider.current_time())

    def handle_telemetry(self, telemetry: object) -> None:
        pass

    def finish(self) -> None:
        pass


def run(
    knots: Mapping[int, Sequence[tuple[float, float, float, float]]],
    messages: Sequence[tuple[int, int, float]],
    range_m: float,
    delay_s: float,
    until_s: float,
) -> tuple[dict[int, float], float]:
    """When each message arrived at node 0, and the seconds of processor time."""
    Gradient.knots, Gradient.messages, Gradient.arrived = knots, messages, {}
    builder = SimulationBuilder(SimulationConfiguration(duration=until_s, execution_logging=False))
    builder.add_handler(CommunicationHandler(CommunicationMedium(range_m, delay_s)))
    builder.add_handler(MasslessMobilityHandler(MasslessMobilityConfiguration(STEP_S)))
    builder.add_handler(TimerHandler())
    for node in sorted(knots):
        builder.add_node(Gradient, knots[node][0][1:])
    simulation, begun_s = builder.build(), time.process_time()
    simulation.start_simulation()
    return Gradient.arrived, time.process_time() - begun_s
