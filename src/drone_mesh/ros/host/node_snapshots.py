"""Snapshots of the nodes of a process, each made by the thread that drives its node."""

from __future__ import annotations

import functools
import queue
from typing import Callable, Generic, TypeVar

from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.execution import ExecutorSlot
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.observation import describe_component

S = TypeVar("S", bound=NodeStatus)
_Fill = Callable[[Callable[[int], None], float], None]  # called with what to tell, and the time


class NodeSnapshots(Generic[S]):
    """The latest state of each node; a state that was stored does not change.

    Workers call `add` and `drop`, any other thread `take`.
    """

    def __init__(self, wait_s: float) -> None:
        """`wait_s`: wall seconds without a new state after which `take` stops waiting."""
        self._wait_s = wait_s
        self._fills: dict[int, tuple[ExecutorSlot, _Fill]] = {}
        self._latest: dict[int, S] = {}

    def __len__(self) -> int:
        return len(self._fills)

    def add(
        self,
        component: MeshnetworkComponent,
        worker: ExecutorSlot,
        new: Callable[[], S],
        antenna_on: Callable[[], bool],
    ) -> None:
        """Describe this node from now on, in its `worker`, each time in a state made by `new`."""
        node_id = component.get_node_id()

        def fill(done: Callable[[int], None], now_s: float) -> None:
            if node_id in self._fills:
                state = new()
                describe_component(state, component, antenna_on(), now_s)
                self._latest[node_id] = state
            done(node_id)

        self._fills[node_id] = (worker, fill)

    def drop(self, node_id: int) -> None:
        self._fills.pop(node_id, None)
        self._latest.pop(node_id, None)

    def collect(self) -> list[S]:
        """The present state of each node; of a node whose worker is busy, its last one."""
        done: queue.SimpleQueue[int] = queue.SimpleQueue()
        fills = list(self._fills.values())
        for worker, fill in fills:
            worker.submit(functools.partial(fill, done.put))
        for _fill in fills:
            try:
                done.get(timeout=self._wait_s)
            except queue.Empty:
                break
        return list(self._latest.values())
