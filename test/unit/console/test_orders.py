"""The requests that a page may send."""

from __future__ import annotations

import json
from typing import Sequence

import pytest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.orders import (
    NeighbourWatch,
    PageOrder,
    ReadPlaces,
    number_of,
    parse_request,
)
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.formations.layouts import Order
from drone_mesh.formations.missions import Mission


class Notebook:
    """Controls that write down their orders."""

    def __init__(self) -> None:
        self.done: list[tuple[object, ...]] = []

    def power(self, node: int, on: bool) -> str:
        self.done.append(("power", node, on))
        return "done"

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        self.done.append(("fly", node, x, y, z, *["shared"] * allow_shared_place))
        return "done"

    def layout(self, case: int) -> str:
        self.done.append(("layout", case))
        return "done"

    def formation(self, name: str, orders: Sequence[Order], gateways: Sequence[int]) -> str:
        self.done.append(("formation", name, *orders, *gateways))
        return "done"

    def speed(self, paused: bool, factor: float) -> str:
        self.done.append(("speed", paused, factor))
        return "done"

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:
        self.done.append(("add", node, gateway, x, y))
        return "done"

    def remove(self, node: int) -> str:
        self.done.append(("remove", node))
        return "done"

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:
        self.done.append(("mission", *nodes, mission))
        return "done"

    def pilots(self, action: str) -> str:
        self.done.append(("pilots", action))
        return "done"


FLIGHT = {"nodes": [3, 4], "waypoints": [[0, 1, 2], [2, 3, 4]], "speed": 1.5, "loop": True}


def test_a_mission_reaches_the_pilots_of_its_drones() -> None:
    notebook = Notebook()
    for request in ({"do": "mission", **FLIGHT}, {"do": "pilots", "action": "stop"}):
        order = parse_request(json.dumps({"number": 1, **request}))
        assert isinstance(order, PageOrder)
        order.carry_out(notebook)
    mission = Mission([(0.0, 1.0, 2.0), (2.0, 3.0, 4.0)], 1.5, True)
    assert notebook.done == [("mission", 3, 4, mission), ("pilots", "stop")]


@pytest.mark.parametrize(
    "wrong",
    [
        {"nodes": []},
        {"waypoints": []},
        {"waypoints": [[0, 9000, 1]]},
        {"waypoints": [[0, 9, -1]]},
        {"speed": 0},
        {"speed": 21},
        {"loop": 1},
    ],
)
def test_an_invalid_mission_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(OrderRefused, match="invalid request"):
        parse_request(json.dumps({"number": 1, "do": "mission", **FLIGHT, **wrong}))


@pytest.mark.parametrize(
    ("request_", "done"),
    [
        ({"do": "power", "node": 3, "on": False}, ("power", 3, False)),
        ({"do": "fly", "node": 253, "x": -1.5, "y": 2, "z": 0}, ("fly", 253, -1.5, 2.0, 0.0)),
        (
            {"do": "fly", "node": 2, "x": 1, "y": 2, "z": 0, "allow_shared_place": True},
            ("fly", 2, 1.0, 2.0, 0.0, "shared"),
        ),
        ({"do": "layout", "case": 202}, ("layout", 202)),
        (
            {"do": "formation", "name": "a ring", "places": [[3, 1.5, -2, 4]]},
            ("formation", "a ring", Order(3, Location(latitude=-2.0, longitude=1.5, height=4.0))),
        ),
        (
            {"do": "formation", "name": "all", "places": [[0, 1, 2, 3]], "gateways": [0]},
            ("formation", "all", Order(0, Location(latitude=2.0, longitude=1.0, height=3.0)), 0),
        ),
        ({"do": "speed", "paused": True, "factor": 0}, ("speed", True, 0.0)),
        ({"do": "add", "x": 1.5, "y": -2}, ("add", None, False, 1.5, -2.0)),
        (
            {"do": "add", "node": 9, "gateway": True, "x": 0, "y": 0},
            ("add", 9, True, 0.0, 0.0),
        ),
        ({"do": "remove", "node": 9}, ("remove", 9)),
    ],
)
def test_an_order_is_carried_out_as_it_was_given(request_, done):
    order = parse_request(json.dumps({**request_, "number": 7}))
    assert isinstance(order, PageOrder)
    assert order.number == 7
    notebook = Notebook()
    assert order.carry_out(notebook) == "done"
    assert notebook.done == [done]


