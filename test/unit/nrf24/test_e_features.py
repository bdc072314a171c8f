"""NO_ACK packets, dynamic lengths, ack payloads (docs/radio.md, "Checklist E: features")."""

from __future__ import annotations

import pytest
from chip_lab import BROADCAST_ADDRESS, PAYLOAD

from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.registers import Command, Register
from drone_mesh.nrf24.settings import BroadcastMode, DataRate


def dynamic(wires, feature=0x04):
    """Dynamic payload lengths on the pipes 0 to 2."""
    ce, wires.chip.ce.value = wires.chip.ce.value, False
    wires.write(Register.FEATURE, feature)
    wires.write(Register.DYNPD, 0x07)
    wires.chip.ce.value = ce
    wires.lab.wait_us(200)


def test_row_41_a_broadcast_reaches_all_listeners_without_acknowledgement(lab):
    ptx = lab.wires("ptx").become_ptx(address=BROADCAST_ADDRESS)
    ptx.write(Register.FEATURE, 0x01)
    listeners = [lab.wires(f"prx {n}", 10.0 * n).become_prx() for n in range(1, 4)]
    assert ptx.send(no_ack=True) == 0x20
    assert [wires.unload_all() for wires in listeners] == [[(1, PAYLOAD)]] * 3
    assert len(lab.trace.frames) == 1


@pytest.mark.parametrize("mode", BroadcastMode)
def test_row_41_the_drivers_broadcast_reaches_all_and_sends_work_in_between(lab, mode):
    sender = lab.driver(5, broadcast_mode=mode)
    others = [lab.driver(n, 10.0 * n, broadcast_mode=mode) for n in (1, 2, 3)]
    assert sender.broadcast(PAYLOAD)
    assert sender.send(2, b"\x02" * 32)
    assert others[0].send(5, b"\x05" * 32)
    assert [other.receive(0.1) for other in others] == [
        [(1, PAYLOAD)], [(1, PAYLOAD), (2, b"\x02" * 32)], [(1, PAYLOAD)]
    ]  # fmt: skip
    assert sender.receive(0.1) == [(2, b"\x05" * 32)]
    broadcast = lab.frames_from("node 5")[0].frame
    assert broadcast.bit_count == (329 if mode is BroadcastMode.NO_ACK else 320)
    assert lab.warnings == []


def test_row_42_without_en_dyn_ack_the_packet_is_acknowledged_like_any_other(lab):
    ptx, prx = lab.pair()
    assert ptx.send(no_ack=True) == 0x20
    assert len(lab.frames_from("prx", answers=True)) == 1
    assert prx.unload_all() == [(2, PAYLOAD)]


@pytest.mark.parametrize("width", [1, 7, 32])
def test_row_43_dynamic_lengths_arrive_as_they_were_sent(lab, width):
    ptx, prx = lab.pair(width=0)
    dynamic(ptx)
    dynamic(prx)
    assert ptx.send(PAYLOAD[:width]) == 0x20
    assert prx.command(Command.R_RX_PL_WID, b"\0") == bytes((width,))
    assert prx.unload(width) == PAYLOAD[:width]


@pytest.mark.parametrize("width", [1, 8, 32])
def test_row_43_dynamic_lengths_arrive_without_auto_ack_too_and_are_not_acknowledged(lab, width):
    ptx, prx = lab.pair(width=0, en_aa=0x00)
    dynamic(ptx)
    dynamic(prx)
    for filling in (PAYLOAD, PAYLOAD[::-1]):
        assert ptx.send(filling[:width]) == 0x20
        assert prx.command(Command.R_RX_PL_WID, b"\0") == bytes((width,))
        assert prx.unload(width) == filling[:width]
    assert lab.frames_from("prx", answers=True) == []


def test_row_44_an_ack_payload_comes_back_with_the_acknowledgement(lab):
    ptx, prx = lab.pair()
    dynamic(ptx, 0x06)
    dynamic(prx, 0x06)
    prx.command(Command.W_ACK_PAYLOAD | 2, b"answer")
    ptx.load()
    ptx.pulse()
    lab.wait_us(10_000)
    assert ptx.status == 0x60  # RX_DR and TX_DS, pipe 0
    assert ptx.unload(6) == b"answer"
    assert prx.status & 0x20 == 0
    ptx.write(Register.STATUS, 0x70)
    ptx.send(b"\x01" * 32)
    assert prx.status & 0x20


