"""States and timing of the emulated chip (docs/radio.md, "Checklist B: states and timing")."""

from __future__ import annotations

import pytest
from chip_lab import ADDRESS, Lab, us

from drone_mesh.nrf24.emulator.chip_core import State
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.registers import Register

# 5 address bytes, 32 bytes of payload, SETUP_RETR 5F: T_data, T_ack, CE -> TX_DS, the same for a
# NO_ACK packet, and CE -> MAX_RT (docs/radio.md, "Airtime"), all in us
AIR_TIMES = [
    ("250k", 1, 1284, 260, 1804, 1414, 46_624),
    ("250k", 2, 1316, 292, 1868, 1446, 47_136),
    ("1M", 1, 321, 65, 646, 451, 31_216),
    ("2M", 1, 160.5, 32.5, 453, 290.5, 28_648),
]


def test_row_10_ce_too_soon_after_power_up_waits_for_the_crystal_and_warns(lab):
    ptx, _prx = lab.pair()
    ptx.write(Register.CONFIG, 0x0C)
    ptx.load()
    ptx.write(Register.CONFIG, 0x0E)
    powered_ns = lab.clock.now_ns
    lab.wait_us(500)
    ptx.chip.ce.value = True
    lab.wait_us(5_000)
    assert us(lab.frames_from("ptx")[0].start_ns - powered_ns) == 1500 + 130
    assert ptx.chip.warnings == ["CE high before Tpd2stby was over"]


def test_row_11_a_pulse_of_5_us_sends_nothing(lab):
    ptx, _prx = lab.pair()
    ptx.load()
    ptx.pulse(5)
    lab.wait_us(5_000)
    assert lab.trace.frames == ()
    assert ptx.chip.state is State.STANDBY_I


def test_row_12_a_pulse_of_11_us_sends_exactly_one_of_three(lab):
    ptx, prx = lab.pair()
    for number in range(3):
        ptx.load(bytes((number,)) * 32)
    ptx.pulse(11)
    lab.wait_us(20_000)
    assert len(lab.frames_from("ptx")) == 1
    assert prx.unload_all() == [(2, b"\x00" * 32)]
    assert ptx.chip.state is State.STANDBY_I


def test_row_13_ce_held_sends_all_then_waits_in_standby_ii_for_more(lab):
    ptx, prx = lab.pair()
    for number in range(3):
        ptx.load(bytes((number,)) * 32)
    ptx.chip.ce.value = True
    lab.wait_us(20_000)
    assert len(lab.frames_from("ptx")) == 3
    assert ptx.chip.state is State.STANDBY_II
    assert len(prx.unload_all()) == 3
    ptx.load(b"\x03" * 32)
    written_ns = lab.clock.now_ns
    lab.wait_us(5_000)
    assert us(lab.frames_from("ptx")[-1].start_ns - written_ns) == 130
    assert prx.unload_all() == [(2, b"\x03" * 32)]


def test_row_14_the_first_bit_comes_130_us_after_ce(lab):
    ptx, _prx = lab.pair()
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(5_000)
    assert us(lab.frames_from("ptx")[0].start_ns - rose_ns) == 130


def test_row_15_the_acknowledgement_begins_130_us_after_the_frame(lab):
    ptx, _prx = lab.pair()
    ptx.send()
    (data,) = lab.frames_from("ptx")
    (answer,) = lab.frames_from("prx", answers=True)
    assert us(answer.start_ns - data.end_ns) == 130


@pytest.mark.parametrize(
    ("rate", "crc_bytes", "data_us", "ack_us", "cycle_us", "_no_ack_us", "_failed_us"), AIR_TIMES
)
def test_row_16_air_times_are_those_of_the_table(
    lab, rate, crc_bytes, data_us, ack_us, cycle_us, _no_ack_us, _failed_us
):
    ptx, _prx = lab.pair(rate=rate, crc_bytes=crc_bytes)
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(5_000)
    (data,) = lab.frames_from("ptx")
    (answer,) = lab.frames_from("prx", answers=True)
    assert us(data.end_ns - data.start_ns) == data_us
    assert us(answer.end_ns - answer.start_ns) == ack_us
    assert us(ptx.chip.irq.fell_ns - rose_ns) == cycle_us
    assert ptx.status == 0x2E


@pytest.mark.parametrize(
    ("rate", "crc_bytes", "_data_us", "_ack_us", "_cycle_us", "_no_ack_us", "failed_us"), AIR_TIMES
)
def test_row_16_a_packet_fails_after_the_time_of_the_table(
    lab, rate, crc_bytes, _data_us, _ack_us, _cycle_us, _no_ack_us, failed_us
):
    ptx = lab.wires("ptx").become_ptx(rate=rate, crc_bytes=crc_bytes)
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(60_000)
    assert us(ptx.chip.irq.fell_ns - rose_ns) == failed_us
    assert ptx.status == 0x1E


