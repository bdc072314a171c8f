"""A mesh of drones: the mesh software, its radio, and a simulated world for both.

The names of `__all__` here, in `drone_mesh.inprocess` and in `drone_mesh.lab` are for users of the
package (docs/architecture.md, "What users may import").
"""

# ruff: noqa: E402, I001 - a compiled core must be found before its sources
from drone_mesh.compiled import use_build

use_build()

from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.repair.interfaces import IRepairStrategy, Step
from drone_mesh.communication.repair.strategies import Thesis
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.wire.messages import type_of
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown

__all__ = [
    "BROADCAST",
    "NO_ROUTE",
    "ChildTableTree",
    "GoalRefused",
    "IDroneEngine",
    "IRepairStrategy",
    "IRoutingTechnique",
    "Location",
    "LocationUnknown",
    "MeshTiming",
    "MessageType",
    "Step",
    "Thesis",
    "check_goal",
    "plan_fleet",
    "type_of",
]
