"""Compact reports: a node describes its state, and its gateway keeps the latest report."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.reports import NodeReport
from drone_mesh.communication.timing import Medium, MeshTiming
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError

REPORTING = MeshTiming(check_period_s=1000.0, report_period_s=30.0)


@pytest.fixture
def rig():
    """Router 1, connected to gateway 0; its first report is due after half a period."""
    rig = Rig(timing=REPORTING)
    rig.engine.place = Location(1.0, -2.5, 3.0)
    rig.connect_to_gateway()
    return rig


def gateway(*texts):
    rig = Rig(node_id=0, gateway=True)
    rig.hear(*texts)
    return rig


def test_a_report_has_these_bytes(rig):
    rig.wait(15.0)
    assert rig.sent(66) == [packet("01 01 42 00 00 01 01 00 05 00 f4 ff 0f 00 ff 02 00")]


def test_a_node_reports_once_in_a_period(rig):
    rig.wait(100.0)
    assert len(rig.sent(66)) == 3


def test_in_flight_it_reports_every_second_and_once_after_its_landing(rig):
    rig.wait(16.0)
    rig.sent(66)
    rig.mesh._pilot.goal = Location(9.0, 9.0, 9.0)
    rig.wait(4.5)
    assert 4 <= len(rig.sent(66)) <= 5
    rig.mesh._pilot.goal = None
    rig.wait(8.0)
    assert len(rig.sent(66)) == 1


@pytest.mark.parametrize(("hops", "reports"), [(1, 30), (2, 15), (4, 4), (6, 2)])
def test_on_a_shared_channel_drones_that_are_further_away_report_less(hops, reports, monkeypatch):
    rig = Rig(timing=REPORTING, medium=Medium.for_hop(0.002))
    rig.connect_to_gateway()
    monkeypatch.setattr(type(rig.mesh.control), "hops", hops)
    rig.wait(16.0)
    rig.sent(66)
    rig.mesh._pilot.goal = Location(9.0, 9.0, 9.0)
    rig.wait(60.0)
    assert len(rig.sent(66)) == pytest.approx(reports, abs=2)


def test_without_a_period_nothing_is_reported():
    rig = Rig()
    rig.connect_to_gateway()
    rig.wait(100.0)
    assert rig.tried(66) == []


def test_a_node_without_a_gateway_reports_nothing():
    rig = Rig(timing=REPORTING)
    rig.know_neighbour(2)
    rig.wait(100.0)
    assert rig.tried(66) == []


def test_why_it_cannot_fly_follows_in_words_when_it_changes_and_now_and_then(rig):
    rig.engine.grounded = "no 3D fix of the satellites"
    rig.wait(16.0)
    words = rig.sent(67)
    assert [p[5] for p in words] == [0x20, 0x21, 0x22]
    assert b"".join(p[6:19] for p in words).rstrip(b"\0") == b"no 3D fix of the satellites"
    rig.wait(30.0)
    assert rig.sent(67) == []  # unchanged
    rig.wait(300.0)
    assert len(rig.sent(67)) == 3  # a gateway may be new
    rig.engine.grounded = ""
    rig.wait(30.0)
    assert rig.sent(67) == [packet("01 01 43 00 00")]


def test_in_flight_unchanged_words_are_repeated_no_more_often(rig):
    rig.engine.grounded = "battery low"
    rig.wait(16.0)
    rig.sent(67)
    rig.mesh._pilot.goal = Location(9.0, 9.0, 9.0)
    rig.wait(25.0)
    assert rig.sent(67) == []


def test_a_drone_without_a_place_says_so_and_logs_nothing(rig, caplog):
    rig.engine.place = None
    rig.wait(16.0)
    (report,) = rig.sent(66)
    assert NodeReport.from_payload(report).place is None
    assert "own location unknown" not in caplog.text


def test_places_beyond_the_bounds_do_not_overflow(rig):
    rig.engine.place = Location(1e9, -1e9, 5000.0)
    rig.wait(16.0)
    (report,) = rig.sent(66)
    assert NodeReport.from_payload(report).place == (6553.4, -6553.4, 5000.0)


def test_a_gateway_keeps_the_latest_report_and_words_of_each_node():
    rig = gateway(
        "05 02 42 00 00 03 02 02 05 00 f4 ff 0f 00 50 01 0f",
        "06 02 42 00 00 01 03 05 00 80 00 80 00 80 ff 00 00",
        "06 02 43 00 00 11" + b"ery".hex(),
        "06 02 43 00 00 10" + b"an empty batt".hex(),
    )
    five, six = rig.mesh.get_node_reports()
    assert (five.node_id, six.node_id) == (5, 6)
    assert five.report == NodeReport(3, 2, 2, Location(1.0, -2.4, 3.0), 80, True, False, 1.5)
    assert six.report.place is None
    assert six.report.battery_percent is None
    assert six.why_not_fly == "an empty battery"


def test_a_node_that_can_fly_again_has_no_reason_left():
    rig = gateway(
        "06 02 43 00 00 00" + b"grounded".hex(),
        "06 02 42 00 00 01 03 05 00 80 00 80 00 80 ff 02 00",
    )
    assert rig.mesh.get_node_reports()[0].why_not_fly == ""


def test_a_router_drops_a_report_that_is_addressed_to_it(rig):
    rig.hear("05 05 42 01 01 03")
    assert any("does not process" in reason for reason in rig.mesh.complaints.counts)


@pytest.mark.parametrize("period_s", [-1.0, 1.0, 29.9, float("nan")])
def test_a_period_below_30_s_is_refused(period_s):
    with pytest.raises(ConfigurationError, match="report_period"):
        MeshTiming(report_period_s=period_s)
