"""MeshHost: the virtual Raspberry Pis of many drones in one process."""

from __future__ import annotations

import functools
import logging
import time
from dataclasses import replace
from typing import Callable, Mapping

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.roles import Role
from drone_mesh.errors import MeshError
from drone_mesh.execution import ExecutorSlot, MeshExecutor
from drone_mesh.ros.graph.periodic import LOST_IN_RANGE, WORST_LAG, FiguresPublisher
from drone_mesh.ros.graph.waiting import comes_true
from drone_mesh.ros.host.announcements import PlaceOf
from drone_mesh.ros.host.engines import GroundedDrones, SilentEngines
from drone_mesh.ros.host.host_reports import HostReports
from drone_mesh.ros.host.radios import Radios
from drone_mesh.ros.host.virtual_nrf24 import VirtualRadios
from drone_mesh.ros.host.virtual_raspberry_pi import (
    VIRTUAL_RASPBERRY_PIS,
    MeshSettings,
    VirtualRaspberryPi,
)

RADIOS_TIMEOUT_S = 10.0  # wall seconds to wait for a simulator before starting nodes

_log = logging.getLogger(__name__)


class MeshHost:
    """One worker thread, the radios, and any number of nodes.

    Figures: worst timer lag, lost in range, on /diagnostics

    Any thread may call every function. The worker fills `nodes`.
    """

    def __init__(
        self,
        settings: MeshSettings,
        clock: Callable[[], float],
        on_failure: Callable[[str], None],
        place_of: PlaceOf,
        radios: Radios | None = None,
    ) -> None:
        """`clock` gives simulated seconds; what advances it calls `executor.time_advanced`.

        `on_failure` is called with the reason when a node cannot start. `place_of` is called in
        any thread. `radios`: virtual ones by default.
        """
        self._reports = HostReports(settings.run)
        self._settings = settings
        self._on_failure = on_failure
        self.executor = MeshExecutor(clock, clock_notifies=True, name="mesh_host")
        self._radios = VirtualRadios(self.executor, place_of) if radios is None else radios
        self._figures = FiguresPublisher("host", self._take_figures)
        self._grounded = GroundedDrones()
        self._silent = SilentEngines()
        self.nodes: dict[int, VirtualRaspberryPi] = {}
        self._stopping = False

    def start(self) -> None:
        """Start all threads; there are no nodes yet."""
        self.executor.start()
        self._radios.start()
        self._reports.start()
        self._figures.start()
        self._silent.start()

    def lag_s(self, now_s: float) -> float:
        """How long the oldest pending work has been waiting, in simulated seconds.

        Nodes with emulated radios do not count, because they and their chips run in wall time.
        """
        return 0.0 if self._radios.in_wall_time else self.executor.lag_s(now_s)

    @property
    def idle(self) -> bool:
        """Whether the nodes wait for work; those with emulated radios do not count."""
        return self._radios.in_wall_time or self.executor.idle

    @property
    def under_way(self) -> int:
        """Packets that this process handed over, minus those that its nodes have processed."""
        return self._radios.under_way

    def wait_for_radios(self, give_up: Callable[[], bool]) -> None:
        """Return when packets can be sent, after RADIOS_TIMEOUT_S, or when `give_up` returns True.

        Nodes start without a simulator as well, but their first packets are lost then.
        """
        ready = comes_true(lambda: self._radios.ready, RADIOS_TIMEOUT_S, give_up)
        if not (ready or give_up()):
            _log.warning("no simulator after %g s: starting without it", RADIOS_TIMEOUT_S)

    def start_nodes(self, nodes: Mapping[int, Role]) -> None:
        """Start these nodes, given by id and role, in this order."""
        if not nodes:
            return
        begun_s = time.monotonic()
        for node_id, role in nodes.items():
            slot = self.executor.slot()
            slot.submit(functools.partial(self._start_node, node_id, role, slot))

        def report(_now_s: float) -> None:
            if self.nodes.keys() >= nodes.keys() and not self._stopping:
                noun = "node" if len(nodes) == 1 else "nodes"
                _log.info("started %d %s in %.1f s", len(nodes), noun, time.monotonic() - begun_s)

        self.executor.submit(report)

    def end_node(self, node_id: int) -> None:
        """End this node for good; returns at once. An unknown node is ignored."""

        def end(now_s: float) -> None:
            node = self.nodes.pop(node_id, None)
            if node is not None:
                self._reports.drop(node_id)
                node.stop(now_s)
                self._radios.remove(node_id)
                _log.info("ended node %d", node_id)

        self.executor.submit(end)  # runs after the start of this node

    def keep_to(self, fence: Fence) -> None:
        """Let all nodes, and those that start later, know this fence from now on."""

        def keep(_now_s: float) -> None:
            obstacles = replace(self._settings.obstacles or Obstacles(()), fence=fence)
            self._settings = replace(self._settings, obstacles=obstacles)
            for node in self.nodes.values():
                node.slot.submit(functools.partial(node.keep_to, obstacles))

        self.executor.submit(keep)  # not while a node starts, which would miss it

    def stop(self) -> None:
        """Stop all threads; returns when they have ended. Nodes not started yet never start."""
        self._stopping = True
        self._figures.stop()
        self._silent.stop()
        self._grounded.stop()
        self._reports.stop()
        self._radios.fall_silent()
        for node in list(self.nodes.values()):
            # Only these have threads of their own; the others end with the executor.
            if self._radios.in_wall_time or node.role is Role.GATEWAY:
                node.slot.submit(node.stop)
        self.executor.stop()
        self._radios.close()

    def _take_figures(self) -> dict[str, float]:
        return {
            WORST_LAG: 0.0 if self._radios.in_wall_time else self.executor.take_worst_lag_s(),
            LOST_IN_RANGE: self._radios.never_handed_over,
        }

    def _start_node(self, node_id: int, role: Role, slot: ExecutorSlot, now_s: float) -> None:
        if self._stopping:
            return
        try:
            antenna = self._radios.antenna(node_id, slot)
            why_not_fly = functools.partial(self._grounded.reason, node_id)
            observer = self._reports.observe
            node = VIRTUAL_RASPBERRY_PIS[role](
                node_id, self._settings, observer, antenna, slot, why_not_fly, self._silent
            )
            self._reports.add(role, node.component, slot, antenna.on)
            node.start(now_s)
        except MeshError as error:  # retrying would not help
            self._on_failure(f"node {node_id} cannot start: {error}")
        else:
            self.nodes[node_id] = node
