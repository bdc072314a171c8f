"""What the console saves for other programs: places and tracks."""

from __future__ import annotations

from drone_mesh.console.earth import places_of, tracks_of
from drone_mesh.console.history import History, unpacked
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import Path, Point
from drone_mesh.state.model import UNKNOWN_POSITION, MeshStatus, NodeStatus


def test_the_places_are_those_of_routers_whose_position_is_known():
    nodes = [
        NodeStatus(0, role=Role.GATEWAY, position=(0.0, 0.0, 0.0)),
        NodeStatus(1, role=Role.ROUTER, position=(1.0, 2.0, 3.0)),
        NodeStatus(2, role=Role.ROUTER, position=UNKNOWN_POSITION),
    ]
    assert places_of(MeshStatus(1.0, nodes)).points == [Point(1, Location(2.0, 1.0, 3.0))]
    assert places_of(None).points == []


def test_a_track_has_a_place_whenever_the_drone_has_moved_half_a_metre():
    def mesh(t: int) -> MeshStatus:
        still, moving = NodeStatus(1, position=(5.0, 5.0, 0.0)), (0.3 * min(t, 4), 0.0, 1.0)
        return MeshStatus(float(t), [still, NodeStatus(2, position=moving)])

    history = History.of([mesh(t) for t in range(10)], [])
    places = [Location(0.0, x, 1.0) for x in (0.0, 0.6, 1.2)]
    assert tracks_of(history.spread(10)).paths == [Path(2, places, [0.0, 2.0, 4.0])]


def test_long_tracks_are_thinned_out_but_keep_both_ends(monkeypatch):
    monkeypatch.setattr("drone_mesh.console.earth.MOST_PLACES", 4)
    states = [MeshStatus(float(t), [NodeStatus(2, position=(t, 0.0, 0.0))]) for t in range(10)]
    (path,) = tracks_of(History.of(states, []).spread(10)).paths
    assert path.times_s == [0.0, 3.0, 6.0, 9.0]
    assert [place.longitude for place in path.places] == path.times_s


def test_a_spread_of_states_ends_with_the_last():
    history = History.of([MeshStatus(float(t), []) for t in range(10)], [])
    assert [unpacked(state).stamp_s for state in history.spread(4)] == [0.0, 3.0, 6.0, 9.0]
