"""The page about a recorded run, its numbers, and the same for CSV files."""

from __future__ import annotations

import csv
from dataclasses import asdict, fields
from pathlib import Path
from typing import Sequence, Union

import jinja2

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.lab.run_report.charts import messages_figure, outages_figure, timeline_figure
from drone_mesh.lab.run_report.maps import maps_figure
from drone_mesh.lab.run_report.story import RunStory
from drone_mesh.state.condition import find_trouble, summarise
from drone_mesh.state.model import EventRecord
from drone_mesh.state.outages import MeshSample, Outage
from drone_mesh.view.palette import DARK, LIGHT, css_variables

EVENT_KINDS_LEFT_OUT = frozenset(
    kind.value
    for kind in (
        MeshEventKind.STARTED,
        MeshEventKind.NEIGHBOUR_FOUND,
        MeshEventKind.NEIGHBOUR_LOST,
        MeshEventKind.NODE_MISSING,
    )
)  # too many for a page; the CSV file has them all


def key_numbers(story: RunStory) -> list[tuple[str, str]]:
    """(name, value) of the key figures."""
    first, last = story.samples[0], story.samples[-1]
    seconds = max(last.stamp_s - first.stamp_s, 1e-9)
    lengths = [outage.seconds for outage in story.outages if outage.seconds is not None]
    open_ones = sum(outage.connected_s is None for outage in story.outages)
    flights = sum(outage.decided_s is not None for outage in story.outages)
    longest = f"{max(lengths):.1f} s" if lengths else "none"
    sent = sum(story.messages_of.values())
    return [
        ("Recorded", f"{first.stamp_s:.0f} to {last.stamp_s:.0f} s"),
        ("Nodes", str(len(story.after.nodes))),
        ("Outages", f"{len(story.outages)}" + (f", {open_ones} still open" if open_ones else "")),
        ("Longest", longest),
        ("Flights decided", str(flights)),
        ("Messages", f"{sent} ({sent / seconds:.0f} per s)"),
    ]


def outages_in_words(story: RunStory) -> str:
    """The number of nodes with an outage, without one, and with one that did not end."""
    present = {node.id for node in story.after.nodes}
    without = len(present - {outage.node for outage in story.outages})
    nodes = len({outage.node for outage in story.outages})
    still = len({outage.node for outage in story.outages if outage.connected_s is None})
    return f"{_nodes(nodes)} had an outage of a second or longer; {_nodes(without)} had none." + (
        f" {_nodes(still).capitalize()} had no gateway at the end." if still else ""
    )


def _nodes(count: int) -> str:
    return f"{count} node{'s' * (count != 1)}"


def repair_rows(story: RunStory) -> list[dict[str, str]]:
    """One row per outage: when it happened, and the duration of each repair phase."""
    return [
        {
            "node": str(outage.node),
            "cause": "–" if outage.cause_node is None else f"{outage.cause_node} off",
            "lost": f"{outage.lost_s:.1f} s",
            "noticed": _seconds(outage.cause_s, outage.lost_s),
            "decided": _seconds(outage.lost_s, outage.decided_s),
            "flown": _seconds(outage.decided_s, outage.landed_s),
            "fallback": "–" if outage.fallback is None else f"node {outage.fallback}'s",
            "connected": _seconds(_ready_s(outage), outage.connected_s),
            "total": _seconds(_start_s(outage), outage.connected_s),
            "on_ground": _on_ground(outage),
        }
        for outage in story.outages
    ]


def write_csv(story: RunStory, folder: Path) -> list[Path]:
    """samples.csv, events.csv and outages.csv; returns their paths. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        _write_rows(folder / "samples.csv", MeshSample, story.samples),
        _write_rows(folder / "outages.csv", Outage, story.outages),
        _write_rows(folder / "events.csv", EventRecord, story.events),
    ]


Row = Union[MeshSample, Outage, EventRecord]


def _write_rows(path: Path, kind: type[Row], rows: Sequence[Row]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [column.name for column in fields(kind)])
        writer.writeheader()
        for row in rows:
            writer.writerow({name: _cell(value) for name, value in asdict(row).items()})
    return path


def _cell(value: object) -> object:
    return " ".join(map(str, value)) if isinstance(value, tuple) else value


def _ready_s(outage: Outage) -> float:
    """The earliest time at which it could reconnect: its landing, or its loss if it did not fly."""
    if outage.landed_s is None:
        return outage.lost_s
    return (
        outage.landed_s if outage.connected_s is None else min(outage.landed_s, outage.connected_s)
    )


def _start_s(outage: Outage) -> float:
    return outage.lost_s if outage.cause_s is None else outage.cause_s


def _seconds(start_s: float | None, stop_s: float | None) -> str:
    return "–" if start_s is None or stop_s is None else f"{stop_s - start_s:.1f} s"


def _on_ground(outage: Outage) -> str:
    """Cause to connection, without flight time (docs/protocol.md, "Requirements")."""
    if outage.connected_s is None:
        return "–"
    flown_s = 0.0
    if outage.decided_s is not None and outage.landed_s is not None:
        flown_s = _ready_s(outage) - outage.decided_s
    return f"{outage.connected_s - _start_s(outage) - flown_s:.1f} s"


ROWS_SHOWN = 40  # a longer table of outages is folded
_TEMPLATE = Path(__file__).resolve().parent / "page.html"


def render_page(story: RunStory, title: str) -> str:
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    return template.render(
        title=title,
        light=css_variables(LIGHT),
        dark=css_variables(DARK),
        numbers=key_numbers(story),
        summary=summarise(story.after.nodes, find_trouble(story.after.nodes)),
        repairs=repair_rows(story),
        outages_in_words=outages_in_words(story),
        rows_shown=ROWS_SHOWN,
        left=[(node.id, node.repair) for node in story.after.nodes if node.repair],
        blips=story.blips,
        timeline=timeline_figure(story),
        outages=outages_figure(story) if story.outages else "",
        maps=maps_figure(story),
        messages=messages_figure(story),
        events=[event for event in story.events if event.kind not in EVENT_KINDS_LEFT_OUT],
        recorded=len(story.events),
    )
