"""From states and events to the story of a run, its page and its tables."""

from __future__ import annotations

import csv
import re

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.lab.run_report.charts import outages_figure, phases_of
from drone_mesh.lab.run_report.page import (
    ROWS_SHOWN,
    key_numbers,
    outages_in_words,
    render_page,
    repair_rows,
    write_csv,
)
from drone_mesh.lab.run_report.story import NothingRecorded, RunStory, tell_story
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus


def state(stamp_s: float, on: bool = True, lost: bool = False, x: float = 12.0) -> MeshStatus:
    """A line: gateway 0, router 1, router 2 behind it at `x`."""
    sent = int(10 * stamp_s)
    return MeshStatus(
        stamp_s,
        [
            NodeStatus(0, Role.GATEWAY, connected=True, hops=0, next_hop=0, neighbours=b"\x01",
                       position=(0.0, 0.0, 0.0), total_messages=sent),
            NodeStatus(1, on=on, connected=on, hops=1, next_hop=0, neighbours=b"\x00\x02",
                       position=(6.0, 0.0, 0.0), total_messages=sent),
            NodeStatus(2, connected=not lost, hops=2, next_hop=1, neighbours=b"\x01",
                       position=(x, 0.0, 0.0), total_messages=sent),
        ],
    )  # fmt: skip


STATES = [
    state(1.0),
    state(50.0),
    state(101.0, on=False, lost=True),
    state(140.0, on=False, lost=True, x=10.0),
    state(150.0, on=False, x=6.0),
]
EVENTS = [
    EventRecord(0.5, 2, "connected", (0,)),
    EventRecord(0.5, 1, "connected", (0,)),
    EventRecord(20.0, 2, "disconnected", (0,)),
    EventRecord(20.2, 2, "connected", (0,)),
    EventRecord(100.0, 1, "power off"),
    EventRecord(100.0, 1, "disconnected", (0,)),
    EventRecord(101.0, 2, "disconnected", (0,)),
    EventRecord(131.0, 2, "emergency"),
    EventRecord(138.0, 2, "flight decided", (1,)),
    EventRecord(141.0, 2, "landed"),
    EventRecord(142.5, 2, "connected", (0,), "1 hop & <more>"),
]
LEFT_OUT = [EventRecord(0.4, 1, "neighbour found", (0,)), EventRecord(0.3, 1, "started")]


@pytest.fixture(scope="module")
def page() -> str:
    """Of that run. Drawing it takes half a second."""
    return render_page(tell_story(STATES, [*EVENTS, *LEFT_OUT]), "A <run> & more")


def test_a_repair_is_described_with_the_duration_of_each_phase():
    story = tell_story(STATES, EVENTS)
    assert repair_rows(story) == [
        {
            "node": "2", "cause": "1 off", "lost": "101.0 s", "noticed": "1.0 s",
            "decided": "37.0 s", "flown": "3.0 s", "fallback": "node 1's", "connected": "1.5 s",
            "total": "42.5 s", "on_ground": "39.5 s",
        }
    ]  # fmt: skip
    assert story.blips == 1


def test_the_map_before_is_the_last_one_before_the_power_off():
    story = tell_story(STATES, EVENTS)
    assert story.before.stamp_s == 50.0
    assert story.after.stamp_s == 150.0
    assert story.tracks == {2: [(12.0, 0.0), (10.0, 0.0), (6.0, 0.0)]}


def test_messages_count_from_the_beginning_of_the_recording():
    assert tell_story(STATES, EVENTS).messages_of == {0: 1490, 1: 1490, 2: 1490}


def test_the_phases_of_a_bar_follow_one_another():
    (outage,) = tell_story(STATES, EVENTS).outages
    assert [(start, stop, name) for start, stop, name, _colour in phases_of(outage, 150.0)] == [
        (101.0, 131.0, "waits for a gateway"),
        (131.0, 138.0, "negotiates"),
        (138.0, 141.0, "flies"),
        (141.0, 142.5, "reconnects"),
    ]


def test_a_drone_that_is_connected_before_it_lands_flew_until_it_was_connected():
    late = [*EVENTS[:-2], EventRecord(142.5, 2, "connected", (0,)), EventRecord(143.0, 2, "landed")]
    story = tell_story(STATES, late)
    (row,) = repair_rows(story)
    assert (row["flown"], row["connected"], row["on_ground"]) == ("5.0 s", "0.0 s", "38.0 s")
    *_, (start, stop, name, _colour) = phases_of(story.outages[0], 150.0)
    assert (start, stop, name) == (138.0, 142.5, "flies")


def test_a_loss_that_lasts_is_drawn_to_the_end():
    (outage,) = tell_story(STATES[:3], EVENTS[:7]).outages
    assert [(start, stop) for start, stop, *_ in phases_of(outage, 150.0)] == [(101.0, 150.0)]


