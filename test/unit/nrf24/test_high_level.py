"""NRF24HighLevelInterface: the antenna of the mesh on our driver."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import pytest
from chip_lab import Lab

from drone_mesh.communication.interfaces import IMeshNetwork
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface


class Mesh(IMeshNetwork):
    """Records what the antenna reports."""

    def __init__(self, node_id):
        self.node_id = node_id
        self.heard, self.power, self.delivered, self.undelivered = [], [], [], []

    def get_node_id(self):
        return self.node_id

    def on_msg(self, payload, now_s):
        self.heard.append(payload)

    def on_delivered(self, payload, tries, now_s):
        self.delivered.append((payload[3], tries))

    def on_undelivered(self, payload, tries, now_s):
        assert tries > 1
        self.undelivered.append(payload)

    def on_antenna_power(self, on, now_s):
        self.power.append(on)

    def on_antenna_registered(self, now_s):
        raise AssertionError("a radio is not registered anywhere")


class Node:
    """An antenna and its mesh; what is submitted runs at once."""

    def __init__(self, lab, node_id, x_m):
        self.mesh = Mesh(node_id)
        self.driver = lab.driver(node_id, x_m, begin=False)
        self.shown = []
        self.antenna = NRF24HighLevelInterface(
            self.driver,
            lambda work: work(lab.clock.now_s()),
            runtime=lab.clock,
            on_payload=self.shown.append,
        )


@pytest.fixture
def nodes(lab):
    nodes = [Node(lab, node_id, 10.0 * node_id) for node_id in range(3)]
    for node in nodes:
        node.antenna.start_antenna(node.mesh)
    yield nodes
    for node in nodes:
        node.antenna.stop_antenna()


def packet(to, *, sender=0, filling=0x55):
    return bytes((sender, sender, 3, to, to)) + bytes((filling,)) * 27


def test_a_packet_reaches_the_node_in_byte_3_and_no_other(lab, nodes):
    assert nodes[0].antenna.send_message_to(packet(2))
    lab.clock.sleep(0.1)
    assert [node.mesh.heard for node in nodes] == [[], [], [packet(2)]]
    assert nodes[2].shown == [packet(2)]
    assert nodes[0].mesh.delivered == [(2, 1)]


def test_a_broadcast_is_one_frame_and_each_receiver_finds_its_own_id_in_byte_3(lab, nodes):
    frames = len(lab.trace.frames)
    nodes[0].antenna.broadcast_message(packet(254))
    lab.clock.sleep(0.5)
    assert len(lab.trace.frames) == frames + 1
    expected = [bytes((0, 0, 3, node, 254)) + b"\x55" * 27 for node in (1, 2)]
    assert [node.mesh.heard for node in nodes] == [[], [expected[0]], [expected[1]]]


def test_a_packet_for_a_node_that_is_not_there_is_reported_as_undelivered(lab, nodes):
    assert nodes[0].antenna.send_message_to(packet(9))
    assert nodes[0].mesh.undelivered == []
    lab.clock.sleep(12.0)
    assert nodes[0].mesh.undelivered == [packet(9)]


@pytest.mark.parametrize(("lost", "frames"), [(0, 1), (1, 2), (2, 3), (5, 6)])
def test_the_quality_of_a_link_counts_the_frames_that_the_chip_repeats_by_itself(
    lab, nodes, lost, frames
):
    left = iter([True] * lost)
    lab.loses = lambda hop: hop.packet is not None and next(left, False)
    nodes[0].antenna.send_message_to(packet(1))
    lab.clock.sleep(5.0)
    assert nodes[0].antenna.link_quality() == {1: (frames, 1.0)}
    assert nodes[0].mesh.delivered == [(1, frames)]


def test_the_quality_of_a_link_counts_the_frames_of_a_packet_that_is_given_up(lab, nodes):
    nodes[0].antenna.send_message_to(packet(9))
    lab.clock.sleep(12.0)
    assert nodes[0].antenna.link_quality() == {9: (18.0, 0.0)}


def test_a_node_that_is_not_there_does_not_delay_packets_for_others(lab, nodes):
    nodes[0].antenna.send_message_to(packet(9))
    lab.clock.sleep(0.1)  # the tries for node 9 go on for seconds
    began_s = lab.clock.now_s()
    for number in range(10):
        nodes[0].antenna.send_message_to(packet(1, filling=number))
    lab.clock.sleep(0.2)
    assert [payload[5] for payload in nodes[1].mesh.heard] == list(range(10))
    assert nodes[0].mesh.undelivered == []
    assert lab.clock.now_s() - began_s < 0.3


@pytest.mark.parametrize("bad", [packet(254), packet(255), packet(0), bytes(31), bytes(33)])
def test_what_cannot_be_sent_is_not_sent(lab, nodes, bad):
    frames = len(lab.trace.frames)
    assert not nodes[0].antenna.send_message_to(bad)
    assert len(lab.trace.frames) == frames


def test_an_antenna_that_fell_silent_sends_nothing_and_reports_it_at_once(lab, nodes):
    nodes[0].antenna.fall_silent()
    began_ns = lab.clock.now_ns
    assert not nodes[0].antenna.send_message_to(packet(1))
    nodes[0].antenna.broadcast_message(packet(254))
    assert lab.clock.now_ns == began_ns
    lab.clock.sleep(0.1)
    assert nodes[1].mesh.heard == nodes[2].mesh.heard == []


def test_an_antenna_that_falls_silent_drops_what_waits(lab, nodes):
    frames = len(lab.trace.frames)
    for number in range(10):
        nodes[0].antenna.send_message_to(packet(9, filling=number))
    nodes[0].antenna.fall_silent()
    lab.clock.sleep(1.0)
    assert len(lab.trace.frames) <= frames + 2  # the try that was under way
    assert nodes[0].mesh.undelivered == []


def test_an_antenna_that_is_off_neither_sends_nor_hears_and_reports_it_to_the_mesh(lab, nodes):
    off = nodes[1].antenna
    off.switch_power(False)
    assert not off.on()
    assert not off.send_message_to(packet(2, sender=1))
    nodes[0].antenna.send_message_to(packet(1))
    lab.clock.sleep(12.0)
    assert nodes[0].mesh.undelivered == [packet(1)]
    assert nodes[1].mesh.heard == []
    off.switch_power(True)
    assert off.on()
    assert nodes[0].antenna.send_message_to(packet(1))
    lab.clock.sleep(0.1)
    assert nodes[1].mesh.heard == [packet(1)]
    assert nodes[1].mesh.power == [False, True]


def test_what_arrives_after_the_antenna_was_stopped_is_not_handed_on(lab, nodes):
    nodes[1].antenna.stop_antenna()
    nodes[1].antenna.stop_antenna()
    assert not nodes[1].antenna.on()
    nodes[0].antenna.send_message_to(packet(1))
    lab.clock.sleep(1.0)
    assert nodes[1].mesh.heard == []


def test_statistics_count_what_was_sent_lost_and_seen_twice(lab, nodes):
    for to in (1, 1, 9):
        nodes[0].antenna.send_message_to(packet(to))
        lab.clock.sleep(0.2)
    nodes[0].antenna.broadcast_message(packet(254))
    lab.clock.sleep(12.0)
    sent = nodes[0].antenna.statistics()
    assert (sent.sent, sent.acknowledged, sent.lost, sent.broadcasts) == (3, 2, 1, 1)
    assert sent.tries == 8
    heard = nodes[1].antenna.statistics()
    assert (heard.received, heard.duplicates) == (3, 1)


INFO = SimpleNamespace(  # a router that is three hops away from gateway 0
    get_node_id=lambda: 1,
    get_connected_to_gateway=lambda: True,
    get_total_message_sent=lambda: 17,
    get_preferred_gateway=lambda: 0,
    get_hops_from_gateway_away=lambda: 3,
    get_last_good_known_location_id=lambda: 255,
    get_router_tech_table_size=lambda: 42,
)


def test_debugging_mode_logs_a_line_per_period_until_it_is_switched_off(lab, nodes, caplog):
    antenna = nodes[1].antenna
    antenna.send_message_to(packet(2, sender=1))
    with caplog.at_level(logging.INFO):
        antenna.debugging_mode(INFO, True)
        lab.clock.sleep(21.0)
        antenna.debugging_mode(INFO, False)
        lab.clock.sleep(60.0)
        antenna.debugging_mode(INFO, True)  # what was left out does not follow
        lab.clock.sleep(10.0)
    lines = [record.getMessage() for record in caplog.records]
    assert (
        lines
        == [
            "node 1: on, connected, gateway 0, 3 hops, 42 nodes known, 17 messages sent, steps "
            "back to none; airtime 0.0 %, 1.00 tries per packet, 0 waiting, 0 given up"
        ]
        * 3
    )


@pytest.mark.parametrize(
    ("connected", "gateway", "hops", "words"),
    [(True, 0, 1, "connected, gateway 0, 1 hop"), (False, 255, 255, "not connected")],
)
def test_the_line_of_a_node_names_its_gateway_only_if_it_has_one(
    lab, nodes, caplog, connected, gateway, hops, words
):
    info = SimpleNamespace(
        **{
            **vars(INFO),
            "get_connected_to_gateway": lambda: connected,
            "get_preferred_gateway": lambda: gateway,
            "get_hops_from_gateway_away": lambda: hops,
        }
    )
    with caplog.at_level(logging.INFO):
        nodes[1].antenna.debugging_mode(info, True)
        lab.clock.sleep(11.0)
    (line,) = (record.getMessage() for record in caplog.records)
    assert line.startswith(f"node 1: on, {words}, 42 nodes known, ")


def test_the_use_of_the_channel_is_measured(lab, nodes):
    antenna = nodes[0].antenna
    antenna.channel_use()
    for number in range(100):
        antenna.send_message_to(packet(1, filling=number))
    lab.clock.sleep(2.0)
    use = antenna.channel_use()
    assert use.airtime == pytest.approx(100 * 0.001316 / 2.0, rel=0.2)  # 1.3 ms per frame
    assert (use.waiting, use.given_up) == (0, 0)
    assert 1.0 <= use.tries < 1.2
    antenna.send_message_to(packet(9))
    assert antenna.channel_use().waiting == 1


def test_a_radio_that_is_missing_stops_the_start_with_a_reason():
    lab = Lab()
    node = Node(lab, 1, 0.0)
    node.driver.chip.faults.miso_stuck_at = 0xFF
    with pytest.raises(RadioError, match="no nRF24L01"):
        node.antenna.start_antenna(node.mesh)
    assert not node.antenna.on()


def test_a_radio_for_another_node_is_refused():
    node = Node(Lab(), 1, 0.0)
    with pytest.raises(ConfigurationError, match="node 1, but the mesh component is node 2"):
        node.antenna.start_antenna(Mesh(2))
