"""How frames get lost: by distance, by script, and as was measured in 2019."""

from __future__ import annotations

import random

import pytest
from chip_lab import Lab

from drone_mesh.nrf24.emulator.links import (
    Hop,
    IdealDisc,
    LogDistance,
    bit_error_rate,
    free_space_dbm,
    measured_losses,
)

# share of 1000 packets that were lost, mean of 9 runs, worked out from the file with awk
MEASURED = {
    50: 0.0037, 100: 0.0049, 150: 0.0054, 200: 0.0051, 250: 0.0052, 300: 0.0050, 350: 0.0080,
    400: 0.0128, 450: 0.0160, 500: 0.0286, 550: 0.0639, 600: 0.0959,
}  # fmt: skip


@pytest.mark.parametrize(
    ("margin_db", "lost"), [(-1, 0.68), (0, 0.27), (1, 0.062), (2, 0.0084), (3, 0.0007)]
)
def test_a_frame_of_321_bits_is_lost_as_often_as_the_sensitivity_says(margin_db, lost):
    assert 1 - (1 - bit_error_rate(margin_db)) ** 321 == pytest.approx(lost, rel=0.06)


def test_one_metre_of_free_space_costs_40_db():
    assert free_space_dbm(1.0, 0.0, 2401) == pytest.approx(-40.06, abs=0.01)


def test_antennas_at_one_point_do_not_break_the_formula():
    assert free_space_dbm(0.0, 0.0, 2401) < 0.0
    assert LogDistance(random.Random(1)).received_dbm(0.0, 0.0, 2401) < 0.0


def test_the_ideal_range_in_free_space_is_that_of_the_data_sheet():
    model = LogDistance(random.Random(1), exponent=2.0)
    assert model.received_dbm(498.0, 0.0, 2401) == pytest.approx(-94.0, abs=0.1)
    assert model.received_dbm(177.0, 0.0, 2401) == pytest.approx(-85.0, abs=0.1)


def losses(model, distance_m, frames=2000):
    power_dbm = model.received_dbm(distance_m, 0.0, 2401)
    hop = Hop("one", "other", distance_m, power_dbm, 250_000, 329, None)
    return sum(model.bit_errors(hop) != 0 for _ in range(frames)) / frames


def test_log_distance_has_its_edge_at_the_given_range():
    model = LogDistance.with_edge_at(9.0, random.Random(1))
    assert losses(model, 6.0) == 0.0
    assert losses(model, 9.0) == pytest.approx(0.28, abs=0.04)
    assert losses(model, 11.0) > 0.9


def test_damaged_frames_are_thrown_away_by_the_receivers_crc():
    lab = Lab(LogDistance.with_edge_at(100.0, random.Random(1)))
    ptx = lab.wires("ptx").become_ptx(retries=0x50)
    prx = lab.wires("prx", 104.0).become_prx()
    flags = []
    got = []
    for number in range(200):
        flags.append(ptx.send(bytes((number,)) * 32))
        ptx.command(0xE1)
        got += [payload[0] for _pipe, payload in prx.unload_all()]
    confirmed = [number for number, flag in enumerate(flags) if flag == 0x20]
    assert 20 < len(confirmed) < 180
    assert set(confirmed) <= set(got)
    assert all(payload in range(200) for payload in got)
    assert got == sorted(set(got))


def test_the_measured_file_has_these_losses():
    assert {round(m): round(loss, 4) for m, loss in measured_losses()} == MEASURED


def test_the_disc_ends_at_its_range():
    hop = Hop("one", "other", 9.0, -60.0, 250_000, 329, None)
    assert IdealDisc(9.0).bit_errors(hop) is None
    assert IdealDisc(9.1).bit_errors(hop) == 0
