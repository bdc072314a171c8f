"""MeshHost: the virtual Raspberry Pis of many drones in one process."""

from __future__ import annotations

import dataclasses
import logging
import time
from typing import Callable, Iterable

import rospy

from drone_mesh.execution import MeshExecutor
from drone_mesh.ros import names
from drone_mesh.ros.figures import Figures
from drone_mesh.ros.host_reports import HostReports
from drone_mesh.ros.simulator_link import SimulatorLink
from drone_mesh.ros.virtual_raspberry_pi import (
    MeshSettings,
    VirtualRaspberryPi,
    VirtualRaspberryPiGateway,
    VirtualRaspberryPiRouter,
)

SIMULATOR_TIMEOUT_S = 10.0  # our choice: wall seconds to wait for a simulator before starting nodes
_LOOK_PERIOD_S = 0.02

_log = logging.getLogger(__name__)


class MeshHost:
    """One worker thread, one link to the simulator, and any number of nodes.

    Figures: worst timer lag, lost in range, on /diagnostics

    Every thread may use it. `nodes` is filled by the worker, in which each of them lives.
    """

    def __init__(self, settings: MeshSettings, clock: Callable[[], float]) -> None:
        """`clock` gives simulated seconds; whoever moves it calls `executor.time_advanced`."""
        self._reports = HostReports()
        self._settings = dataclasses.replace(settings, observer=self._reports.observe)
        self.executor = MeshExecutor(clock, clock_is_poked=True, name="mesh_host")
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
        for node_id in ids:
            self._submit_start(node_id)

        def tell(_now_s: float) -> None:
            if not self._stopping:
                _log.info("%d nodes are on, after %.1f s", len(ids), time.monotonic() - begun_s)

        self.executor.submit(tell)

    def stop(self) -> None:
        """Stop all threads; returns when they have ended. Nodes that wait to be started are not."""
        self._stopping = True
        self._figures.stop()
        self._reports.stop()
        self._link.stop()
        self.executor.stop()

    def _take_figures(self) -> dict[str, float]:
        return {
            names.WORST_LAG: self.executor.take_worst_lag_s(),
            names.LOST_IN_RANGE: self._link.never_handed_over,
        }

    def _submit_start(self, node_id: int) -> None:
        seat = self.executor.seat()
        is_gateway = node_id < self._settings.gateways
        kind = VirtualRaspberryPiGateway if is_gateway else VirtualRaspberryPiRouter

        def start(now_s: float) -> None:
            if self._stopping:
                return
            node = self.nodes[node_id] = kind(node_id, self._settings, self._link, seat)
            self._reports.add(node.component, node.antenna.on)
            node.start(now_s)

        seat.submit(start)
