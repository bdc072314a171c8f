"""The events of gateways say how far the latest order of a drone has come."""

from __future__ import annotations

from drone_mesh.communication.order_record import OrderState
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord, NodeStatus
from drone_mesh.state.observation import path_ahead
from drone_mesh.state.orders import OrderProgress, OrderWatch, way_left

HERE = Location(latitude=2.0, longitude=1.0, height=3.0)
SEVEN = "order 7 to x 1.00 m, y 2.00 m, z 3 m"
EIGHT = "order 8 to x 0.00 m, y 0.00 m, z 0 m"
SENT = (0, "order sent", SEVEN)
ACCEPTED = (0, "order accepted", SEVEN)
ARRIVED = (0, "order arrived", SEVEN)


def watch(*events):
    """(gateway, kind, detail) of drone 5."""
    watch = OrderWatch()
    watch.take(EventRecord(1.0, node, kind, (5,), detail) for node, kind, detail in events)
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
    refused = words(SENT, (0, "order refused", f"{SEVEN}: battery at 9 %: land"))
    assert refused == f"{SEVEN}: refused: battery at 9 %: land"
    given_up = words(SENT, (0, "order given up", f"{SEVEN}: landed early"))
    assert given_up == f"{SEVEN}: given up: landed early"
    replaced = words(SENT, (0, "order replaced", f"{SEVEN}: by order 8"))
    assert replaced == f"{SEVEN}: replaced by order 8"
    lost = words(SENT, (0, "order lost contact", f"{SEVEN}: at 4 s: it did not reply"))
    assert lost == f"{SEVEN}: lost contact at 4 s: it did not reply"


def test_the_end_of_an_older_order_does_not_hide_the_latest_one():
    ended = (0, "order replaced", f"{SEVEN}: by order 8")
    assert words(SENT, (0, "order sent", EIGHT), ended) == f"{EIGHT}: sent"


def test_a_second_gateway_without_a_route_does_not_hide_the_first_ones_success():
    elsewhere = (1, "no route", "order 3 to x 1.00 m, y 2.00 m, z 3 m")
    assert words(SENT, elsewhere) == f"{SEVEN}: sent"
    assert words(elsewhere, SENT) == f"{SEVEN}: sent"
    assert words((0, "no route", SEVEN)) == f"{SEVEN}: no route"


def test_other_drones_and_relays_that_have_no_route_say_nothing_of_an_order():
    assert watch(SENT).words(6, None) == ""
    assert words((3, "no route", "")) == ""


def test_a_drone_that_flies_on_to_its_old_place_is_not_said_to_stay():
    flies_on = NodeStatus(5, position=(9.0, 0.0, 0.0), path=(1.0, 2.0, 3.0))
    followed = watch(SENT, ACCEPTED, (0, "no route", EIGHT))
    assert followed.words(5, flies_on) == f"{EIGHT}: no route"
    assert followed.since(flies_on) == "flies to x 1.00 m, y 2.00 m, z 3 m"


def test_what_a_drone_did_after_its_arrival_is_told():
    followed = watch(SENT, ACCEPTED, ARRIVED)
    assert followed.since(NodeStatus(5, position=(1.0, 2.0, 3.0))) == ""
    followed.take([EventRecord(9.0, 5, "flight decided", (2,))])
    away = NodeStatus(5, position=(1.0, 190.0, 3.0))
    assert followed.since(away) == "flew to repair the mesh, is 188 m from there"
    followed.take([EventRecord(10.0, 0, "order sent", (5,), EIGHT)])
    assert followed.since(away) == ""


def progress(*events):
    """(seconds, gateway, kind, detail) of drone 5, whose order was given after 10 s."""
    progress = OrderProgress(5, HERE, since_s=10.0)
    for stamp_s, node, kind, detail in events:
        progress.take(EventRecord(stamp_s, node, kind, (5,), detail))
    return progress


def test_one_order_is_followed_to_its_end():
    sent = (11.0, *SENT)
    assert not progress().was_sent
    assert progress(sent).was_sent
    assert progress(sent, (12.0, *ACCEPTED)).state is OrderState.ACCEPTED
    arrived = progress(sent, (19.0, *ARRIVED))
    assert (arrived.is_over, arrived.in_words()) == (True, "arrived")
    refused = progress(sent, (12.0, 0, "order refused", f"{SEVEN}: battery at 9 %"))
    assert (refused.is_over, refused.in_words()) == (True, "refused: battery at 9 %")


def test_older_orders_and_those_to_other_places_are_not_this_one():
    assert not progress((9.0, *SENT)).was_sent
    assert not progress((11.0, 0, "order sent", EIGHT)).was_sent
    six = SEVEN.replace("order 7", "order 6")
    other = progress((11.0, *SENT), (12.0, 0, "order refused", f"{six}: crashed"))
    assert not other.is_over


def test_the_order_of_one_gateway_may_fail_while_that_of_another_is_open():
    three = SEVEN.replace("order 7", "order 3")
    first, second = (11.0, *SENT), (11.0, 1, "order sent", three)
    lost = (12.0, 0, "no route", SEVEN)
    assert not progress(first, second, lost).is_over
    given_up = (13.0, 1, "order given up", f"{three}: landed early")
    assert progress(first, second, lost, given_up).is_over
    arrived = progress(first, second, (19.0, 1, "order arrived", three))
    assert (arrived.is_over, arrived.state) == (True, OrderState.ARRIVED)