def test_a_page_may_watch_a_node_or_none():
    for text, node in (("3", 3), ("null", None)):
        request = parse_request(f'{{"do":"watch","node":{text}}}')
        assert isinstance(request, NeighbourWatch)
        assert request.node == node


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "Invalid JSON"),
        ("{", "Invalid JSON"),
        ("[" * 4096, "Invalid JSON"),
        ("[]", "an object"),
        ("7", "an object"),
        ('{"number":1}', "'do'"),
        ('{"number":1,"do":"reboot"}', "'reboot' .* does not match .* 'power'"),
        ('{"do":"layout","case":0}', "number: "),
        ('{"number":-1,"do":"layout","case":0}', "number: "),
        ('{"number":1,"do":"power","node":254,"on":true}', "node: .* less than or equal to 253"),
        ('{"number":1,"do":"power","node":true,"on":true}', "node: .* integer"),
        ('{"number":1,"do":"power","node":"3","on":true}', "node: .* integer"),
        ('{"number":1,"do":"power","node":3,"on":1}', "on: .* boolean"),
        ('{"number":1,"do":"fly","node":3,"x":NaN,"y":0,"z":0}', "x: .* finite number"),
        ('{"number":1,"do":"fly","node":3,"x":1e999,"y":0,"z":0}', "x: .* finite number"),
        ('{"number":1,"do":"fly","node":3,"x":5001,"y":0,"z":0}', "x: .* or equal to 5000"),
        ('{"number":1,"do":"fly","node":3,"x":0,"y":-5001,"z":0}', "y: .* or equal to -5000"),
        ('{"number":1,"do":"fly","node":3,"x":0,"y":0,"z":-1}', "z: .* or equal to 0"),
        ('{"number":1,"do":"fly","node":3,"x":0,"y":0,"z":501}', "z: .* or equal to 500"),
        ('{"number":1,"do":"fly","node":3,"x":0,"y":0}', "z: "),
        ('{"number":1,"do":"layout","case":4294967296}', "case: "),
        (f'{{"number":1,"do":"layout","case":{"9" * 400}}}', "case: "),
        ('{"number":1,"do":"layout","case":1.5}', "case: "),
        ('{"number":1,"do":"speed","paused":false,"factor":1001}', "factor: "),
        ('{"do":"watch","node":300}', "node: "),
    ],
)
def test_anything_else_is_refused_with_a_reason(text, why):
    with pytest.raises(OrderRefused, match=why) as refused:
        parse_request(text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "number"),
    [('{"number":7,"do":"reboot"}', 7), ('{"number":"7"}', None), ("7", None), ("[" * 4096, None)],
)
def test_a_refusal_goes_back_under_the_number_of_the_request(text, number):
    assert number_of(text) == number


def test_of_a_mission_only_the_way_is_offered_and_of_a_layout_only_the_places():
    at = [[5.1214, 52.0907], [5.1216, 52.0908]]
    drawn = [{"type": "Point", "coordinates": point} for point in at]
    for extra, ways in ([{"type": "LineString", "coordinates": at}], 1), ([], 0):
        text = json.dumps({"type": "GeometryCollection", "geometries": [*drawn, *extra]})
        request = parse_request(
            json.dumps({"do": "places", "number": 1, "name": "a.json", "text": text})
        )
        assert isinstance(request, ReadPlaces)
        found = request.content(Origin(52.0907, 5.1214, 3.0))
        assert (len(found.places), len(found.ways)) == (0 if ways else 2, ways)


def test_a_mission_file_is_offered_with_its_heights_speed_and_notes():
    item = {"type": "SimpleItem", "command": 16, "frame": 3}
    places = ([52.0907, 5.1214, 8], [52.0907, 5.1214, 9])
    items = [{**item, "params": [1, 0, 0, None, *place]} for place in places]
    plan = json.dumps({"fileType": "Plan", "mission": {"items": items, "hoverSpeed": 4}})
    request = parse_request(
        json.dumps({"do": "places", "number": 1, "name": "survey.plan", "text": plan})
    )
    assert isinstance(request, ReadPlaces)
    found = request.content(Origin(52.0907, 5.1214, 3.0))
    assert (found.ways, found.speed) == ([[(0.0, 0.0, 8.0), (0.0, 0.0, 9.0)]], 4.0)
    assert "passed without a stop: item 1, item 2" in found.notes
    with pytest.raises(OrderRefused, match=r"survey\.plan: its places are in degrees"):
        request.content(None)
