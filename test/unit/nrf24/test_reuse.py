"""Which nodes of a line may send at once: the bound for users' data, against the emulator."""

from __future__ import annotations

import pytest
from chip_lab import Lab

from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.nrf24.emulator.air import CAPTURE_DB
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.settings import DATA_RATES, RadioSettings

SPACING_M = 6.0
LATER_S = [2.5e-4 * step for step in range(8)]  # the second pair starts so much after the first


def reuse_distance(settings):
    """The least hops between two senders in the line that can send at once, each to its next node.

    A packet and its acknowledgement count as a whole: every frame of one pair has to arrive during
    every frame of the other, by the emulator's own rule of capture. Between the sender of one pair
    and the receiver of the other there is one hop less than between the senders.
    """
    capture_db = CAPTURE_DB[settings.data_rate.value]

    def power_dbm(one, other):
        distance_m = SPACING_M * abs(one - other)
        return IdealDisc(RANGE_M).received_dbm(distance_m, settings.power.value, 2400)

    def undisturbed(pair, others):
        return all(
            power_dbm(other, receiver) <= power_dbm(sender, receiver) - capture_db
            for sender, receiver in (pair, pair[::-1])
            for other in others
        )

    distance = 2  # a node cannot send and receive at once
    while not (
        undisturbed((0, 1), (distance, distance + 1))
        and undisturbed((distance, distance + 1), (0, 1))
    ):
        distance += 1
    return distance


def lost(settings, distance):
    """How many packets of two pairs are not acknowledged, at different distances in time."""
    lab = Lab(IdealDisc(RANGE_M))
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
