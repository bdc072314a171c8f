"""The receiving chip, and our driver as a receiver (docs/radio.md, "Checklist D: receiver")."""

from __future__ import annotations

import pytest
from chip_lab import ADDRESS, BROADCAST_ADDRESS, PAYLOAD, us

from drone_mesh.nrf24.emulator.chip_core import State
from drone_mesh.nrf24.registers import Register
from drone_mesh.nrf24.settings import DataRate


def test_row_31_payloads_come_with_the_pipe_they_were_sent_to(lab):
    ptx, prx = lab.pair()
    ptx.send(b"\x02" * 32)
    ptx.write(Register.TX_ADDR, BROADCAST_ADDRESS)
    ptx.write(Register.RX_ADDR_P0, BROADCAST_ADDRESS)
    ptx.send(b"\x01" * 32)
    assert prx.unload_all() == [(2, b"\x02" * 32), (1, b"\x01" * 32)]


def test_row_31_the_driver_reports_the_pipes(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    sender.broadcast(b"\x01" * 32)
    sender.send(10, b"\x02" * 32)
    assert receiver.receive(0.1) == [(1, b"\x01" * 32), (2, b"\x02" * 32)]


@pytest.mark.parametrize("bit", [0, 7, 8, 39])
def test_row_32_an_address_that_is_one_bit_off_gets_nothing_and_no_acknowledgement(lab, bit):
    ptx, prx = lab.pair()
    wrong = (int.from_bytes(ADDRESS, "little") ^ 1 << bit).to_bytes(5, "little")
    ptx.write(Register.TX_ADDR, wrong)
    ptx.write(Register.RX_ADDR_P0, wrong)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []
    assert lab.frames_from("prx", answers=True) == []


def test_row_32_a_closed_pipe_gets_nothing(lab):
    ptx, prx = lab.pair()
    prx.chip.ce.value = False
    prx.write(Register.EN_RXADDR, 0x02)
    prx.chip.ce.value = True
    lab.wait_us(200)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []


@pytest.mark.parametrize("width", [0, 31])
def test_row_33_another_payload_width_receives_nothing(lab, width):
    ptx = lab.wires("ptx").become_ptx()
    prx = lab.wires("prx", 100.0).become_prx(width=width)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []


@pytest.mark.parametrize(
    "settings", [{"channel": 2}, {"rate": "1M"}, {"crc_bytes": 1}], ids=["channel", "rate", "CRC"]
)
def test_row_34_other_settings_of_the_air_receive_nothing(lab, settings):
    ptx = lab.wires("ptx").become_ptx()
    prx = lab.wires("prx", 100.0).become_prx(**settings)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []


def test_row_34_another_address_width_receives_nothing(lab):
    ptx, prx = lab.pair()
    prx.chip.ce.value = False
    prx.write(Register.SETUP_AW, 2)
    prx.chip.ce.value = True
    lab.wait_us(200)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []


def test_row_35_auto_ack_off_at_the_receiver_alone_receives_nothing(lab):
    ptx = lab.wires("ptx").become_ptx()
    prx = lab.wires("prx", 100.0).become_prx(en_aa=0x3B)
    assert ptx.send() == 0x10
    assert prx.unload_all() == []


def test_row_35_auto_ack_off_at_both_ends_is_received_without_acknowledgement(lab):
    ptx, prx = lab.pair(en_aa=0x00, crc_bytes=1)
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(5_000)
    assert us(ptx.chip.irq.fell_ns - rose_ns) == 1378
    assert ptx.status == 0x2E
    assert prx.unload_all() == [(2, PAYLOAD)]
    assert lab.frames_from("prx", answers=True) == []


def test_row_36_a_fourth_packet_into_a_full_fifo_is_not_acknowledged(lab):
    ptx, prx = lab.pair()
    flags = [ptx.send(bytes((number,)) * 32) for number in range(4)]
    assert flags == [0x20, 0x20, 0x20, 0x10]
    assert prx.byte(Register.FIFO_STATUS) & 0x02
    assert prx.unload_all() == [(2, bytes((number,)) * 32) for number in range(3)]


@pytest.mark.parametrize("irq", [True, False], ids=["IRQ", "polling"])
def test_row_36_the_driver_drains_fast_enough_for_senders_in_a_row(lab, irq):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0, irq=irq)
    payloads = [bytes((number,)) * 32 for number in range(20)]

    def receive():
        got = []
        while len(got) < len(payloads):
            got += [received.payload for received in receiver.receive(1.0)]
        return got

    sent, got = lab.at_once(lambda: [sender.send(10, p) for p in payloads], receive)
    assert all(sent)
    assert got == payloads
    assert sender.statistics().tries == 0


def test_row_37_the_same_bytes_written_twice_are_delivered_twice(lab):
    ptx, prx = lab.pair()
    ptx.send()
    ptx.send()
    assert prx.unload_all() == [(2, PAYLOAD)] * 2


def test_row_38_equal_pid_and_crc_from_another_sender_is_dropped_and_yet_acknowledged(lab):
    one, prx = lab.pair()
    other = lab.wires("other", 50.0).become_ptx()
    assert one.send() == 0x20
    assert other.send() == 0x20
    assert prx.unload_all() == [(2, PAYLOAD)]


