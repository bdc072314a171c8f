"""What a ground station is told: only what is proved, with the time at which it was true."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from desk_rig import HERE, ORIGIN, drone, text_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.ground_station.cursor_on_target import event_of
from drone_mesh.ground_station.reports import Fleet
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus


def fleet(*vehicles, now_s=100.0, origin=ORIGIN, may_order=False):
    shown = Fleet(origin, 25.0, may_order)
    shown.show(vehicles, now_s)
    return shown


def told(shown, second=0):
    """By node and type, the messages of one second."""
    return {(node, m.get_type()): m for node, m in shown.every_second(second)}


def in_bytes(node, message):
    return message.pack(mavlink.MAVLink(None, node + 1, 1)).hex(" ")


def test_a_heartbeat_and_a_position_have_these_bytes():
    messages = told(fleet(drone(3, 98.5)))
    assert in_bytes(3, messages[3, "HEARTBEAT"]) == (
        "fd 09 00 00 00 04 01 00 00 00 00 00 00 00 02 00 00 03 03 10 26"
    )
    place = messages[3, "GLOBAL_POSITION_INT"]
    assert place.time_boot_ms == 98_500
    assert (place.alt, place.relative_alt, place.hdg) == (7000, 0, 65535)
    assert in_bytes(3, place)[:29] == "fd 1c 00 00 00 04 01 21 00 00"


def test_a_node_is_armed_in_flight_and_its_speed_is_the_mean_between_two_reports():
    shown = fleet(drone(3), may_order=True)
    moved = HERE._replace(latitude=16.0, height=10.0)
    shown.show([drone(3, 104.0, flying=True, place=moved)], 104.0)
    messages = told(shown)
    assert messages[3, "HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert messages[3, "EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    place = messages[3, "GLOBAL_POSITION_INT"]
    assert (place.vx, place.vy, place.vz, place.relative_alt) == (150, 0, -150, 6000)


def test_a_drone_that_hovers_is_in_the_air_though_no_flight_is_under_way():
    shown = fleet(drone(3, place=HERE._replace(height=0.4)))
    shown.show([drone(3, 101.0, place=HERE._replace(height=10.0))], 101.0)
    messages = told(shown)
    assert messages[3, "HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert messages[3, "HEARTBEAT"].system_status == mavlink.MAV_STATE_ACTIVE
    assert messages[3, "EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    shown.show([drone(3, 102.0, place=HERE._replace(height=0.8))], 102.0)
    landed = told(shown)[3, "EXTENDED_SYS_STATE"].landed_state
    assert landed == mavlink.MAV_LANDED_STATE_ON_GROUND


def test_signs_of_life_end_with_the_proof_of_it():
    shown = fleet(drone(3, 100.0), drone(4, -float("inf")), now_s=125.0)
    assert {node for node, _kind in told(shown)} == {3}
    shown.show([drone(3, 100.0)], 125.1)
    assert told(shown) == {}


def test_without_an_origin_places_are_those_of_the_common_frame():
    messages = told(fleet(drone(3), origin=None), second=2)
    place = messages[3, "LOCAL_POSITION_NED"]
    assert (place.x, place.y, place.z) == (HERE.latitude, HERE.longitude, -HERE.height)
    assert (3, "SYS_STATUS") in messages  # of that second
    assert (3, "HOME_POSITION") not in messages


def test_what_a_node_did_not_report_is_not_told():
    messages = told(fleet(drone(3, flying=None, place=None)), second=2)
    assert messages[3, "HEARTBEAT"].system_status == mavlink.MAV_STATE_UNINIT
    assert messages[3, "SYS_STATUS"].battery_remaining == -1
    assert not {"GLOBAL_POSITION_INT", "BATTERY_STATUS"} & {kind for _node, kind in messages}


def test_battery_and_readiness_are_told_now_and_then():
    shown = fleet(drone(3, battery_percent=77.4, why_not_fly="no 3D fix"))
    kinds = [{kind for _node, kind in told(shown, second)} for second in range(5)]
    assert [("BATTERY_STATUS" in k, "HOME_POSITION" in k) for k in kinds].count((True, True)) == 1
    status = told(shown, second=2)[3, "SYS_STATUS"]
    ready = status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert (status.battery_remaining, ready) == (77, 0)


@pytest.mark.parametrize("kind", MeshEventKind)
def test_each_event_has_words_or_is_left_out_on_purpose(kind):
    event = EventRecord(100.0, 3, kind.value, (0,), "because")
    words = "".join(text_of(m) for _node, m in fleet(drone(0), drone(3)).event(event))
    told_in_words = (f"{kind.value}: {whom} 0 (because)" for whom in ("gateway", "node"))
    assert words in ("", *told_in_words)


def test_a_lost_node_does_not_speak_its_gateway_does():
    lost = EventRecord(200.0, 3, "disconnected", (0,), "no route to it for 30 s")
    shown = fleet(drone(0, 200.0), drone(3, 100.0), now_s=200.0)
    parts = list(shown.event(lost))
    assert [node for node, _m in parts] == [0, 0]
    words = "".join(text_of(m) for _node, m in parts)
    assert words == "drone 3: disconnected: gateway 0 (no route to it for 30 s)"
    assert list(fleet(drone(3, 100.0), now_s=200.0).event(lost)) == []


def test_a_long_text_comes_in_numbered_parts():
    event = EventRecord(100.0, 3, "cannot fly", (), "x" * 100)
    parts = [(m.id, m.chunk_seq, len(m.text)) for _n, m in fleet(drone(3)).event(event)]
    assert parts == [(1, 0, 50), (1, 1, 50), (1, 2, 13)]


def test_a_simulated_node_without_a_gateway_stays_where_it_still_had_one():
    from drone_mesh.ground_station.vehicles import vehicles_of_state

    def state(at_s, connected, x):
        node = NodeStatus(3, connected=connected, position=(x, 0.0, 1.0))
        return MeshStatus(at_s, [node])

    before = vehicles_of_state(state(10.0, True, 5.0), ())
    (lost,) = vehicles_of_state(state(20.0, False, 9.0), before)
    assert (lost.heard_s, lost.place_s, lost.place.longitude) == (10.0, 10.0, 5.0)
    assert vehicles_of_state(MeshStatus(30.0, []), before) == []  # it was removed


def test_cursor_on_target_is_stale_when_the_next_report_is_due():
    event = event_of(drone(3, 98.0, battery_percent=80.0), ORIGIN, 100.0, 1_700_000_000.0, 30.0)
    assert b'uid="drone_mesh.3" type="a-f-A-M-H-Q"' in event
    assert b'start="2023-11-14T22:13:18.000Z" stale="2023-11-14T22:13:48.000Z"' in event
    assert b'callsign="drone 3"' in event
    assert b'<status battery="80" />' in event
    assert b"<remarks>at rest</remarks>" in event
    assert event_of(drone(3, place=None), ORIGIN, 100.0, 0.0, 30.0) == b""


def test_cursor_on_target_is_xml_whatever_a_node_says():
    hostile = drone(3, why_not_fly="no\x00 <fix>\x1b\ufffe")
    event = ElementTree.fromstring(event_of(hostile, ORIGIN, 100.0, 1_700_000_000.0, 30.0))
    assert event.findtext("detail/remarks") == "no? <fix>??"
