"""HostReports: what a process reports about the nodes that it hosts."""

from __future__ import annotations

from typing import Callable

import rospy

from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.drone.roles import Role
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import HostReport, NodeState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import event_msg, ros_time
from drone_mesh.ros.graph.periodic import Periodic
from drone_mesh.ros.graph.simulation import Run, run_headers
from drone_mesh.ros.host.node_snapshots import NodeSnapshots
from drone_mesh.state.observation import EventBatcher

REPORT_PERIOD_S = 0.5  # wall time; an event is seen soon
REPORT_PERIOD_PER_NODE_S = 0.004  # 254 nodes with 200 neighbours each, once a second
REPORTS_QUEUE = 4  # reports that may wait for a slow subscriber; each one is complete in itself


class HostReports(Periodic):
    """Reports on all nodes of this process, in one thread of its own.

    Publishes: /mesh/reports (HostReport), once or twice a second of wall time, also while time
               stands still

    The worker calls `add` and `drop`, any thread calls `observe`. The worker makes the NodeState of
    each node, which does not change any more.
    """

    def __init__(self, run: Run) -> None:
        """`run` is the world's."""
        super().__init__("host reports", REPORT_PERIOD_S)
        self._snapshots: NodeSnapshots[NodeState] = NodeSnapshots(REPORT_PERIOD_S)
        self._batcher = EventBatcher()
        self.drop = self._snapshots.drop  # stops reporting on a node
        self.observe = self._batcher.observe  # the observer of all components of this process
        self._publisher = rospy.Publisher(
            names.REPORTS_TOPIC, HostReport, headers=run_headers(run), queue_size=REPORTS_QUEUE
        )

    def add(
        self,
        role: Role,
        component: MeshnetworkComponent,
        worker: ExecutorSlot,
        antenna_on: Callable[[], bool],
    ) -> None:
        """Report on this node, which `worker` drives, from now on."""
        node_id = component.get_node_id()
        self._snapshots.add(component, worker, lambda: NodeState(id=node_id, role=role), antenna_on)

    def stop(self) -> None:
        super().stop()
        self._publisher.unregister()

    def _work(self) -> None:
        self._period_s = max(REPORT_PERIOD_S, REPORT_PERIOD_PER_NODE_S * len(self._snapshots))
        # Events wait for a subscriber; published without one they would be lost.
        if not self._publisher.get_num_connections():
            return
        report = HostReport(host=rospy.get_name())
        report.header.stamp = ros_time(rospy.get_time())
        report.nodes = self._snapshots.collect()
        report.events = list(map(event_msg, self._batcher.drain()))
        self._publisher.publish(report)
