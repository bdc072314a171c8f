"""What the console saves for other programs."""

from __future__ import annotations

from drone_mesh.console.earth import places_of
from drone_mesh.console.history import History, unpacked
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import Point
from drone_mesh.state.model import UNKNOWN_POSITION, MeshStatus, NodeStatus


def test_the_places_are_those_of_routers_whose_position_is_known():
    nodes = [
        NodeStatus(0, role=Role.GATEWAY, position=(0.0, 0.0, 0.0)),
        NodeStatus(1, role=Role.ROUTER, position=(1.0, 2.0, 3.0)),
        NodeStatus(2, role=Role.ROUTER, position=UNKNOWN_POSITION),
    ]
    assert places_of(MeshStatus(1.0, nodes)).points == [Point(1, Location(2.0, 1.0, 3.0))]
    assert places_of(None).points == []


def test_a_spread_of_states_ends_with_the_last():
    history = History.of_run([MeshStatus(float(t), []) for t in range(10)], [])
    assert [unpacked(state).stamp_s for state in history.spread(4)] == [0.0, 3.0, 6.0, 9.0]
