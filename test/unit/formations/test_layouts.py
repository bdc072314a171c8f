"""Layouts: shipped cases, built-in cases, refused files (docs/ros.md, "Drone manager")."""

from __future__ import annotations

from pathlib import Path

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.formations.layouts import Layouts, Order, UnknownCase, read_layout
from drone_mesh.yaml_file import read_text

SHIPPED = Path(__file__).parents[3] / "config" / "casus.yaml"


@pytest.fixture
def shipped():
    return Layouts.load(SHIPPED)


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return Layouts.load(path)

    return load


def places(layouts, case):
    """The orders of a case as they go out: (id, longitude, latitude, height)."""
    return [
        (order.node_id, order.goal.longitude, order.goal.latitude, order.goal.height)
        for order in layouts.orders(case)
    ]


def test_the_shipped_file_has_the_documented_cases(shipped):
    assert shipped.cases == [*range(18), 100, 101, 102, 201, 202]


def test_orders_go_out_from_the_highest_id_down(shipped):
    assert places(shipped, 101) == [
        (6, 3, 16, 0),
        (5, -3, 16, 0),
        (4, 3, 10, 0),
        (3, -3, 10, 0),
        (2, 3, 4, 0),
        (1, -3, 4, 0),
    ]
    for case in shipped.cases:
        ids = [order.node_id for order in shipped.orders(case)]
        assert ids == sorted(ids, reverse=True)


def test_the_first_number_of_a_place_is_the_longitude(shipped):
    (order,) = shipped.orders(17)
    assert order.goal == Location(latitude=26.5, longitude=8.0, height=0.0)


def test_a_single_case_sends_one_drone_to_its_place_in_the_field_case(shipped):
    field = {order.node_id: order for order in shipped.orders(0)}
    assert sorted(field) == list(range(1, 18))
    for drone in range(1, 18):
        assert shipped.orders(drone) == [field[drone]]


def test_the_grid_case_orders_all_hundred_five_metres_apart(shipped):
    orders = places(shipped, 100)
    assert len(orders) == 100
    assert orders[-1] == (1, 5, 0, 0)
    assert orders[-2] == (2, 5, 5, 0)
    assert orders[-11] == (11, 10, 0, 0)
    assert orders[0] == (100, 50, 45, 0)
    assert len({order[1:] for order in orders}) == 100


def test_the_built_in_field_case_is_that_of_the_shipped_file(shipped):
    built_in = Layouts({})
    assert built_in.cases == [*range(18), 100]
    for case in built_in.cases:
        assert built_in.orders(case) == shipped.orders(case)


def test_a_case_in_the_file_wins_over_a_built_in_one(load):
    layouts = load("cases: {100: {1: [1, 2, 3]}, 5: {9: [4, 5, 6.5]}}")
    assert places(layouts, 100) == [(1, 1, 2, 3)]
    assert places(layouts, 5) == [(9, 4, 5, 6.5)]
    assert places(layouts, 6) == [(6, -7, 12, 0)]


def test_single_cases_follow_the_field_case_of_the_file(load):
    layouts = load("cases: {0: {1: [1, 2, 0], 2: [3, 4, 0]}}")
    assert places(layouts, 2) == [(2, 3, 4, 0)]
    assert layouts.cases == [0, 1, 2, 100]


def test_an_unknown_case_is_refused_with_the_known_ones(shipped):
    with pytest.raises(
        UnknownCase, match=r"^unknown case 18: use one of 0..17, 100..102, 201, 202$"
    ) as refused:
        shipped.orders(18)
    assert isinstance(refused.value, MeshError)


def test_a_byte_order_mark_is_no_part_of_a_text(tmp_path):
    path = tmp_path / "layout.yaml"
    path.write_bytes(b"\xef\xbb\xbfcases: {5: {1: [1, 2, 3]}}")
    assert read_text(path) == "cases: {5: {1: [1, 2, 3]}}"
    assert Layouts.load(path).orders(5) == [Order(1, Location(2.0, 1.0, 3.0))]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "expected 'cases:'"),
        ("cases: [1]", "expected 'cases:'"),
        ("casus: {}", "unknown key casus: expected only 'cases'"),
        (
            "cases: {one: {1: [0, 0, 0]}}",
            "invalid case 'one': must be a whole number 0..4294967295",
        ),
        ("cases: {4294967296: {1: [0, 0, 0]}}", "invalid case 4294967296:"),
        ("cases: {true: {1: [0, 0, 0]}}", "invalid case True:"),
        ("cases: {5: {}}", "case 5: expected 'node id"),
        ("cases: {5: [1, 2]}", "case 5: expected 'node id"),
        ("cases: {5: {254: [0, 0, 0]}}", "case 5: invalid node id 254: must be 0..253"),
        ("cases: {5: {1.0: [0, 0, 0]}}", "case 5: invalid node id 1.0"),
        ("cases:\n  5:\n    1: [0, 0]", r"line 3: case 5, drone 1: invalid place \[0, 0\]"),
        ("cases: {5: {1: 7}}", "case 5, drone 1: invalid place 7"),
        ("cases: {5: {1: [0, here, 0]}}", "case 5, drone 1: invalid place .*"),
        ("cases: {5: {1: [0, true, 0]}}", "case 5, drone 1: invalid place .*"),
        ("cases: {5: {1: [.nan, 0, 0]}}", "case 5, drone 1: longitude nan is not a finite"),
        ("cases: {5: {1: [0, 5001, 0]}}", "case 5, drone 1: latitude 5001 m is outside"),
        ("cases: {5: {1: [0, 0, 501]}}", "case 5, drone 1: height 501 m is outside 0..500"),
        ("cases:\n  5: {1: [0, 0, 0]}\n  5: {2: [0, 0, 0]}", "line 3: duplicate key 5"),
        ("cases:\n  5:\n    010: [0, 0, 0]", "line 3: 010 is not a number in decimal digits"),
        ("cases:\n  5:\n    1: [0, 1:30, 0]", "line 3: 1:30 is not a number in decimal digits"),
        ("cases:\n  5:\n    1: [0, 0, 0]\n    1: [1, 1, 1]", "line 4: duplicate key 1"),
    ],
)
def test_a_bad_file_is_refused_with_the_place_and_the_reason(load, tmp_path, text, why):
    with pytest.raises(ConfigurationError, match=why) as refused:
        load(text)
    assert str(refused.value).startswith(str(tmp_path / "mine.yaml"))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match="nowhere.yaml: No such file"):
        Layouts.load(tmp_path / "nowhere.yaml")


def test_a_layout_is_read_from_text_from_the_highest_id_down():
    orders = read_layout("cases:\n  7:\n    1: [1, 2, 3]\n    4: [5, 6, 0]\n")
    assert [order.node_id for order in orders] == [4, 1]
    assert orders[1].goal == Location(latitude=2.0, longitude=1.0, height=3.0)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("cases: {1: {1: [0, 0, 0]}, 2: {1: [0, 0, 0]}}", "the file: has 2 cases: keep the one"),
        ("cases:\n  1:\n    1: [far, 0, 0]\n", "the file, line 3: case 1, drone 1: invalid place"),
        ("nothing", "the file: expected 'key: value' lines"),
    ],
)
def test_an_invalid_layout_text_is_refused(text, why):
    with pytest.raises(ConfigurationError, match=why):
        read_layout(text)
