"""What lies between antennas and what else sends there, as both airs see it."""

from __future__ import annotations

import math
import random
from statistics import mean

import pytest
from chip_lab import Lab

from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.emulator.air import RPD_DBM
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.space import Fading, Noise
from drone_mesh.nrf24.settings import RadioSettings

HERE, THERE = (0.0, 0.0, 0.0), (6.0, 0.0, 0.0)
MHZ = 2400 + RadioSettings().channel
SECOND_NS = 1_000_000_000
PAYLOAD = bytes(range(32))


def gains(fading, count, every_ns=10 * SECOND_NS):
    return [fading.gain_db((1, 2), (HERE, THERE), 2400, n * every_ns) for n in range(count)]


def power(gain_db):
    return 10.0 ** (gain_db / 10.0)


def test_rayleigh_power_is_exponential_about_its_mean():
    powers = [power(gain) for gain in gains(Fading("rayleigh", random.Random(1)), 20_000)]
    assert mean(powers) == pytest.approx(1.0, rel=0.03)
    for below in (0.01, 0.1, 1.0):
        share = sum(p < below for p in powers) / len(powers)
        expected = 1.0 - math.exp(-below)
        four_sigma = 4.0 * math.sqrt(expected * (1.0 - expected) / len(powers))
        assert share == pytest.approx(expected, abs=four_sigma)


@pytest.mark.parametrize("k_db", [3.0, 10.0])
def test_rician_power_has_the_mean_and_the_variance_of_its_k(k_db):
    powers = [power(g) for g in gains(Fading("rician", random.Random(1), k_db=k_db), 20_000)]
    k = power(k_db)
    variance = mean((p - 1.0) ** 2 for p in powers)
    assert mean(powers) == pytest.approx(1.0, rel=0.02)
    assert variance == pytest.approx((1 + 2 * k) / (1 + k) ** 2, rel=0.06)


def test_a_gain_lasts_for_the_coherence_time_and_both_directions_share_it():
    fading = Fading("rayleigh", random.Random(2), stirring_m_s=1.0)
    # 0.423 / (1 m/s * 2400 MHz / c) = 52.8 ms
    before = fading.gain_db((1, 2), (HERE, THERE), 2400, 0)
    assert fading.gain_db((2, 1), (THERE, HERE), 2400, 52_000_000) == before
    assert fading.gain_db((1, 3), (HERE, THERE), 2400, 52_000_000) != before
    after = fading.gain_db((2, 1), (THERE, HERE), 2400, 53_500_000)
    assert after != before
    assert fading.gain_db((1, 2), (HERE, THERE), 2400, 60_000_000) == after


