"""CONTRIBUTING.md, "Add a radio": a radio of another kind under the same mesh software.

It needs forty times as long for a packet as the radio that the times of the mesh were chosen for.
"""

from __future__ import annotations

import pytest
from slow_radio import HOP_S, SlowAir

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.timing import QUEUED, UNDISTURBED, Medium, MeshTiming
from drone_mesh.inprocess import Network
from drone_mesh.nrf24.settings import DataRate, RadioSettings

TIMING = MeshTiming(check_period_s=60.0, connection_lost_after_s=180.0)


def slow_network(seed, routers, columns):
    network = Network(seed, TIMING, radio=SlowAir())
    network.add_fleet(gateways=1, routers=routers, gridsize=columns, spacing=6.0)
    return network


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_twelve_nodes_with_100_ms_per_packet_connect_and_carry_orders(seed):
    network = slow_network(seed, routers=11, columns=4)
    network.run_for(1.0)
    assert network.run_until(network.all_connected, within_s=600.0)
    share = 0
    for _ in range(60):
        network.run_for(10.0)
        share += sum(map(network.connected, range(1, 12))) / (60 * 11)
    assert share >= 0.95
    for drone in (3, 7, 11, 5):
        place = network.location(drone)
        assert network.order(drone, place.longitude + 1.0, place.latitude + 1.0)
        assert network.run_until(lambda d=drone: network.nodes[d].drone.path is not None, 120.0)
        network.run_for(60.0)
    decided = [e for e in network.events if e.kind is MeshEventKind.FLIGHT_DECIDED]
    assert decided == []


@pytest.mark.parametrize(("seed", "last_connects_in_flight"), [(2, False), (3, True)])
def test_behind_a_dead_relay_one_drone_flies_at_a_time_at_the_pace_of_the_slow_radio(
    seed, last_connects_in_flight
):
    network = slow_network(seed, routers=5, columns=1)  # a line
    network.run_for(1.0)
    assert network.run_until(network.all_connected, within_s=900.0)
    network.run_for(300.0)
    died_s = network.now_s()
    network.power(2, False)
    assert network.run_until(lambda: not network.all_connected(), within_s=1200.0)
    assert network.run_until(network.all_connected, within_s=2400.0)
    flights = [
        (event.node, event.kind)
        for event in network.events
        if event.kind in (MeshEventKind.FLIGHT_DECIDED, MeshEventKind.LANDED)
    ]
    each = (MeshEventKind.FLIGHT_DECIDED, MeshEventKind.LANDED)
    up_by_one = [(node, kind) for node in (3, 4, 5) for kind in each]
    assert flights == up_by_one[: -1 if last_connects_in_flight else None]
    first = next(event for event in network.events if event.kind is each[0])
    assert first.now_s - died_s > TIMING.connection_lost_after_s


@pytest.mark.parametrize(
    ("rate", "hop_s"),
    [(DataRate.KBPS_250, 2.6e-3), (DataRate.MBPS_1, 1.1e-3), (DataRate.MBPS_2, 0.9e-3)],
)
def test_on_an_nrf24_no_time_of_the_mesh_is_stretched(rate, hop_s):
    medium = RadioSettings(data_rate=rate).medium
    assert medium == Medium(
        hop_s,
        QUEUED,
        answer_s=1.0,
        answer_per_hop_s=100 * hop_s,
        heartbeats=3,
        answer_spread_s=200 * hop_s,
        search_s=800 * hop_s,
        missing_quiet_s=5.0,
        silence_s=3.0,
        heard_periods=1.05,
        place_periods=2.5,
        data_pause_s=4 * hop_s,
        takes_off_after_s=0.3,
        takes_off_within_s=2.0,
        report_frame_s=2.0,
    )
    assert medium.stretched(0.3) == UNDISTURBED.stretched(0.3) == 0.3


def test_times_grow_with_the_hop_of_a_slower_radio():
    medium = Medium.for_hop(HOP_S)
    assert medium.stretched(0.5) == pytest.approx(0.5 * 0.1 / 0.0026)
    assert medium.answer_s == pytest.approx(1.0 * 0.1 / 0.0026)
    assert medium.answer_per_hop_s == pytest.approx(10.0)
    assert medium.takes_off_after_s == pytest.approx(0.3 * 0.1 / 0.0026)
    assert medium.takes_off_within_s == pytest.approx(2.0 * 0.1 / 0.0026)
