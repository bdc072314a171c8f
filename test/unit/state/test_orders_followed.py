"""The events of gateways say how far the latest order of a drone has come."""

from __future__ import annotations

import struct

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord, NodeStatus
from drone_mesh.state.observation import path_ahead
from drone_mesh.state.orders import OrderProgress, OrderWatch, way_left

HERE = Location(latitude=2.0, longitude=1.0, height=3.0)
SEVEN = "order 7 to x 1.00 m, y 2.00 m, z 3 m"
EIGHT = "order 8 to x 0.00 m, y 0.00 m, z 0 m"
THERE = Location(0.0, 0.0, 0.0)
SENT = (0, "order sent", 7, HERE)
ACCEPTED = (0, "order accepted", 7, HERE)
ARRIVED = (0, "order arrived", 7, HERE)
SENT_EIGHT = (0, "order sent", 8, THERE)


def event(stamp_s, gateway, kind, number, goal, reason=""):
    """An event of that gateway about an order to drone 5."""
    return EventRecord(stamp_s, gateway, kind, (5,), reason, number, goal)


def watch(*events):
    """(gateway, kind, number, goal, reason) of drone 5."""
    watch = OrderWatch()
    watch.on_events(event(1.0, *given) for given in events)
    return watch


def words(*events, node=None):
    return watch(*events).words(5, node)


def test_an_order_is_followed_from_the_request_to_the_arrival():
    assert words(SENT) == f"{SEVEN}: sent"
    assert words(SENT, ACCEPTED) == f"{SEVEN}: accepted"
    assert words(SENT, ACCEPTED, ARRIVED) == f"{SEVEN}: arrived"


def test_a_drone_on_its_way_has_metres_and_seconds_left():
    flying = NodeStatus(5, position=(1.0, 10.0, 3.0), path=(1.0, 2.0, 3.0))
    assert words(SENT, ACCEPTED, node=flying) == f"{SEVEN}: under way, 8 m and 3 s left"
    elsewhere = NodeStatus(5, position=(1.0, 10.0, 3.0), path=(9.0, 9.0, 0.0))
    assert words(SENT, ACCEPTED, node=elsewhere) == f"{SEVEN}: accepted"


def test_the_seconds_left_are_those_of_a_flight():
    path = FlightPath((0.0, 0.0, 0.0), (30.0, 0.0, 0.0), start_s=0.0)
    for now_s in (0.0, 1.0, 7.5, 14.5):
        node = NodeStatus(5, position=path.position_at(now_s), path=path_ahead(path, now_s))
        left = way_left(node, Location.from_vector(path.goal))
        assert left is not None
        assert abs(left[1] - (path.duration_s - now_s)) < 0.01


def test_every_end_keeps_its_reason():
    refused = words(SENT, (0, "order refused", 7, HERE, "battery at 9 %: land"))
    assert refused == f"{SEVEN}: refused: battery at 9 %: land"
    given_up = words(SENT, (0, "order given up", 7, HERE, "landed early"))
    assert given_up == f"{SEVEN}: given up: landed early"
    replaced = words(SENT, (0, "order replaced", 7, HERE, "by order 8"))
    assert replaced == f"{SEVEN}: replaced by order 8"
    lost = words(SENT, (0, "order lost contact", 7, HERE, "at 4 s: it did not reply"))
    assert lost == f"{SEVEN}: lost contact at 4 s: it did not reply"


def test_the_end_of_an_older_order_does_not_hide_the_latest_one():
    ended = (0, "order replaced", 7, HERE, "by order 8")
    assert words(SENT, SENT_EIGHT, ended) == f"{EIGHT}: sent"


def test_a_second_gateway_without_a_route_does_not_hide_the_first_ones_success():
    elsewhere = (1, "no route", 3, HERE)
    assert words(SENT, elsewhere) == f"{SEVEN}: sent"
    assert words(elsewhere, SENT) == f"{SEVEN}: sent"
    assert words((0, "no route", 7, HERE)) == f"{SEVEN}: no route"


def test_other_drones_and_relays_that_have_no_route_say_nothing_of_an_order():
    assert watch(SENT).words(6, None) == ""
    assert words((3, "no route", 0, None)) == ""


def test_a_drone_that_flies_on_to_its_old_place_is_not_said_to_stay():
    flies_on = NodeStatus(5, position=(9.0, 0.0, 0.0), path=(1.0, 2.0, 3.0))
    followed = watch(SENT, ACCEPTED, (0, "no route", 8, THERE))
    assert followed.words(5, flies_on) == f"{EIGHT}: no route"
    assert followed.since(flies_on) == "flies to x 1.00 m, y 2.00 m, z 3 m"


def test_what_a_drone_did_after_its_arrival_is_told():
    followed = watch(SENT, ACCEPTED, ARRIVED)
    assert followed.since(NodeStatus(5, position=(1.0, 2.0, 3.0))) == ""
    followed.on_events([EventRecord(9.0, 5, "flight decided", (2,))])
    away = NodeStatus(5, position=(1.0, 190.0, 3.0))
    assert followed.since(away) == "flew to repair the mesh, is 188 m from there"
    followed.on_events([EventRecord(9.5, 5, "flight decided", (), "lands: no gateway for 120 s")])
    assert followed.since(away).startswith("flew to repair the mesh, lands: no gateway for 120 s")
    followed.on_events([event(10.0, *SENT_EIGHT)])
    assert followed.since(away) == ""


def progress(*events):
    """(seconds, gateway, kind, number, goal, reason) of drone 5, ordered after 10 s."""
    progress = OrderProgress(5, HERE, since_s=10.0)
    for given in events:
        progress.on_event(event(*given))
    return progress


def test_one_order_is_followed_to_its_end():
    sent = (11.0, *SENT)
    assert not progress().was_sent
    assert progress(sent).was_sent
    assert progress(sent, (12.0, *ACCEPTED)).state is OrderState.ACCEPTED
    arrived = progress(sent, (19.0, *ARRIVED))
    assert (arrived.is_over, arrived.in_words()) == (True, "arrived")
    refused = progress(sent, (12.0, 0, "order refused", 7, HERE, "battery at 9 %"))
    assert (refused.is_over, refused.in_words()) == (True, "refused: battery at 9 %")


def test_older_orders_and_those_to_other_places_are_not_this_one():
    assert not progress((9.0, *SENT)).was_sent
    assert not progress((11.0, *SENT_EIGHT)).was_sent
    other = progress((11.0, *SENT), (12.0, 0, "order refused", 6, HERE, "crashed"))
    assert not other.is_over


def test_an_order_is_known_by_its_place_as_the_wire_carries_it():
    goal = Location(2.005, 1.125, 3.4)
    carried = Location(*struct.unpack("<ffh", struct.pack("<ffh", *goal[:2], 3)))
    progress = OrderProgress(5, goal, since_s=10.0)
    progress.on_event(event(11.0, 0, "order sent", 7, carried))
    assert progress.was_sent


def test_the_order_of_one_gateway_may_fail_while_that_of_another_is_open():
    first, second = (11.0, *SENT), (11.0, 1, "order sent", 3, HERE)
    lost = (12.0, 0, "no route", 7, HERE)
    assert not progress(first, second, lost).is_over
    given_up = (13.0, 1, "order given up", 3, HERE, "landed early")
    assert progress(first, second, lost, given_up).is_over
    arrived = progress(first, second, (19.0, 1, "order arrived", 3, HERE))
    assert (arrived.is_over, arrived.state) == (True, OrderState.ARRIVED)
