"""The transmitting chip, and our driver as a sender (docs/radio.md, "Checklist C: transmitter")."""

from __future__ import annotations

from chip_lab import PAYLOAD, us

from drone_mesh.nrf24.registers import Command, Register


def lose_first(lab, count, *, answers):
    """The next frames of one kind get lost, so many of them."""
    left = [count]

    def loses(hop):
        if (hop.packet is None) != answers or not left[0]:
            return False
        left[0] -= 1
        return True

    lab.loses = loses


def pids(lab, name):
    """PID of each frame that a chip sent, read from the bits on the air."""
    return [frame.frame.to_bytes()[6] & 3 for frame in lab.frames_from(name)]


def test_row_19_an_acknowledged_packet_sets_tx_ds_and_leaves_the_fifo(lab):
    ptx, prx = lab.pair()
    ptx.load()
    ptx.pulse()
    lab.wait_us(5_000)
    assert ptx.status == 0x2E
    assert ptx.byte(Register.FIFO_STATUS) == 0x11
    assert ptx.byte(Register.OBSERVE_TX) == 0x00
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_row_19_the_driver_returns_true_when_the_packet_was_acknowledged(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    assert sender.send(10, PAYLOAD)
    assert receiver.receive(0.1) == [(2, PAYLOAD)]
    assert sender.statistics().retries == 0


def test_row_20_without_a_receiver_max_rt_comes_after_16_frames(lab):
    ptx = lab.wires("ptx").become_ptx(crc_bytes=1)
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(60_000)
    assert us(ptx.chip.irq.fell_ns - rose_ns) == 46_624
    assert len(lab.trace.frames) == 16
    assert ptx.byte(Register.OBSERVE_TX) == 0x1F
    assert ptx.byte(Register.FIFO_STATUS) & 0x10 == 0
    assert ptx.status == 0x1E


def test_row_20_a_receiver_that_is_gone_costs_18_frames_and_the_payload_is_dropped(lab):
    sender = lab.driver(5)
    assert not sender.send(10, PAYLOAD)
    statistics = sender.statistics()
    assert (statistics.lost, statistics.tries) == (1, 8)
    assert len(lab.trace.frames) == 9 * 2
    assert len(set(pids(lab, "node 5"))) == 1
    assert sender.chip.tx_fifo.oldest is None


def test_row_21_nothing_is_sent_until_max_rt_is_cleared_then_the_same_packet(lab):
    ptx = lab.wires("ptx").become_ptx()
    ptx.load()
    ptx.pulse()
    lab.wait_us(60_000)
    before = len(lab.trace.frames)
    ptx.pulse()
    lab.wait_us(60_000)
    assert len(lab.trace.frames) == before
    ptx.write(Register.STATUS, 0x10)
    lab.wait_us(60_000)
    assert len(lab.trace.frames) == before
    prx = lab.wires("prx", 100.0).become_prx()
    ptx.pulse()
    lab.wait_us(5_000)
    assert ptx.status == 0x2E
    assert prx.unload_all() == [(2, PAYLOAD)]
    assert set(pids(lab, "ptx")) == {1}


def test_row_22_a_failed_send_does_not_spoil_the_next(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    assert not sender.send(11, b"\x01" * 32)
    tries = sender.statistics().tries
    frames = len(lab.trace.frames)
    assert sender.send(10, b"\x02" * 32)
    assert sender.statistics().tries == tries
    assert len(lab.trace.frames) == frames + 2
    assert receiver.receive(0.1) == [(2, b"\x02" * 32)]


def test_row_23_two_lost_acknowledgements_cost_two_retransmits_and_no_copy(lab):
    ptx, prx = lab.pair()
    lose_first(lab, 2, answers=True)
    assert ptx.send() == 0x20
    assert ptx.byte(Register.OBSERVE_TX) == 0x02
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_row_23_a_second_try_of_the_driver_cannot_arrive_twice(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    lose_first(lab, 5, answers=True)
    assert sender.send(10, PAYLOAD)
    assert sender.statistics().tries == 2
    assert len(set(pids(lab, "node 5"))) == 1
    assert receiver.receive(0.1) == [(2, PAYLOAD)]
    assert receiver.receive(0.1) == []


def test_row_24_without_retransmits_one_frame_is_sent_and_max_rt_comes_after_one_ard(lab):
    ptx = lab.wires("ptx").become_ptx(crc_bytes=1, retries=0x50)
    ptx.load()
    rose_ns = ptx.pulse()
    lab.wait_us(60_000)
    assert us(ptx.chip.irq.fell_ns - rose_ns) == 2914
    assert len(lab.trace.frames) == 1
    assert ptx.status == 0x1E


def test_row_25_with_another_address_on_pipe_0_a_delivered_packet_fails(lab):
    ptx, prx = lab.pair()
    ptx.write(Register.RX_ADDR_P0, b"\x0b")
    assert ptx.send() == 0x10
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_row_26_with_pipe_0_closed_a_delivered_packet_fails(lab):
    ptx, prx = lab.pair()
    ptx.write(Register.EN_RXADDR, 0x06)
    assert ptx.send() == 0x10
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_row_27_the_count_of_lost_packets_stops_at_15_and_ends_with_a_new_channel(lab):
    ptx = lab.wires("ptx").become_ptx(retries=0x50)
    for _ in range(20):
        assert ptx.send() == 0x10
    assert ptx.byte(Register.OBSERVE_TX) == 0xF0
    ptx.write(Register.RF_CH, 1)
    assert ptx.byte(Register.OBSERVE_TX) == 0x00


def test_row_28_a_fourth_payload_is_lost_and_the_first_three_stay(lab):
    ptx, prx = lab.pair()
    for number in range(4):
        ptx.load(bytes((number,)) * 32)
    assert ptx.status & 0x01
    assert ptx.byte(Register.FIFO_STATUS) & 0x20
    ptx.chip.ce.value = True
    lab.wait_us(20_000)
    assert prx.unload_all() == [(2, bytes((number,)) * 32) for number in range(3)]
    assert lab.warnings == ["a payload was written while the TX FIFO was full, and is lost"]


def test_row_29_a_payload_that_is_used_again_is_a_new_packet_each_time(lab):
    ptx, prx = lab.pair()
    assert ptx.send() == 0x20
    ptx.command(Command.REUSE_TX_PL)
    assert ptx.byte(Register.FIFO_STATUS) & 0x40
    for _ in range(2):
        ptx.pulse()
        lab.wait_us(5_000)
    assert pids(lab, "ptx") == [1, 2, 3]
    assert len(prx.unload_all()) == 3
    ptx.command(Command.FLUSH_TX)
    assert ptx.byte(Register.FIFO_STATUS) == 0x11


def test_row_29_a_toggle_of_ce_sends_the_same_packet_number_again(lab):
    ptx = lab.wires("ptx").become_ptx(retries=0x50)
    ptx.load()
    for _ in range(2):
        ptx.pulse()
        lab.wait_us(10_000)
        ptx.write(Register.STATUS, 0x10)
    assert pids(lab, "ptx") == [1, 1]


def test_packets_with_the_same_bytes_are_all_delivered_whatever_was_sent_between(lab):
    """The PID has two bits: without care every fourth repetition would be dropped as a copy."""
    sender, receiver, third = lab.driver(5), lab.driver(10, 100.0), lab.driver(11, 100.0)
    got = []
    for _ in range(5):
        assert sender.send(10, PAYLOAD)
        got += receiver.receive(0.01)
        for number in range(3):
            assert sender.send(11, bytes((number,)) * 32)
        third.receive(0.01)
    assert got == [(2, PAYLOAD)] * 5
