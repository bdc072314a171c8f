"""Several radios on one air (docs/radio.md, "Checklist F: air")."""

from __future__ import annotations

import pytest
from chip_lab import PAYLOAD, Lab

from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.registers import Register


def send_together(lab, *senders, apart_us=0):
    """Pulse chips that have a payload loaded, one after the other."""
    for wires in senders:
        wires.load(no_ack=True)
    for wires in senders:
        wires.chip.ce.value = True
        lab.wait_us(apart_us)
    lab.wait_us(20)
    for wires in senders:
        wires.chip.ce.value = False
    lab.wait_us(5_000)


def broadcasting(lab, name, x_m, power_bits=0x26):
    wires = lab.wires(name, x_m).become_ptx()
    wires.write(Register.FEATURE, 0x01)
    wires.write(Register.RF_SETUP, power_bits)
    return wires


@pytest.mark.parametrize("apart_us", [0, 600, 1200])
def test_row_47_two_frames_of_equal_power_destroy_each_other(lab, apart_us):
    prx = lab.wires("prx", 100.0).become_prx()
    one, other = broadcasting(lab, "one", 0.0), broadcasting(lab, "other", 200.0)
    send_together(lab, one, other, apart_us=apart_us)
    assert prx.unload_all() == []
    assert lab.air.collisions == 2


@pytest.mark.parametrize("stronger_first", [True, False])
def test_row_47_of_two_frames_24_db_apart_the_stronger_survives(lab, stronger_first):
    prx = lab.wires("prx", 0.0).become_prx()
    near, far = broadcasting(lab, "near", 10.0), broadcasting(lab, "far", 160.0)
    near.load(b"\x01" * 32, no_ack=True)
    far.load(b"\x02" * 32, no_ack=True)
    for wires in (near, far) if stronger_first else (far, near):
        wires.pulse(20)
        lab.wait_us(300)
    lab.wait_us(5_000)
    assert prx.unload_all() == [(2, b"\x01" * 32)]


def test_a_frame_that_began_before_the_receiver_listened_is_not_heard(lab):
    prx = lab.wires("prx", 100.0).become_prx()
    prx.chip.ce.value = False
    one = broadcasting(lab, "one", 0.0)
    one.load(no_ack=True)
    one.pulse()
    prx.chip.ce.value = True
    lab.wait_us(5_000)
    assert prx.unload_all() == []


def test_a_receiver_that_looks_away_in_mid_frame_does_not_hear_it(lab):
    prx = lab.wires("prx", 100.0).become_prx()
    one = broadcasting(lab, "one", 0.0)
    one.load(no_ack=True)
    one.pulse()
    lab.wait_us(300)
    prx.chip.ce.value = False
    lab.wait_us(10)
    prx.chip.ce.value = True
    lab.wait_us(5_000)
    assert prx.unload_all() == []


def test_row_48_a_node_that_comes_into_range_is_reached():
    lab = Lab(IdealDisc(9.0))
    sender, receiver = lab.driver(5), lab.driver(10, 9.0)
    assert not sender.send(10, b"\x01" * 32)
    assert receiver.receive(0.01) == []
    receiver.chip.position = (8.9, 0.0, 0.0)
    assert sender.send(10, b"\x02" * 32)
    assert receiver.receive(0.01) == [(2, b"\x02" * 32)]


def test_row_49_two_nodes_that_call_each_other_at_once_both_get_through(lab):
    one, other = lab.driver(5), lab.driver(10, 100.0)
    done = lab.at_once(lambda: one.send(10, b"\x05" * 32), lambda: other.send(5, b"\x10" * 32))
    assert done == [True, True]
    assert one.receive(0.01) == [(2, b"\x10" * 32)]
    assert other.receive(0.01) == [(2, b"\x05" * 32)]
    # The chips alone did not get through: each driver saw MAX_RT and tried again.
    assert one.statistics().tries + other.statistics().tries >= 2


@pytest.mark.parametrize(("skewed", "collide_for_ever"), [(False, True), (True, False)])
def test_row_49_two_chips_that_call_a_third_need_different_retransmit_delays(
    lab, skewed, collide_for_ever
):
    prx = lab.wires("prx", 100.0).become_prx()
    one = lab.wires("one", 0.0).become_ptx(retries=0x5F)
    other = lab.wires("other", 200.0).become_ptx(retries=0x7F if skewed else 0x5F)
    one.load(b"\x01" * 32)
    other.load(b"\x02" * 32)
    for wires in (one, other):
        wires.pulse(11)
    lab.wait_us(90_000)
    if collide_for_ever:
        assert (one.status & 0x30, other.status & 0x30) == (0x10, 0x10)
        assert prx.unload_all() == []
    else:
        assert (one.status & 0x30, other.status & 0x30) == (0x20, 0x20)
        assert sorted(prx.unload_all()) == [(2, b"\x01" * 32), (2, b"\x02" * 32)]


def test_row_49_two_drivers_that_call_a_third_both_get_through(lab):
    third, one, other = lab.driver(10, 100.0), lab.driver(5), lab.driver(7, 200.0)
    done = lab.at_once(lambda: one.send(10, b"\x05" * 32), lambda: other.send(10, b"\x07" * 32))
    assert done == [True, True]
    got = sorted(received.payload[0] for received in third.receive(0.01))
    assert got == [5, 7]


@pytest.mark.parametrize(("distance_m", "rpd"), [(5.0, 1), (50.0, 0)])
def test_row_50_rpd_sees_a_transmitter_at_5_m_but_not_at_50_m(lab, distance_m, rpd):
    prx = lab.wires("prx").become_prx()
    one = broadcasting(lab, "one", distance_m)
    one.write(Register.TX_ADDR, b"\x99" * 5)
    one.load(no_ack=True)
    one.pulse()
    lab.wait_us(600)
    assert prx.byte(Register.RPD) == rpd
    prx.chip.ce.value = False
    lab.wait_us(5_000)
    assert prx.byte(Register.RPD) == rpd  # as it was when RX ended
    assert lab.air.frames == 1


def test_row_50_rpd_needs_40_us_of_power(lab):
    prx = lab.wires("prx").become_prx()
    one = broadcasting(lab, "one", 5.0)
    one.load(no_ack=True)
    one.pulse()
    lab.wait_us(130 - 20 + 30)
    assert prx.byte(Register.RPD) == 0
    lab.wait_us(10)
    assert prx.byte(Register.RPD) == 1


def test_the_payload_is_not_disturbed_by_other_channels(lab):
    prx = lab.wires("prx", 100.0).become_prx()
    one, other = broadcasting(lab, "one", 0.0), broadcasting(lab, "other", 200.0)
    other.write(Register.RF_CH, 3)
    send_together(lab, one, other)
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_rpd_shows_the_power_of_the_last_valid_packet(lab):
    prx = lab.wires("prx").become_prx()
    for distance_m, rpd in ((5.0, 1), (50.0, 0), (5.0, 1)):
        sender = broadcasting(lab, f"at {distance_m} m", distance_m)
        sender.load(bytes((round(distance_m) + len(lab.trace.frames),)) * 32, no_ack=True)
        sender.pulse()
        lab.wait_us(5_000)
        assert prx.byte(Register.RPD) == rpd