@pytest.mark.parametrize(("retries", "flags"), [(0x1F, 0x10), (0x5F, 0x60)])
def test_row_45_a_long_ack_payload_needs_a_long_retransmit_delay(lab, retries, flags):
    ptx, prx = lab.pair(retries=retries)
    dynamic(ptx, 0x06)
    dynamic(prx, 0x06)
    prx.command(Command.W_ACK_PAYLOAD | 2, PAYLOAD)
    ptx.load()
    ptx.pulse()
    lab.wait_us(90_000)
    assert ptx.status & 0x70 == flags


def test_row_46_the_driver_flushes_a_frame_that_is_wider_than_a_payload_can_be(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    receiver.chip.faults.next_width = 51
    assert sender.send(10, b"\x01" * 32)
    assert receiver.receive(0.05) == []
    assert receiver.statistics().corrupt == 1
    assert sender.send(10, b"\x02" * 32)
    assert receiver.receive(0.05) == [(2, b"\x02" * 32)]


def test_the_polarity_of_the_no_ack_bit_separates_clones_from_genuine_chips(lab):
    """A clone follows the datasheet, a genuine chip may not: then acknowledgements go wrong."""
    ptx = lab.wires("clone", no_ack_bit=0).become_ptx()
    prx = lab.wires("genuine", 100.0).become_prx()
    assert ptx.send() == 0x10
    assert prx.unload_all() == [(2, PAYLOAD)]


def test_chips_without_plus_work_beside_plus_chips_in_shockburst_mode(lab):
    """They have no FEATURE register (it reads 0) and no 250 kbit/s."""
    settings = {"broadcast_mode": BroadcastMode.SHOCKBURST, "data_rate": DataRate.MBPS_1}
    plain = lab.driver(1, 0.0, plus=False, **settings)
    plus = lab.driver(2, 10.0, **settings)
    other_plain = lab.driver(3, 20.0, plus=False, **settings)
    for sender, receivers in (
        (plain, (plus, other_plain)),
        (plus, (plain, other_plain)),
    ):
        payload = bytes((sender.node_id,)) * 32
        assert sender.broadcast(payload)
        for receiver in receivers:
            assert [got.payload for got in receiver.receive(0.1)] == [payload]
            assert sender.send(receiver.node_id, payload)
            assert [got.payload for got in receiver.receive(0.1)] == [payload]
    assert plain.chip.registers.read(Register.FEATURE) == b"\0"


OLD_CHIP = (
    'this is an nRF24L01 without "+", or a clone of it: no 250 kbit/s, no FEATURE. '
    "It works with --rate 1M --broadcast shockburst, on all nodes"
)


@pytest.mark.parametrize(
    ("settings", "found"),
    [
        ({}, "RF_SETUP was written as 26 and reads as 06"),
        (
            {"data_rate": DataRate.MBPS_1},
            "FEATURE was written as 01 and reads as 00",
        ),
        (
            {"broadcast_mode": BroadcastMode.SHOCKBURST},
            "RF_SETUP was written as 26 and reads as 06",
        ),
    ],
)
def test_a_chip_without_plus_is_named_with_the_options_that_work_with_it(lab, settings, found):
    with pytest.raises(RadioError) as refused:
        lab.driver(1, plus=False, **settings)
    assert str(refused.value) == f"{found}: {OLD_CHIP}"


def test_a_register_that_every_chip_has_blames_the_wiring(lab):
    driver = lab.driver(1, begin=False)
    write = driver.chip.registers.write
    driver.chip.registers.write = lambda register, data: write(
        register, bytes(len(data)) if register in (Register.RF_CH, Register.FEATURE) else data
    )
    with pytest.raises(RadioError, match="RF_CH was written as 01 .* check wiring and supply"):
        driver.begin()
