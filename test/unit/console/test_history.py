"""The recorded part of a run, to which a page can return."""

from __future__ import annotations

import json
import math

from drone_mesh.console.history import History
from drone_mesh.console.page import Player
from drone_mesh.state.model import AreaStatus, EventRecord, MeshStatus, NodeStatus, ObstacleStatus


def mesh(stamp_s: float, hops: int = 1, size: int = 1) -> MeshStatus:
    nodes = [NodeStatus(n, connected=True, hops=hops, route=bytes([n, 9])) for n in range(size)]
    return MeshStatus(stamp_s, nodes, routing="child_table_tree")


def filled(seconds: int = 20) -> History:
    """One state per second, whose hops are its second, and two events."""
    events = [EventRecord(5.0, 0, "power off"), EventRecord(12.0, 0, "connected", (9,))]
    return History.of_run([mesh(float(s), hops=s) for s in range(seconds)], events)


def shown(player: Player) -> dict:
    return json.loads(player.store.frame_since(0))


def test_a_state_comes_back_as_it_was():
    history = History()
    given = MeshStatus(
        3.0,
        [
            NodeStatus(
                4,
                position=[1.0, 2.0, 0.5],
                path=[],
                heading=[2.0, 2.0, 0.5],
                neighbours=b"\x01",
                battery=80.0,
                fallback_age=1.5,
                time_left=720.0,
                home=[0.0, 2.0, 0.0],
            )
        ],
        obstacles=[ObstacleStatus([1.0, 2.0, 0.0], [1.0, 1.0, 3.0], 0.5)],
        layouts=["202: 1 of 9"],
        fence=[AreaStatus("yard", True, -math.inf, 30.0, [0.0, 0.0, 9.0, 0.0, 9.0, 9.0], [3])],
    )
    history.add(given, wall_s=0.0)
    assert history.state(0) == given


def test_thirty_minutes_of_a_live_run_are_kept():
    history = History()
    for second in range(2000):
        history.add(mesh(float(second)), wall_s=float(second))
    history.add_events([EventRecord(1999.0, 0, "power off")])
    assert history.times[0] == 199.0
    assert history.times[-1] == 1999.0


def test_states_of_many_nodes_are_kept_as_far_as_memory_allows():
    history = History(kept_bytes=20_000)
    for second in range(200):
        history.add(mesh(float(second), size=50), wall_s=float(second))
    assert 1 < len(history.times) < 199
    assert history.times[-1] == 199.0


def test_a_paused_mesh_and_one_that_reports_often_do_not_fill_it():
    history = History()
    for stamp_s, wall_s in [(1.0, 0.0), (1.0, 5.0), (2.0, 5.1), (2.2, 5.3), (2.4, 5.5)]:
        history.add(mesh(stamp_s), wall_s)
    assert history.times == [1.0, 2.0, 2.4]


def test_a_new_run_begins_a_new_history():
    history = filled()
    history.add(mesh(0.5), wall_s=100.0)
    assert history.times == [0.5]
    assert history.marks == []


def test_a_jump_back_shows_the_state_and_the_events_of_that_moment():
    player = Player(filled(), at_s=19.0)
    assert [event["kind"] for event in shown(player)["events"]] == ["power off", "connected"]
    player.show(7.4)
    frame = shown(player)
    assert frame["clock"]["t"] == 7.0
    assert frame["nodes"]["0"]["hops"] == 7
    assert [event["kind"] for event in frame["events"]] == ["power off"]
    assert len(frame["samples"]) == 8


def test_playing_adds_what_happened_since():
    player = Player(filled(), at_s=10.0)
    known = player.store.version
    player.factor = 5.0
    player.advance(wall_s=0.5)
    frame = json.loads(player.store.frame_since(known))
    assert not frame["full"]
    assert frame["clock"]["t"] == 12.0
    assert [event["kind"] for event in frame["events"]] == ["connected"]


def test_a_pause_is_at_the_time_of_the_state_that_is_shown():
    """A link to 2.9996 s, which it names as 3.00, would show the next state."""
    player = Player(filled(5), at_s=2.9996)
    player.pause(True)
    assert (player.now_s, shown(player)["clock"]["t"]) == (2.0, 2.0)
    player.pause(False)
    assert player.now_s == 2.0


def test_a_step_pauses_and_ends_at_both_ends():
    player = Player(filled(), at_s=18.2)
    for expected_s in (19.0, 19.0):
        player.step(1)
        assert shown(player)["clock"]["t"] == expected_s
    assert shown(player)["clock"]["paused"]
    player.step(-1000)
    assert shown(player)["clock"]["t"] == 0.0


def test_a_recording_keeps_one_state_of_each_time_and_none_that_goes_back():
    history = History.of_run([mesh(1.0), mesh(1.0), mesh(2.0), mesh(1.5), mesh(3.0)], [])
    assert history.times == [1.0, 2.0, 3.0]


def test_a_jump_in_time_is_no_loss_of_links():
    alone = [NodeStatus(0), NodeStatus(1)]
    linked = [NodeStatus(0, neighbours=b"\x01"), NodeStatus(1, neighbours=b"\x00")]
    history = History.of_run([MeshStatus(1.0, alone), MeshStatus(2.0, linked)], [])
    player = Player(history, 2.0)
    assert shown(player)["nodes"]["0"]["known_links"] != "0"
    player.show(1.0)
    assert shown(player)["nodes"]["0"]["lost_links"] == "0"
