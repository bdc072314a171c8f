"""A mesh in process, and the desks of its nodes, driven by each call to a desk."""

from __future__ import annotations

import threading

from drone_mesh.inprocess import Network
from drone_mesh.users.desk import UsersDesk


class UsersRig:
    """Gateway 0 and routers 1, 2 in a line. Each submission is followed by a second of the mesh."""

    def __init__(self):
        self.network = Network(seed=3)
        self.network.add_gateway(0, 0.0, 0.0)
        self.network.add_router(1, 6.0, 0.0)
        self.network.add_router(2, 12.0, 0.0)
        assert self.network.run_until(self.network.all_connected, 30.0)
        self._lock = threading.Lock()
        self.desks = {node: self._desk(node) for node in self.network.nodes}

    def _desk(self, node_id):
        node = self.network.nodes[node_id]

        def submit(work):
            with self._lock:
                work(self.network.now_s())
                node.plan()
                self.network.run_for(1.0)

        desk = UsersDesk(node_id, submit)
        desk.open(node.component.data)
        return desk
