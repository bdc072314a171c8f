"""Which nodes of a line may send at once: the bound of the data benchmark, against the emulator."""

from __future__ import annotations

import pytest
from chip_lab import Lab

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.inprocess.data_benchmark import SPACING_M, reuse_distance
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.settings import DATA_RATES, RadioSettings

LATER_S = [2.5e-4 * step for step in range(8)]  # the second pair starts so much after the first


def lost(settings, distance):
    """How many packets of two pairs are not acknowledged, at different distances in time."""
    lab = Lab(IdealDisc(MAX_DISTANCE_M))
    nodes = (0, 1, distance, distance + 1)
    driver = {
        node: lab.driver(node, SPACING_M * node, begin=True, settings=settings) for node in nodes
    }

    def send(sender, receiver, later_s, number):
        lab.clock.sleep(later_s)
        return driver[sender].try_once(receiver, bytes((number,)) * 32, False, 0, 5).acknowledged

    failed = 0
    for number, later_s in enumerate(LATER_S):
        for one_s, other_s in ((0.0, later_s), (later_s, 0.0)):
            results = lab.at_once(
                lambda wait_s=one_s, n=number: send(0, 1, wait_s, n),
                lambda wait_s=other_s, n=number: send(distance, distance + 1, wait_s, n),
            )
            failed += results.count(False)
            for receiver in (1, distance + 1):
                driver[receiver].receive(0.0)
    return failed


@pytest.mark.parametrize("rate", DATA_RATES)
def test_pairs_at_the_reuse_distance_do_not_disturb_each_other_and_nearer_ones_do(rate):
    settings = RadioSettings(data_rate=DATA_RATES[rate])
    distance = reuse_distance(settings)
    assert lost(settings, distance) == 0
    assert lost(settings, distance - 1) > 0


def test_the_slower_rate_needs_more_distance_since_it_captures_worse():
    distances = [reuse_distance(RadioSettings(data_rate=rate)) for rate in DATA_RATES.values()]
    assert distances == [5, 4, 4]
