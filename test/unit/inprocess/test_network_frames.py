"""Nodes that count their metres from different origins."""

from __future__ import annotations

import logging

import pytest
from scenarios import line

from drone_mesh.communication.control.places import CommonFrame
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.wire.messages import IntroduceMessage, frame_digest, with_frame_digest
from drone_mesh.inprocess.drone import InProcessDrone

ONE, OTHER = 0x1234, 0x4321


@pytest.fixture
def two_frames(monkeypatch):
    """Nodes beyond 10 m count from another origin."""
    monkeypatch.setattr(
        InProcessDrone,
        "frame_digest",
        lambda self: OTHER if self.get_location().longitude > 10.0 else ONE,
    )


def test_the_digest_stands_in_the_last_two_bytes_of_a_present():
    present = IntroduceMessage(7, 7, 254, 254, 3, True).to_payload()
    assert with_frame_digest(present, ONE).hex() == "070703fefe0301" + "00" * 23 + "3412"
    assert frame_digest(with_frame_digest(present, ONE)) == ONE
    assert frame_digest(present) == 0


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_places_never_cross_the_border_between_two_frames(two_frames, caplog, routing):
    caplog.set_level(logging.WARNING)
    network = line(
        3, spacing=6.0, routing=routing
    )  # 0 and 1 count from one origin, 2 and 3 from the other
    network.run_for(120.0)
    assert network.all_connected()  # packets without places pass
    places = {n: node.component.places for n, node in network.nodes.items()}
    assert places[1].gateway is not None
    assert places[2].gateway is None
    assert places[3].gateway is None
    assert network.order(3, 1.0, 1.0)  # there is a route; the order is dropped on it
    network.run_for(10.0)
    assert all(node.drone.path is None for node in network.nodes.values())
    assert "a neighbour has another origin: node 2" in caplog.text
    network.power(1, False)
    network.run_for(300.0)
    assert network.nodes[2].drone.get_location().longitude == 12.0
    assert network.nodes[3].drone.get_location().longitude == pytest.approx(18.0, abs=6.1)


def test_an_order_across_the_border_is_refused_and_the_gateway_is_told_why(two_frames):
    network = line(2, spacing=6.0)
    network.run_for(60.0)
    assert network.order(2, 1.0, 1.0)
    network.run_for(5.0)
    (order,) = network.nodes[0].component.get_orders()
    assert order.state is OrderState.REFUSED
    assert order.reason == "node 1, which passed the order on, has another --origin"
    assert network.nodes[2].drone.path is None


def test_an_order_that_comes_before_the_introduction_is_repeated_and_flown(monkeypatch):
    monkeypatch.setattr(InProcessDrone, "frame_digest", lambda self: ONE)
    network = line(1, spacing=6.0)
    network.run_for(60.0)
    frame = network.nodes[1].component._frame
    frame._digests.clear()  # the PRESENT of the gateway was lost
    assert network.order(1, 1.0, 1.0)
    network.run_for(1.0)
    assert network.nodes[1].drone.path is None
    frame.heard(0, ONE)
    network.run_for(30.0)
    (order,) = network.nodes[0].component.get_orders()
    assert order.state is OrderState.ARRIVED


def test_the_gateway_learns_which_relay_dropped_an_order_because_of_another_origin(two_frames):
    network = line(3, spacing=6.0)
    network.run_for(60.0)
    assert network.order(3, 1.0, 1.0)  # node 2 takes no places from node 1
    network.run_for(40.0)
    (order,) = network.nodes[0].component.get_orders()
    assert order.state is OrderState.LOST_CONTACT
    assert order.reason.endswith("node 2 dropped the order: node 1 has another --origin")


def test_a_mesh_with_one_origin_is_repaired_as_usual(monkeypatch):
    monkeypatch.setattr(InProcessDrone, "frame_digest", lambda self: ONE)
    network = line(2, spacing=8.0)
    network.run_for(40.0)
    network.power(1, False)
    assert network.run_until(lambda: network.connected(2), within_s=150.0)


@pytest.mark.parametrize(
    ("own", "heard", "refused"),
    [
        (0, None, False),
        (0, 0, False),
        (0, ONE, True),
        (ONE, None, True),
        (ONE, 0, True),
        (ONE, OTHER, True),
        (ONE, ONE, False),
    ],
)
def test_a_place_is_taken_only_from_a_neighbour_with_the_same_origin(own, heard, refused):
    frame = CommonFrame(own)
    if heard is not None:
        frame.heard(2, heard)
    assert frame.refuses(2) is refused
