"""MeshHost: the virtual Raspberry Pis of many drones in one process."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from typing import Callable, Iterable

import rospy

from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.errors import MeshError
from drone_mesh.execution import MeshExecutor, Seat
from drone_mesh.ros.graph.figures import Figures
from drone_mesh.ros.host.emulated_nrf24 import EmulatedRadios
from drone_mesh.ros.host.host_reports import HostReports
from drone_mesh.ros.host.simulator_link import SimulatorLink
from drone_mesh.ros.host.virtual_nrf24 import VirtualNRF24
from drone_mesh.ros.host.virtual_raspberry_pi import (
    MeshSettings,
    VirtualRaspberryPi,
    VirtualRaspberryPiGateway,
    VirtualRaspberryPiRouter,
)
from drone_mesh.state.figures import LOST_IN_RANGE, WORST_LAG

SIMULATOR_TIMEOUT_S = 10.0  # our choice: wall seconds to wait for a simulator before starting nodes
_LOOK_PERIOD_S = 0.02  # wall; our choice

_log = logging.getLogger(__name__)


class MeshHost:
    """One worker thread, one link to the simulator, and any number of nodes.

    With emulated radios each node has a worker thread of its own, for their sends take time.
    Figures: worst timer lag, lost in range, on /diagnostics

    Every thread may use it. `nodes` is filled by the workers, in which each of them lives.
    """

    def __init__(
        self,
        settings: MeshSettings,
        clock: Callable[[], float],
        radios: EmulatedRadios | None = None,
    ) -> None:
        """`clock` gives simulated seconds; whoever moves it calls `time_advanced`."""
        self._reports = HostReports()
        self._settings = dataclasses.replace(settings, observer=self._reports.observe)
        self.executor = MeshExecutor(clock, clock_is_poked=True, name="mesh_host")
        self._clock = clock
        self._radios = radios
        self._own_executors: list[MeshExecutor] = []  # of nodes with emulated radios
        self._link = SimulatorLink(self.executor)
        self._figures = Figures(f"host {rospy.get_name()}", self._take_figures)
        self.nodes: dict[int, VirtualRaspberryPi] = {}
        self._stopping = False

    def start(self) -> None:
        """Start to work; there are no nodes yet."""
        self.executor.start()
        self._link.start()
        self._reports.start()
        self._figures.start()

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting.

        Nobody waits for nodes with emulated radios: the chips live by the wall's time, as they do.
        """
        return self.executor.lag_s(now_s)

    def time_advanced(self) -> None:
        """The clock was moved."""
        self.executor.time_advanced()
        for executor in self._own_executors:
            executor.time_advanced()

    def wait_for_simulator(self, give_up: Callable[[], bool]) -> None:
        """Return when packets can be sent, when that takes too long, or as soon as `give_up` says.

        Nodes also start without a simulator; but then their first packets are lost.
        """
        deadline_s = time.monotonic() + SIMULATOR_TIMEOUT_S
        while not self._link.connected and not give_up():
            if time.monotonic() > deadline_s:
                _log.warning("no simulator after %g s, starting without", SIMULATOR_TIMEOUT_S)
                return
            time.sleep(_LOOK_PERIOD_S)

    def serve(self, node_ids: Iterable[int]) -> None:
        """Start these nodes, one after the other."""
        begun_s = time.monotonic()
        ids = list(node_ids)
        if not ids:
            return
        left = threading.Semaphore(len(ids) - 1)  # with emulated radios they start side by side

        def tell() -> None:
            if not left.acquire(blocking=False) and not self._stopping:
                _log.info("%d nodes are on, after %.1f s", len(ids), time.monotonic() - begun_s)

        for node_id in ids:
            self._submit_start(node_id, tell)

    def stop(self) -> None:
        """Stop all threads; returns when they have ended. Nodes that wait to be started are not."""
        self._stopping = True
        self._figures.stop()
        self._reports.stop()
        self._link.stop()
        if self._radios is not None:
            self._radios.fall_silent()
        for node in list(self.nodes.values()):
            if self._radios is not None or node.node_id < self._settings.gateways:
                node.seat.submit(node.stop)  # these have threads of their own
        for executor in self._own_executors:
            executor.stop()
        self.executor.stop()

    def _take_figures(self) -> dict[str, float]:
        return {
            WORST_LAG: self.executor.take_worst_lag_s(),
            LOST_IN_RANGE: self._link.never_handed_over,
        }

    def _submit_start(self, node_id: int, tell: Callable[[], None]) -> None:
        seat = self._seat()
        is_gateway = node_id < self._settings.gateways
        kind = VirtualRaspberryPiGateway if is_gateway else VirtualRaspberryPiRouter

        def start(now_s: float) -> None:
            if self._stopping:
                return
            try:
                node = kind(node_id, self._settings, self._antenna(node_id, seat), seat)
                self._reports.add(node.component, node.antenna.on)
                node.start(now_s)
            except MeshError as error:  # nothing that goes away by itself
                _log.error("node %d cannot start: %s", node_id, error)
                rospy.signal_shutdown(str(error))
            else:
                self.nodes[node_id] = node
                tell()

        seat.submit(start)

    def _seat(self) -> Seat:
        if self._radios is None:
            return self.executor.seat()
        executor = MeshExecutor(self._clock, clock_is_poked=True, name="mesh_node")
        executor.start()
        self._own_executors.append(executor)
        return executor.seat()

    def _antenna(self, node_id: int, seat: Seat) -> IWirelessCommunication:
        if self._radios is None:
            return VirtualNRF24(node_id, self._link, seat)
        return self._radios.antenna(node_id, seat)