@pytest.mark.parametrize(("by_pipe", "copies"), [(True, 1), (False, 2)])
def test_row_38_one_memory_for_all_pipes_forgets_at_the_next_pipe(lab, by_pipe, copies):
    one, between, other = (lab.wires(name).become_ptx() for name in ("one", "between", "other"))
    between.write(Register.TX_ADDR, BROADCAST_ADDRESS)
    between.write(Register.RX_ADDR_P0, BROADCAST_ADDRESS)
    prx = lab.wires("prx", 100.0, duplicates_by_pipe=by_pipe).become_prx()
    for wires in (one, between, other):
        assert wires.send() == 0x20
    assert prx.unload_all().count((2, PAYLOAD)) == copies


def test_row_39_an_acknowledgement_is_completed_when_ce_goes_low(lab):
    ptx, prx = lab.pair()
    ptx.load()
    ptx.pulse()
    lab.wait_us(1_500)
    assert prx.chip.state in (State.ANSWER_SETTLING, State.ANSWER)
    prx.chip.ce.value = False
    lab.wait_us(3_000)
    assert ptx.status == 0x2E
    assert prx.chip.state is State.STANDBY_I
    assert lab.warnings == []


def test_row_39_the_driver_leaves_an_acknowledgement_time_before_it_sends_itself(lab):
    ptx = lab.wires("ptx", 50.0).become_ptx()
    receiver = lab.driver(10, 100.0)
    ptx.load()
    ptx.pulse()
    lab.wait_us(1_460)
    assert receiver.chip.state is State.ANSWER_SETTLING
    config_ns = []
    written = receiver.chip.config_written

    def note(*arguments):
        config_ns.append(lab.clock.now_ns)
        written(*arguments)

    receiver.chip.config_written = note
    fell_ns = lab.clock.now_ns
    receiver.broadcast(b"\x01" * 32)
    assert us(config_ns[0] - fell_ns) >= 390
    assert ptx.status & 0x20
    assert lab.warnings == []


def test_row_40_clearing_rx_dr_does_not_hide_payloads_from_the_driver(lab):
    sender = lab.driver(5)
    prx = lab.wires("prx", 100.0)
    receiver = lab.driver(10, 100.0, irq=False)
    for number in range(3):
        assert sender.send(10, bytes((number,)) * 32)
    receiver.chip.clear_flags(0x40)
    assert receiver.chip.status() & 0x40 == 0
    assert [received.payload[0] for received in receiver.receive(0.1)] == [0, 1, 2]
    assert prx.status == 0x0E


def test_row_40_the_flag_stays_clear_on_the_chip_while_payloads_are_left(lab):
    ptx, prx = lab.pair()
    ptx.send(b"\x01" * 32)
    ptx.send(b"\x02" * 32)
    prx.unload()
    prx.write(Register.STATUS, 0x40)
    assert prx.status == 0x04
    assert prx.unload() == b"\x02" * 32


def test_reading_past_the_end_of_a_payload_goes_on_with_the_next(lab):
    ptx, prx = lab.pair(width=4)
    ptx.send(b"\x01\x02\x03\x04")
    ptx.send(b"\x05\x06\x07\x08")
    assert prx.unload(2) == b"\x01\x02"
    assert prx.unload(6) == b"\x01\x02\x03\x04\x05\x06"
    assert prx.unload(6) == b"\x05\x06\x07\x08\x08\x08"


def test_a_chip_that_removes_payloads_read_in_part_goes_on_with_the_next(lab):
    ptx = lab.wires("ptx").become_ptx(width=4)
    prx = lab.wires("prx", 100.0, partial_read_removes=True).become_prx(width=4)
    ptx.send(b"\x01\x02\x03\x04")
    ptx.send(b"\x05\x06\x07\x08")
    assert prx.unload(2) == b"\x01\x02"
    assert prx.unload(4) == b"\x05\x06\x07\x08"


def test_a_flag_without_a_payload_is_cleared_so_that_the_irq_pin_rises(lab):
    receiver = lab.driver(10, 100.0)
    receiver.chip.set_flags(0x40)
    assert receiver.receive(0.05) == []
    assert receiver.chip.irq.value


def test_the_acknowledgement_goes_to_the_address_that_the_packet_came_to(lab):
    """Also if the register changes in the 130 us in between."""
    ptx, prx = lab.pair()
    ptx.load()
    ptx.pulse()
    lab.wait_us(130 + 1316)  # the frame has arrived
    assert prx.chip.state is State.ANSWER_SETTLING
    prx.write(Register.RX_ADDR_P2, b"\x77")
    lab.wait_us(5_000)
    assert ptx.status & 0x30 == 0x20


@pytest.mark.parametrize("rate", DataRate)
def test_a_receiver_without_irq_is_never_full_when_a_train_arrives(lab, rate):
    """Three packets fill the FIFO, the sooner the higher the rate; a fourth is not acknowledged."""
    sender = lab.driver(5, data_rate=rate)
    receiver = lab.driver(10, 100.0, irq=False, data_rate=rate)
    train = [bytes((number,)) * 32 for number in range(60)]
    following = iter(train[1:])
    got = []

    def receive():
        while len(got) < len(train) and lab.clock.now_s() < 2.0:
            got.extend(payload for _pipe, payload in receiver.receive(0.1))

    tries, _none = lab.at_once(
        lambda: sender.try_once(10, train[0], False, 1, 2, lambda _frames: next(following, None)),
        receive,
    )
    assert tries.acknowledged
    assert got == train
    assert sender.statistics().retries == 0
