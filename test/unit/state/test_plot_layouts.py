"""config/foxglove.json and config/plotjuggler.xml name topics and fields that exist."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, Iterator

import pytest

ROOT = Path(__file__).resolve().parents[3]
NUMBERS = re.compile(r"bool|u?int(8|16|32|64)|float(32|64)")
OF_ROS = {"/rosout_agg", "/diagnostics", "/mesh/markers"}  # of other packages' types
TYPES = {"/mesh/state": "MeshState", "/mesh/events": "MeshEvent"}


def fields(message: str) -> dict[str, str]:
    text = (ROOT / "msg" / f"{message}.msg").read_text(encoding="utf-8")
    found = re.findall(r"^([\w/]+(?:\[\d*\])?)\s+(\w+)\s*(?:#|$)", text, re.M)
    return {name: kind for kind, name in found}


def kind_of(message: str, way: str) -> str:
    """The type at the end of a.b[0].c in a message; KeyError if there is no such field."""
    name, _, rest = way.partition(".")
    field, _, index = name.partition("[")
    kind = fields(message)[field]
    if index:
        assert kind.endswith("]"), f"{field} of {message} is no array"
        kind = kind.partition("[")[0]
    return kind_of(kind, rest) if rest else kind


def panels_in(layout: Any) -> Iterator[str]:
    if isinstance(layout, str):
        yield layout
    else:
        assert layout["direction"] in ("row", "column")
        assert 0 < layout["splitPercentage"] < 100
        for side in ("first", "second"):
            yield from panels_in(layout[side])


@pytest.fixture
def foxglove() -> Any:
    return json.loads((ROOT / "config" / "foxglove.json").read_text(encoding="utf-8"))


def test_each_panel_of_foxglove_has_its_place_and_its_settings(foxglove: Any) -> None:
    assert set(foxglove) == {
        *("configById", "globalVariables", "userNodes", "playbackConfig", "layout"),
    }
    panels = list(panels_in(foxglove["layout"]))
    assert sorted(panels) == sorted(foxglove["configById"])
    kinds = {panel.partition("!")[0] for panel in panels}
    assert kinds == {"3D", "Plot", "RawMessages", "RosOut", "DiagnosticSummary"}


def test_each_path_of_foxglove_ends_at_a_number_of_a_message(foxglove: Any) -> None:
    paths = []
    for panel, settings in foxglove["configById"].items():
        if panel.startswith("Plot!"):
            paths += [path["value"] for path in settings["paths"]]
        elif panel.startswith("3D!"):
            assert set(settings["topics"]) <= OF_ROS
        else:
            topic = settings.get("topicPath") or settings["topicToRender"]
            assert topic in OF_ROS | set(TYPES)
    assert len(paths) == 18
    for path in paths:
        topic, _, way = path.partition(".")
        way, chosen = re.subn(r"\{(\w+)==\d+\}", "", way)
        assert chosen == 1
        assert NUMBERS.fullmatch(kind_of(TYPES[topic], way)), path
        assert kind_of(TYPES[topic], "nodes[:].id") == "uint8"


def test_each_curve_of_plotjuggler_is_a_number_of_a_message() -> None:
    root = ET.parse(ROOT / "config" / "plotjuggler.xml").getroot()
    assert root.tag == "root"
    (window,) = root.findall("tabbed_widget")
    assert window.get("parent") == "main_window"
    for splitter in window.iter("DockSplitter"):
        assert len(splitter) == int(splitter.get("count", ""))
        assert len(splitter.get("sizes", "").split(";")) == len(splitter)
        assert all(len(area.findall("plot")) == 1 for area in splitter)
    curves = [curve.get("name", "") for curve in root.iter("curve")]
    assert len(curves) > 40
    for curve in curves:
        topic = next(topic for topic in TYPES if curve.startswith(f"{topic}/"))
        way = curve[len(topic) + 1 :].replace("/", ".")
        assert NUMBERS.fullmatch(kind_of(TYPES[topic], way)), curve