def test_the_coherence_time_follows_from_the_speeds_of_both_ends():
    fading = Fading("rayleigh", random.Random(2), stirring_m_s=0.0)
    fading.gain_db((1, 3), (HERE, THERE), 2400, 0)
    fading.gain_db((2, 4), (HERE, THERE), 2400, 0)
    fading.gain_db((1, 5), ((0.1, 0.0, 0.0), THERE), 2400, SECOND_NS // 5)
    fading.gain_db((2, 5), ((0.1, 0.0, 0.0), THERE), 2400, SECOND_NS // 5)
    gain = fading.gain_db((1, 2), ((0.1, 0.0, 0.0),) * 2, 2400, SECOND_NS // 5)
    same = [
        fading.gain_db((1, 2), (HERE, THERE), 2400, SECOND_NS // 5 + ms * 1_000_000) == gain
        for ms in (50, 56)
    ]
    assert same == [True, False]  # 0.5 m/s + 0.5 m/s: 52.8 ms


def test_an_unknown_fading_and_a_senseless_noise_are_refused():
    with pytest.raises(ConfigurationError, match="invalid fading 'rice': use rayleigh or rician"):
        Fading("rice", random.Random(1))
    for duty in (0.0, 1.5, math.nan):
        with pytest.raises(ConfigurationError, match="duty"):
            Noise(HERE, 0.0, random.Random(1), centre_mhz=2476, duty=duty)


def test_bursts_take_their_share_of_the_time_and_are_asked_in_any_small_spans():
    noise = Noise(HERE, 0.0, random.Random(3), centre_mhz=2476, duty=0.3, burst_s=1.5e-3)
    looks = range(0, 60 * SECOND_NS, 1_000_003)
    busy = sum(noise.sends(at_ns, at_ns + 1) for at_ns in looks)
    assert busy / len(looks) == pytest.approx(0.3, abs=0.02)


def test_a_noise_has_its_power_in_its_own_band_only():
    wifi = Noise(HERE, 20.0, random.Random(3), centre_mhz=2437, width_mhz=20.0)
    assert wifi.power_dbm(2437, 1.0) == pytest.approx(20.0 - 10.0 * math.log10(20.0))
    assert wifi.power_dbm(2437, 2.0) == pytest.approx(20.0 - 10.0)
    assert wifi.power_dbm(2448, 1.0) == -math.inf


def test_a_noise_ends_when_it_is_stopped():
    noise = Noise(HERE, 0.0, random.Random(3), centre_mhz=2476, from_s=1.0, until_s=5.0)
    spans = [(0, 1), (2 * SECOND_NS, 2 * SECOND_NS + 1), (6 * SECOND_NS, 6 * SECOND_NS + 1)]
    assert [noise.sends(*span) for span in spans] == [False, True, False]
    noise.stop(2 * SECOND_NS)
    assert not noise.sends(3 * SECOND_NS, 3 * SECOND_NS + 1)


# On the chips ----------------------------------------------------------------------------------


def lab_with_power():
    return Lab(LogDistance(random.Random(1)))


def jam(lab, place, power_dbm, **how):
    noise = Noise(place, power_dbm, random.Random(1), centre_mhz=MHZ, **how)
    lab.air.space.noises.append(noise)
    return noise


def test_a_jammer_as_strong_as_the_sender_destroys_what_it_sends_and_a_weak_one_does_not():
    lab = lab_with_power()
    sender, receiver = lab.driver(5), lab.driver(10, 20.0)
    assert sender.send(10, PAYLOAD)
    noise = jam(lab, (40.0, 0.0, 0.0), 0.0)
    assert not sender.send(10, PAYLOAD)
    assert lab.air.collisions > 0
    noise.stop(lab.clock.now_ns)
    assert sender.send(10, PAYLOAD)
    jam(lab, (40.0, 0.0, 0.0), -30.0)
    assert sender.send(10, PAYLOAD)
    assert [received.payload for received in receiver.receive(0.1)][:1] == [PAYLOAD]


def test_rpd_shows_a_jammer_nearby_and_none_far_away():
    lab = lab_with_power()
    near, far = lab.driver(5), lab.driver(6, 200.0)
    jam(lab, (4.0, 0.0, 0.0), 0.0)
    lab.wait_us(1000)
    assert near.chip.rpd()
    assert not far.chip.rpd()
    assert lab.air.space.noise_dbm(HERE, MHZ, 250_000, (0, 1)) > RPD_DBM


def test_obstacles_block_the_chips():
    lab = lab_with_power()
    lab.air.space.obstacles = lambda a, b: math.inf if a[0] * b[0] < 0 else 0.0
    one, other, beyond = lab.driver(5, -5.0), lab.driver(10, -9.0), lab.driver(7, 5.0)
    assert one.send(10, PAYLOAD)
    assert not one.send(7, PAYLOAD)
    assert beyond.receive(0.0) == []
    assert len(other.receive(0.0)) == 1


def test_with_rayleigh_fading_packets_at_the_edge_are_lost_in_blocks():
    lab = lab_with_power()
    lab.air.space.fading = Fading("rayleigh", random.Random(4))
    sender, receiver = lab.driver(5), lab.driver(10, 60.0)
    results = []
    for _ in range(400):
        results.append(sender.try_once(10, PAYLOAD, False, 0, 1).acknowledged)
        sender.drop()
        lab.clock.sleep(0.02)
        receiver.receive(0.0)
    assert 0.02 < results.count(False) / 400 < 0.6
    again = sum(a == b is False for a, b in zip(results, results[1:]))
    # One loss is followed by another one far more often than losses are frequent.
    assert again / results.count(False) > 2 * results.count(False) / 400
