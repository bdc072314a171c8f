"""Frames: what a page is sent, and what it is not."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from drone_mesh.console.frame_store import EVENTS_PER_FRAME, SAMPLES_KEPT, FrameStore
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import JUST_LOST_S
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus, ObstacleStatus
from drone_mesh.state.observation import describe_fence
from drone_mesh.state.outages import take_sample

A, B = Location(3.0, 2.0, 0.0), Location(0.0, 0.0, 0.0)


def mesh(stamp_s: float = 1.0, **router: object) -> MeshStatus:
    fields = {"connected": True, "hops": 1, "next_hop": 0, "route": b"\x01\x00", **router}
    return MeshStatus(
        stamp_s,
        [
            NodeStatus(0, Role.GATEWAY, connected=True, hops=0, position=(-1.0, 0.0, 0.0)),
            NodeStatus(1, position=(2.0, 3.0, 0.0), **fields),  # type: ignore[arg-type]
        ],
    )


def frame(store: FrameStore, version: int) -> dict:
    return json.loads(store.frame_since(version))


@pytest.fixture
def store():
    return FrameStore()


def test_a_new_page_gets_everything(store):
    store.update_mesh(mesh(neighbours=b"\x00\x09"), wall_s=0.0)
    first = frame(store, 0)
    assert first["full"]
    assert first["link"] == ""
    assert first["clock"]["summary"] == "1 of 1 routers connected"
    assert first["nodes"]["1"]["hops"] == 1
    assert first["nodes"]["1"]["neighbours"] == 2
    assert first["nodes"]["1"]["position"] == [2.0, 3.0, 0.0]
    assert (first["nodes"]["0"]["condition"], first["nodes"]["0"]["colour"]) == (
        "connected", "gateway",
    )  # fmt: skip


def test_a_page_that_is_up_to_date_gets_only_what_changed(store):
    store.update_mesh(mesh(), wall_s=0.0)
    known = store.version
    store.update_mesh(mesh(1.2, hops=2), wall_s=0.2)
    delta = frame(store, known)
    assert not delta["full"]
    assert delta["nodes"] == {"1": {"hops": 2}}
    assert delta["clock"]["t"] == 1.2


def test_obstacles_are_sent_once_and_to_every_new_page(store):
    box = ObstacleStatus((5.0, 1.0, 2.0), (2.0, 4.0, 4.0), math.pi / 2)
    store.update_mesh(replace(mesh(), obstacles=[box]), wall_s=0.0)
    known = store.version
    store.update_mesh(replace(mesh(1.2), obstacles=[box]), wall_s=0.2)
    assert "obstacles" not in frame(store, known)
    (shown,) = frame(store, 0)["obstacles"]
    assert sorted(shown["corners"]) == [[3.0, 0.0], [3.0, 2.0], [7.0, 0.0], [7.0, 2.0]]
    assert shown["top"] == 4.0


def test_the_fence_is_sent_once_and_an_end_that_is_not_there_is_null(store):
    ring = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)]
    zones = [Zone("yard", (ring, [(6.0, 1.0), (7.0, 1.0), (7.0, 2.0)]), highest_m=30.0)]
    store.update_mesh(replace(mesh(), fence=describe_fence(Fence.of(zones, ()))), wall_s=0.0)
    known = store.version
    store.update_mesh(replace(mesh(1.2), fence=describe_fence(Fence.of(zones, ()))), wall_s=0.2)
    assert "fence" not in frame(store, known)
    (area,) = frame(store, 0)["fence"]
    rings = area.pop("rings")
    assert area == {"name": "yard", "inside": True, "low": None, "high": 30.0}
    assert [len(ring) for ring in rings] == [3, 3]
    assert rings[1][2] == [7.0, 2.0]


def test_a_page_that_fell_behind_gets_the_newest_of_all_it_missed(store):
    store.update_mesh(mesh(), wall_s=0.0)
    known = store.version
    store.update_mesh(mesh(1.2, hops=2), wall_s=0.2)
    store.update_mesh(mesh(1.4, hops=3, total_messages=7), wall_s=0.4)
    assert frame(store, known)["nodes"] == {"1": {"hops": 3, "total_messages": 7}}


def test_a_page_gets_the_names_of_the_algorithms_and_what_each_repair_does(store):
    named = replace(mesh(repair=""), routing="etx_tree", repair_strategy="thesis")
    store.update_mesh(named, wall_s=0.0)
    first = frame(store, 0)
    assert (first["clock"]["routing"], first["clock"]["repair"]) == ("etx_tree", "thesis")
    assert first["nodes"]["1"]["repair"] == ""
    known = store.version
    store.update_mesh(mesh(1.2, repair="flies to the place of 2"), wall_s=0.2)
    words = "flies to the place of 2"
    assert frame(store, known)["nodes"] == {"1": {"repair": words, "does": words}}


def test_movements_below_a_centimetre_are_not_sent(store):
    store.update_mesh(mesh(), wall_s=0.0)
    known = store.version
    store.update_mesh(mesh(1.2, **{}), wall_s=0.2)
    moved = mesh(1.4)
    moved.nodes[1].position = (2.004, 3.0, 0.0)
    store.update_mesh(moved, wall_s=0.4)
    assert "nodes" not in frame(store, known)


def test_a_node_that_is_gone_is_removed_and_may_come_back(store):
    store.update_mesh(mesh(), wall_s=0.0)
    known = store.version
    store.update_mesh(replace(mesh(1.2), nodes=mesh().nodes[:1]), wall_s=0.2)
    assert frame(store, known)["gone"] == [1]
    store.update_mesh(mesh(1.4), wall_s=0.4)
    back = frame(store, known)
    assert "gone" not in back
    assert back["nodes"]["1"]["hops"] == 1


def test_each_event_is_sent_once(store):
    store.update_mesh(mesh(), wall_s=0.0)
    store.add_events([EventRecord(1.0, 1, "connected", (0,), "1 hop")])
    events = frame(store, 0)["events"]
    assert events == [{"t": 1.0, "node": 1, "kind": "connected", "peers": [0], "detail": "1 hop"}]
    known = store.version
    store.add_events([EventRecord(2.0, 1, "disconnected", (0,))])
    assert [event["kind"] for event in frame(store, known)["events"]] == ["disconnected"]


def test_an_event_about_an_order_is_told_with_its_number_and_place(store):
    store.add_events([EventRecord(1.0, 0, "order refused", (1,), "battery at 9 %", 7, A)])
    [event] = frame(store, 0)["events"]
    assert event["detail"] == "order 7 to x 2.00 m, y 3.00 m, z 0 m: battery at 9 %"


def test_of_a_burst_of_events_the_newest_are_sent(store):
    store.add_events([EventRecord(float(n), 1, "landed") for n in range(EVENTS_PER_FRAME + 50)])
    events = frame(store, 0)["events"]
    assert len(events) == EVENTS_PER_FRAME
    assert events[-1]["t"] == EVENTS_PER_FRAME + 49


def test_samples_are_taken_once_a_second_and_not_while_paused(store):
    for tenth in range(31):
        store.update_mesh(mesh(1.0 + tenth / 10), wall_s=tenth / 10)
    assert len(frame(store, 0)["samples"]) == 4
    for tenth in range(31, 60):
        store.update_mesh(replace(mesh(4.0), paused=True), wall_s=tenth / 10)
    assert len(frame(store, 0)["samples"]) == 4


def test_a_new_world_is_sent_in_full_and_without_the_past(store):
    store.update_mesh(mesh(100.0), wall_s=0.0)
    store.add_events([EventRecord(99.0, 1, "connected")])
    known = store.version
    store.update_mesh(mesh(0.5), wall_s=5.0)
    delta = frame(store, known)
    assert delta["full"]
    assert "events" not in delta
    assert set(delta["nodes"]) == {"0", "1"}
    assert [sample["stamp_s"] for sample in delta["samples"]] == [0.5]


def test_silence_is_reported_and_ends_with_the_next_state(store):
    store.update_mesh(mesh(), wall_s=0.0)
    known = store.version
    store.set_link("no ROS master")
    assert frame(store, known)["link"] == "no ROS master"
    known = store.version
    store.set_link("no ROS master")
    assert store.version == known
    store.update_mesh(mesh(1.2), wall_s=9.0)
    assert frame(store, known)["link"] == ""


def test_the_selected_node_has_its_neighbours_and_the_age_of_its_fallback_position(store):
    assert store.detail_of(1) == {"neighbours": [], "fallback_age": None}
    fields = {"neighbours": b"\x00\x09", "neighbour_ages": b"\x03\xff"}
    store.update_mesh(mesh(**fields), wall_s=0.0)
    assert store.detail_of(1) == {"neighbours": [(0, 3), (9, 255)], "fallback_age": None}
    store.update_mesh(mesh(**fields, fallback_age=12.4), wall_s=0.5)
    assert store.detail_of(1)["fallback_age"] == 12


def test_a_frame_carries_each_link_once_under_its_use_at_the_lower_id(store):
    nodes = [
        NodeStatus(0, Role.GATEWAY, connected=True),
        NodeStatus(1, connected=True, next_hop=0, neighbours=b"\x00\x09"),
        NodeStatus(9, neighbours=b"\x01"),
    ]
    store.update_mesh(MeshStatus(1.0, nodes), wall_s=0.0)
    links = {
        node: (fields["route_links"], fields["known_links"], fields["lost_links"])
        for node, fields in frame(store, 0)["nodes"].items()
    }
    assert links == {"0": ("2", "0", "0"), "1": ("0", "200", "0"), "9": ("0", "0", "0")}
    nodes[2].on = False
    store.update_mesh(MeshStatus(1.2, nodes), wall_s=0.2)
    assert frame(store, 0)["nodes"]["1"]["lost_links"] == "200"
    store.update_mesh(MeshStatus(9.0, nodes), wall_s=0.3 + JUST_LOST_S)
    assert frame(store, 0)["nodes"]["1"]["lost_links"] == "0"


def test_nodes_at_one_position_come_with_their_slots(store):
    nodes = [NodeStatus(node, position=(2.0, 2.0, float(node))) for node in (1, 2)]
    store.update_mesh(MeshStatus(1.0, [*nodes, NodeStatus(3)]), wall_s=0.0)
    assert frame(store, 0)["nodes"]["3"]["position"] is None
    slots = {node: fields["slot"] for node, fields in frame(store, 0)["nodes"].items()}
    assert slots == {"1": [0, 2], "2": [1, 2], "3": None}


def test_the_end_of_an_earlier_order_is_not_shown_once_a_new_one_is_given(store):
    store.add_events([EventRecord(1.0, 0, "order accepted", (1,), "", 7, A)])
    store.update_mesh(mesh(), wall_s=0.0)
    before = store.version
    ticket = store.expect_orders([1])
    assert frame(store, before)["nodes"] == {"1": {"order": "being sent"}}
    store.add_events([EventRecord(2.0, 0, "order arrived", (1,), "", 7, A)])
    store.update_mesh(mesh(), wall_s=1.0)
    assert frame(store, 0)["nodes"]["1"]["order"] == "being sent"
    store.add_events([EventRecord(3.0, 0, "order sent", (1,), "", 8, B)])
    store.update_mesh(mesh(), wall_s=2.0)
    store.forget_expected(ticket)
    assert frame(store, 0)["nodes"]["1"]["order"] == f"order 8 to {B.in_words()}: sent"


def test_an_order_that_was_refused_leaves_the_earlier_one_as_it_was(store):
    store.add_events([EventRecord(1.0, 0, "order arrived", (1,), "", 7, A)])
    store.update_mesh(mesh(), wall_s=0.0)
    refused, newer = store.expect_orders([1]), store.expect_orders([1])
    store.forget_expected(refused)
    assert frame(store, 0)["nodes"]["1"]["order"] == "being sent"
    store.forget_expected(newer)
    assert frame(store, 0)["nodes"]["1"]["order"] == f"order 7 to {A.in_words()}: arrived"


def test_a_node_says_what_it_does_on_a_shared_channel_and_which_messages_of_users_it_had(store):
    busy = {"airtime": 0.0123, "tries": 1.254, "queue": 2, "given_up": 1}
    busy.update({"data_sent": 3, "data_bytes_sent": 72, "data_queued": 1, "data_given_up": 1})
    store.update_mesh(MeshStatus(1.0, [NodeStatus(1, **busy), NodeStatus(2)]), wall_s=0.0)
    shown = {n: (node["channel"], node["data"]) for n, node in frame(store, 0)["nodes"].items()}
    channel = "1.2 % airtime, 1.25 tries per packet, 2 waiting, 1 given up"
    data = "3 sent (72 bytes), 0 received (0 bytes), 1 waiting, 1 given up"
    assert shown == {"1": (channel, data), "2": ("", "")}


def eventful_store() -> FrameStore:
    store = FrameStore()
    store.update_mesh(mesh(), wall_s=0.0)
    store.update_mesh(mesh(40.0, connected=False), wall_s=2.0)
    sent = EventRecord(30.0, 0, "order sent", (1,), order=7, place=A)
    given_up = EventRecord(41.0, 0, "order given up", (1,), "it flew elsewhere", 7, A)
    store.add_events([sent, given_up])
    store.acknowledge("lost the gateway")
    return store


def test_alarms_and_orders_go_on_with_what_another_store_has_saved():
    before = eventful_store()
    saved = json.loads(json.dumps(before.saved()))
    store = FrameStore()
    store.restore(saved, [], [])
    store.update_mesh(mesh(51.0, connected=False), wall_s=0.0)
    first = frame(store, 0)
    assert first["alarms"] == frame(before, 0)["alarms"]
    assert [alarm["since"] for alarm in first["alarms"]] == [41.0, 40.0]
    assert first["nodes"]["1"]["order"].startswith("order 7 to x 2.00 m, y 3.00 m, z 0 m: given up")
    store.update_mesh(mesh(60.0), wall_s=2.0)  # an acknowledged alarm that is over goes
    assert [alarm["since"] for alarm in frame(store, 0)["alarms"]] == [41.0]


def test_charts_begin_with_ten_minutes_of_the_samples_that_a_store_is_given():
    samples = [take_sample(mesh(float(half) / 2)) for half in range(3001)]
    store = FrameStore()
    store.restart(samples)
    store.update_mesh(mesh(1500.5), wall_s=0.0)
    stamps = [sample["stamp_s"] for sample in frame(store, 0)["samples"]]
    assert (stamps[0], stamps[-2:], len(stamps)) == (902.0, [1500.0, 1500.5], SAMPLES_KEPT)
