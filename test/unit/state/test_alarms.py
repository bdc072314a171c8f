"""Alarms last until somebody has seen them and they are over."""

from __future__ import annotations

import json

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.state.alarms import AlarmBook
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus

PLACE = Location(2.0, 1.0, 3.0)


def state(now_s, *nodes):
    return MeshStatus(now_s, nodes)


def lost(node):
    return NodeStatus(node)


def well(node, **fields):
    return NodeStatus(node, connected=True, **fields)


def said(book):
    return [(g["text"], g["nodes"], g["over"], g["acknowledged"]) for g in book.groups()]


@pytest.fixture
def book():
    return AlarmBook()


def test_nodes_with_the_same_alarm_are_one_entry_since_the_first(book):
    book.update(state(1.0, well(1), well(2)))
    book.update(state(5.0, lost(1), well(2)))
    book.update(state(6.0, lost(1), lost(2)))
    assert said(book) == [("lost the gateway", [1, 2], False, False)]
    assert book.groups()[0]["since"] == 5.0


def test_a_node_that_never_had_a_gateway_has_lost_none(book):
    book.update(state(1.0, lost(1)))
    assert said(book) == []


def test_a_drone_that_has_just_landed_has_a_moment_to_connect_again(book):
    book.update(state(1.0, well(1)))
    book.update(state(2.0, NodeStatus(1, path=[1.0, 2.0, 3.0])))
    book.update(state(3.0, lost(1)))
    assert said(book) == []
    book.update(state(4.0, lost(1)))
    assert said(book) == [("lost the gateway", [1], False, False)]


def test_an_alarm_that_is_over_stays_until_it_is_acknowledged(book):
    book.update(state(1.0, well(1)))
    book.update(state(2.0, lost(1)))
    book.update(state(3.0, well(1)))
    assert said(book) == [("lost the gateway", [1], True, False)]
    assert book.acknowledge("lost the gateway") == 1
    assert said(book) == []


def test_a_node_that_was_switched_off_leaves_no_alarm_that_it_lost_its_gateway_before_or_after(
    book,
):
    book.update(state(1.0, well(1), well(2)))
    book.update(state(2.0, lost(1), well(2)))
    book.update(state(3.0, NodeStatus(1, on=False), NodeStatus(2, on=False)))
    assert said(book) == []
    book.update(state(4.0, lost(1), lost(2)))  # on again, they look for a gateway
    assert said(book) == []


def test_a_node_whose_battery_is_empty_was_not_switched_off(book):
    book.update(state(1.0, well(1)))
    book.update(state(2.0, lost(1)))
    book.update(state(3.0, NodeStatus(1, on=False, battery=0.0)))
    assert ("lost the gateway", [1], True, False) in said(book)


def test_an_acknowledged_alarm_stays_until_it_is_over_and_comes_back_as_new(book):
    book.update(state(1.0, well(1, battery=12.0)))
    book.acknowledge("low battery")
    book.update(state(2.0, well(1, battery=11.0)))
    assert said(book) == [("low battery", [1], False, True)]
    book.update(state(3.0, well(1, battery=90.0)))
    assert said(book) == []
    book.update(state(4.0, well(1, battery=12.0)))
    assert said(book) == [("low battery", [1], False, False)]


def test_a_jammer_is_an_alarm_of_the_whole_mesh_and_the_first_one(book):
    book.update(state(1.0, well(1), well(2)))
    book.update(state(2.0, NodeStatus(1, jammed=True), NodeStatus(2, jammed=True)))
    assert said(book) == [
        ("the radio channel is jammed", [], False, False),
        ("lost the gateway", [1, 2], False, False),
    ]
    book.update(state(3.0, well(1), well(2)))
    assert ("the radio channel is jammed", [], True, False) in said(book)


def test_alarms_of_nodes_and_of_the_whole_mesh_go_on_after_a_restart_of_the_console():
    before, book = AlarmBook(), AlarmBook()
    before.update(state(1.0, NodeStatus(1, jammed=True), NodeStatus(2, crashed=True)))
    assert len(said(before)) == 2
    book.restore(json.loads(json.dumps(before.saved())))
    assert said(book) == said(before)


def test_a_failed_order_is_an_alarm_until_a_later_order_is_accepted(book):
    book.on_events([EventRecord(1.0, 0, "order refused", (4,), "battery at 9 %", 7, PLACE)])
    book.update(state(2.0, well(4)))
    assert said(book) == [("refused an order: battery at 9 %", [4], False, False)]
    book.on_events([EventRecord(3.0, 0, "order accepted", (4,), "", 8, PLACE)])
    assert said(book) == [("refused an order: battery at 9 %", [4], True, False)]


def test_of_the_failed_orders_of_a_drone_the_last_one_is_an_alarm(book):
    for second in range(100):
        reason = f"battery at {100 - second} %"
        book.on_events(
            [EventRecord(float(second), 0, "order refused", (4,), reason, second, PLACE)]
        )
    assert said(book) == [("refused an order: battery at 1 %", [4], False, False)]


def test_another_radio_with_the_id_of_a_node_is_an_alarm(book):
    book.update(state(1.0, well(1, shares_id=True)))
    assert said(book) == [("another radio uses id 1", [1], False, False)]
    book.update(state(70.0, well(1)))
    assert said(book) == [("another radio uses id 1", [1], True, False)]


def test_silent_and_crashed_nodes_are_alarms(book):
    book.update(state(1.0, well(1, report_age=60.0), well(2, crashed=True)))
    assert {text for text, *_ in said(book)} == {"does not report", "crashed"}
