"""A mesh of drones: the mesh software, its radio, and a simulated world for both.

The names of `__all__` here, in `drone_mesh.inprocess` and in `drone_mesh.lab` are for users of the
package (docs/architecture.md, "What users may import").
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drone_mesh.by_name import on_demand
from drone_mesh.compiled import use_build

use_build()  # a compiled core must be found before its sources

if TYPE_CHECKING:
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

__getattr__ = on_demand(
    __name__,
    {  # a program loads only those whose names it uses
        "BROADCAST": "drone_mesh.communication.interfaces",
        "NO_ROUTE": "drone_mesh.communication.interfaces",
        "ChildTableTree": "drone_mesh.communication.routing.child_table_tree",
        "GoalRefused": "drone_mesh.errors",
        "IDroneEngine": "drone_mesh.drone.interfaces",
        "IRepairStrategy": "drone_mesh.communication.repair.interfaces",
        "IRoutingTechnique": "drone_mesh.communication.routing.interfaces",
        "Location": "drone_mesh.drone.location",
        "LocationUnknown": "drone_mesh.errors",
        "MeshTiming": "drone_mesh.communication.timing",
        "MessageType": "drone_mesh.communication.wire.packet_types",
        "Step": "drone_mesh.communication.repair.interfaces",
        "Thesis": "drone_mesh.communication.repair.strategies",
        "check_goal": "drone_mesh.drone.goal",
        "plan_fleet": "drone_mesh.drone.fleet",
        "type_of": "drone_mesh.communication.wire.messages",
    },
)
