"""Which frames rviz gets: those that changed, and none twice with the same stamp."""

from __future__ import annotations

from drone_mesh.ros.views.moved_frames import MovedFrames
from drone_mesh.state.model import NodeStatus


def nodes(x: float) -> list[NodeStatus]:
    """Node 1 stands; node 2 is at `x`; node 3 has no known position."""
    return [
        NodeStatus(1, position=(0.0, 0.0, 0.0)),
        NodeStatus(2, position=(x, 0.0, 0.0)),
        NodeStatus(3),
    ]


def ids(selected: list[NodeStatus]) -> list[int]:
    return [node.id for node in selected]


def test_drones_that_move_are_sent_with_each_state_and_the_others_once_a_second():
    frames = MovedFrames()
    assert ids(frames.select(nodes(1.0), 10.0, wall_s=0.0)) == [1, 2]
    assert ids(frames.select(nodes(2.0), 10.5, wall_s=0.5)) == [2]
    assert ids(frames.select(nodes(2.0), 10.9, wall_s=0.9)) == []
    assert ids(frames.select(nodes(2.0), 11.0, wall_s=1.0)) == [1, 2]


def test_a_paused_simulation_sends_no_frame_again():
    frames = MovedFrames()
    frames.select(nodes(1.0), 10.0, wall_s=0.0)
    for wall_s in (0.5, 1.5, 2.5):
        assert ids(frames.select(nodes(1.0), 10.0, wall_s)) == []
    assert ids(frames.select(nodes(1.0), 10.1, wall_s=3.5)) == [1, 2]


def test_a_simulation_that_starts_over_is_shown_although_its_stamps_are_older():
    frames = MovedFrames()
    frames.select(nodes(1.0), 10.0, wall_s=0.0)
    assert ids(frames.select(nodes(1.0), 2.0, wall_s=1.0)) == [1, 2]
