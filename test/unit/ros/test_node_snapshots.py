"""The states of a process's nodes: made by their workers, complete, and never changed."""

from __future__ import annotations

import threading

import pytest

from drone_mesh.execution import MeshExecutor
from drone_mesh.inprocess import Network
from drone_mesh.ros.host.node_snapshots import NodeSnapshots
from drone_mesh.state.model import NodeStatus


@pytest.fixture
def worker():
    executor = MeshExecutor(lambda: 1.0, clock_notifies=True)
    executor.start()
    yield executor.slot()
    executor.stop()


@pytest.fixture
def component():
    network = Network(seed=1)
    network.add_fleet(1, 3, 2, 6.0)
    network.run_for(10.0)
    return network.nodes[1].component


def test_a_node_is_described_by_the_thread_that_drives_it(worker, component):
    threads = []
    snapshots = NodeSnapshots(wait_s=60.0)

    def antenna_on():
        threads.append(threading.current_thread())
        return True

    snapshots.add(component, worker, lambda: NodeStatus(1), antenna_on)
    (state,) = snapshots.collect()
    assert state.connected
    assert len(state.neighbours) == 3
    assert threading.current_thread() not in threads


def test_a_state_that_was_taken_does_not_change(worker, component):
    snapshots = NodeSnapshots(wait_s=60.0)
    snapshots.add(component, worker, lambda: NodeStatus(1), lambda: True)
    (state,) = snapshots.collect()
    before = repr(state)  # NaN, an unknown battery, is not equal to itself
    component.on_antenna_power(False, 20.0)
    (later,) = snapshots.collect()
    assert repr(state) == before
    assert not later.connected


def test_a_busy_worker_delays_nobody_and_its_node_keeps_its_state(worker, component):
    snapshots = NodeSnapshots(wait_s=0.01)
    snapshots.add(component, worker, lambda: NodeStatus(1), lambda: True)
    while not snapshots.collect():
        pass
    free = threading.Event()
    worker.submit(lambda _now_s: free.wait(60.0))
    (state,) = snapshots.collect()
    free.set()
    assert state.connected


def test_a_dropped_node_is_in_no_later_report(worker, component):
    snapshots = NodeSnapshots(wait_s=60.0)
    snapshots.add(component, worker, lambda: NodeStatus(1), lambda: True)
    assert len(snapshots) == 1
    snapshots.collect()
    snapshots.drop(1)
    assert snapshots.collect() == []
