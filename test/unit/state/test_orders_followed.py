"""The events of gateways say how far the latest order of a drone has come."""

from __future__ import annotations

from drone_mesh.communication.order_record import OrderState
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord
from drone_mesh.state.orders import OrderProgress, OrderWatch


def watch(*events):
    """(gateway, kind, detail) of drone 5."""
    watch = OrderWatch()
    watch.take(EventRecord(1.0, node, kind, (5,), detail) for node, kind, detail in events)
    return watch


SENT = (0, "order sent", "order 7: to x 1.00 m, y 2.00 m, z 3 m")


def test_an_order_is_followed_from_the_request_to_the_arrival():
    assert watch(SENT).words(5) == "asked: to x 1.00 m, y 2.00 m, z 3 m"
    assert watch(SENT, (0, "order accepted", "order 7")).words(5) == "under way"
    assert watch(SENT, (0, "order arrived", "order 7")).words(5) == "arrived"


def test_a_refusal_and_the_end_of_a_flight_elsewhere_keep_their_reason():
    refused = watch(SENT, (0, "order refused", "order 7: battery at 9 %: land"))
    assert refused.words(5) == "refused: battery at 9 %: land"
    assert watch(SENT, (0, "order given up", "order 7: lost")).words(5) == "given up: lost"


def test_the_end_of_an_older_order_does_not_hide_the_latest_one():
    followed = (0, "order sent", "order 8: to x 0.00 m, y 0.00 m, z 0 m")
    ended = (0, "order given up", "order 7: another order came")
    assert watch(SENT, followed, ended).words(5).startswith("asked")


def test_a_second_gateway_without_a_route_does_not_hide_the_first_ones_success():
    assert watch(SENT, (1, "no route", "order 3")).words(5).startswith("asked")
    assert watch((1, "no route", "order 3"), SENT).words(5).startswith("asked")
    assert watch((0, "no route", "order 7")).words(5) == "no route"


def test_other_drones_and_relays_that_have_no_route_say_nothing_of_an_order():
    assert watch(SENT).words(6) == ""
    assert watch((3, "no route", "")).words(5) == ""


HERE = Location(latitude=2.0, longitude=1.0, height=3.0)


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
    assert progress(sent, (12.0, 0, "order accepted", "order 7")).state is OrderState.UNDER_WAY
    arrived = progress(sent, (19.0, 0, "order arrived", "order 7"))
    assert (arrived.is_over, arrived.state, arrived.reason) == (True, OrderState.ARRIVED, "")
    refused = progress(sent, (12.0, 0, "order refused", "order 7: battery at 9 %"))
    assert (refused.is_over, refused.reason) == (True, "battery at 9 %")


def test_older_orders_and_those_to_other_places_are_not_this_one():
    assert not progress((9.0, *SENT)).was_sent
    assert not progress((11.0, 0, "order sent", "order 8: to x 0.00 m, y 0.00 m, z 0 m")).was_sent
    other = progress((11.0, *SENT), (12.0, 0, "order refused", "order 6: crashed"))
    assert not other.is_over


def test_the_order_of_one_gateway_may_fail_while_that_of_another_is_open():
    first, second = (11.0, *SENT), (11.0, 1, "order sent", "order 3: to x 1.00 m, y 2.00 m, z 3 m")
    lost = (12.0, 0, "no route", "order 7")
    assert not progress(first, second, lost).is_over
    assert progress(first, second, lost, (13.0, 1, "order given up", "order 3: no reply")).is_over
    arrived = progress(first, second, (19.0, 1, "order arrived", "order 3"))
    assert (arrived.is_over, arrived.state) == (True, OrderState.ARRIVED)