@pytest.mark.parametrize(
    ("rate", "crc_bytes", "_data_us", "_ack_us", "_cycle_us", "no_ack_us", "_failed_us"), AIR_TIMES
)
@pytest.mark.parametrize("ce_held", [False, True])
def test_row_17_a_packet_without_acknowledgement_is_done_when_it_was_sent(
    lab, rate, crc_bytes, _data_us, _ack_us, _cycle_us, no_ack_us, _failed_us, ce_held
):
    ptx, prx = lab.pair(rate=rate, crc_bytes=crc_bytes)
    ptx.write(Register.FEATURE, 0x01)
    ptx.load(no_ack=True)
    rose_ns = lab.clock.now_ns
    ptx.chip.ce.value = True
    lab.wait_us(20)
    ptx.chip.ce.value = ce_held
    listened = False
    for _ in range(200):
        lab.wait_us(10)
        listened = listened or ptx.chip.listening_since_ns is not None
    assert us(ptx.chip.irq.fell_ns - rose_ns) == no_ack_us
    assert ptx.chip.state is (State.STANDBY_II if ce_held else State.STANDBY_I)
    assert not listened
    assert lab.frames_from("prx", answers=True) == []
    assert len(prx.unload_all()) == 1


@pytest.mark.parametrize("after_us", [300, 1600, 2500])  # in the frame, the answer, the ARD wait
def test_row_18_power_down_in_mid_transaction_keeps_the_payload_and_sets_no_flag(lab, after_us):
    ptx = lab.wires("ptx").become_ptx()
    ptx.load()
    ptx.pulse()
    lab.wait_us(after_us)
    ptx.write(Register.CONFIG, 0x0C)
    lab.wait_us(100_000)
    assert ptx.chip.state is State.POWER_DOWN
    assert ptx.status & 0x30 == 0
    assert ptx.byte(Register.FIFO_STATUS) & 0x10 == 0
    assert len(lab.trace.frames) == 1
    prx = lab.wires("prx", 100.0).become_prx()
    ptx.power_up(0x0E)
    ptx.pulse()
    lab.wait_us(5_000)
    assert len(prx.unload_all()) == 1


def test_an_aborted_frame_reaches_no_chip(lab):
    ptx, prx = lab.pair()
    ptx.load()
    ptx.pulse()
    lab.wait_us(300)
    ptx.write(Register.CONFIG, 0x0C)
    lab.wait_us(5_000)
    assert lab.trace.frames[0].is_aborted
    assert prx.unload_all() == []


def test_flush_tx_while_tx_settles_sends_nothing(lab):
    ptx, _prx = lab.pair()
    ptx.load()
    ptx.pulse(20)
    ptx.command(0xE1)
    lab.wait_us(5_000)
    assert lab.trace.frames == ()
    assert ptx.chip.state is State.STANDBY_I


def test_prim_rx_changed_while_ce_is_high_turns_the_radio_round_and_warns(lab):
    prx = lab.wires("prx").become_prx(address=ADDRESS)
    prx.write(Register.CONFIG, 0x0E)
    assert prx.chip.state is State.STANDBY_II
    prx.write(Register.CONFIG, 0x0F)
    lab.wait_us(130)
    assert prx.chip.state is State.RX
    assert prx.chip.warnings == ["PRIM_RX changed while CE is high"]


def test_a_short_pulse_of_ce_while_a_retransmit_settles_changes_nothing(lab):
    """Once the first frame has left, the transaction runs by itself [DS Fig. 17]."""
    ptx = lab.wires("ptx").become_ptx()
    ptx.load()
    ptx.pulse()
    lab.wait_us(130 + 1316 + 1500 + 50)  # 70 us before the second frame
    assert ptx.chip.state is State.TX_SETTLING
    ptx.pulse(5)
    lab.wait_us(60_000)
    assert ptx.status & 0x30 == 0x10
    assert len(lab.trace.frames) == 16


class DamagedAnswers(IdealDisc):
    """One bit of each acknowledgement arrives wrong."""

    def bit_errors(self, hop):
        return 1 if hop.packet is None else super().bit_errors(hop)


class LastBits:
    """Chooses the bits that are wrong: those of the CRC."""

    def sample(self, bits, count):
        return bits[-count:]


def test_the_wait_for_an_acknowledgement_ends_with_a_broken_one():
    lab = Lab(DamagedAnswers(1000.0))
    lab.air._rng = LastBits()
    ptx, prx = lab.pair()
    ptx.load()
    ptx.pulse()
    lab.wait_us(130 + 1316 + 130 + 292 - 10)
    assert ptx.chip.state is State.ACK_WAIT
    lab.wait_us(10 + 208 + 10)  # past the end of the frame and of the window of 500 us
    assert ptx.chip.state is State.RETRY_WAIT
    lab.wait_us(60_000)
    assert ptx.status & 0x30 == 0x10
    assert len(prx.unload_all()) == 1
