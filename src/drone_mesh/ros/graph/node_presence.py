"""Whether the node of a drone runs, in this or any other process."""

from __future__ import annotations

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone
from drone_mesh.srv import PowerSwitch


def node_runs(node_id: int) -> bool:
    """Whether a process offers this node's power switch, and accepts connections."""
    switch = PersistentService(names.power_switch(node_id), PowerSwitch)
    try:
        switch.connect()
    except ServiceGone:
        return False
    switch.close()
    return True