def test_only_the_last_run_in_a_recording_is_described():
    story = tell_story([state(900.0), *STATES], EVENTS)
    assert [sample.stamp_s for sample in story.samples] == [1.0, 50.0, 101.0, 140.0, 150.0]


def test_without_a_state_there_is_no_story():
    with pytest.raises(NothingRecorded, match="was /mesh/state recorded"):
        tell_story([], EVENTS)


def test_the_page_is_one_file_that_needs_nothing_from_elsewhere(page):
    assert "<h1>A &lt;run&gt; &amp; more</h1>" in page
    assert "1 hop &amp; &lt;more&gt;" in page
    assert page.count("<svg") == 4
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page)
    assert "37.0 s" in page


def test_a_run_without_losses_makes_a_page_as_well():
    page = render_page(tell_story([state(1.0)], []), "quiet")
    assert "No node was without a gateway" in page
    assert page.count("<svg") == 3


def test_the_key_numbers_sum_up_the_run():
    assert dict(key_numbers(tell_story(STATES, EVENTS))) == {
        "Recorded": "1 to 150 s",
        "Nodes": "3",
        "Outages": "1",
        "Longest": "41.5 s",
        "Flights decided": "1",
        "Messages": "4470 (30 per s)",
    }


def test_tables_are_written_as_csv(tmp_path):
    paths = write_csv(tell_story(STATES, EVENTS), tmp_path / "numbers")
    assert sorted(path.name for path in paths) == ["events.csv", "outages.csv", "samples.csv"]
    with (tmp_path / "numbers" / "outages.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["node"], row["lost_s"], row["fallback"]) == ("2", "101.0", "1")
    with (tmp_path / "numbers" / "events.csv").open(encoding="utf-8", newline="") as file:
        events = list(csv.DictReader(file))
    assert events[8]["kind"] == "flight decided"
    assert events[8]["peers"] == "1"


def test_the_page_counts_the_events_it_shows_of_all_events(page):
    assert f"Events ({len(EVENTS)} of {len(EVENTS) + len(LEFT_OUT)})" in page


def test_the_colours_of_figures_follow_the_theme_of_the_page(page):
    style, _end, body = page.partition("</style>")
    assert "prefers-color-scheme: dark" in style
    assert "stroke: var(--connected)" in body
    assert not re.search(r"(fill|stroke): #(?!000000)", body)


def test_a_moment_without_routers_is_a_gap_and_not_all_connected():
    starting = MeshStatus(0.5, [NodeStatus(1, on=False)])
    story = tell_story([starting, *STATES], EVENTS)
    assert [sample.connected_share for sample in story.samples][:2] == [None, 1.0]
    assert render_page(story, "starting").count("<svg") == 4


def test_the_page_says_what_each_node_still_does_about_its_lost_connection_at_the_end():
    end = state(160.0, on=False, lost=True)
    end.nodes[2].repair = "does not fly: the place of 1 is occupied by 3"
    page = render_page(tell_story([*STATES, end], EVENTS), "a run")
    assert "<li>node 2: does not fly: the place of 1 is occupied by 3</li>" in page


def test_the_page_of_a_mesh_that_needs_no_repair_has_no_such_list(page):
    assert "<li>" not in page


def crowd(nodes: int, without: int) -> RunStory:
    """All nodes but the last `without` have an outage; that of node 1 does not end."""
    mesh = MeshStatus(
        9.0, [NodeStatus(node, position=(float(node), 0.0, 0.0)) for node in range(nodes)]
    )
    lost = [EventRecord(1.0, node, "disconnected") for node in range(nodes - without)]
    back = [EventRecord(7.0, event.node, "connected", (0,)) for event in lost if event.node != 1]
    return tell_story([mesh], [*lost, *back])


def test_the_chart_of_a_crowd_is_not_higher_than_two_pages():
    heights = {}
    for nodes in (3, 253):
        svg = outages_figure(crowd(nodes, 1))
        found = re.search(r'height="([0-9.]+)pt"', svg)
        assert found
        heights[nodes] = float(found[1]) / 72
        assert "node 0" in svg
    assert heights[3] < 2.5
    assert heights[253] < 14.0


def test_the_page_says_how_many_nodes_had_no_outage_and_folds_a_long_table(page):
    assert outages_in_words(crowd(4, 2)) == (
        "2 nodes had an outage of a second or longer; 2 nodes had none. "
        "1 node had no gateway at the end."
    )
    assert outages_in_words(tell_story(STATES, EVENTS)) in page
    assert "outages as a table" not in page
    long = render_page(crowd(ROWS_SHOWN + 3, 2), "run")
    assert f"<summary>All {ROWS_SHOWN + 1} outages as a table</summary>" in long
