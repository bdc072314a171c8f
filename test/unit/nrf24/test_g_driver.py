"""Rows 51 to 57 for our driver (docs/radio.md, "Checklist G: driver in this project").

Rows 58 to 60 have modules of their own.
"""

from __future__ import annotations

import logging

import pytest
from chip_lab import PAYLOAD, Wires

from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.errors import HardwareUnavailable, RadioError
from drone_mesh.nrf24.pins import open_spi
from drone_mesh.nrf24.registers import Register
from drone_mesh.nrf24.settings import DataRate, RadioSettings, TxPower


def registers_of(lab, driver, *registers):
    wires = Wires(lab, driver.chip)
    return [wires.byte(register) for register in registers]


def test_row_51_registers_are_set_after_begin(lab):
    driver = lab.driver(5)
    wires = Wires(lab, driver.chip)
    values = registers_of(
        lab, driver, Register.CONFIG, Register.EN_AA, Register.EN_RXADDR, Register.SETUP_AW,
        Register.SETUP_RETR, Register.RF_CH, Register.RF_SETUP, Register.FEATURE, Register.DYNPD,
    )  # fmt: skip
    assert bytes(values) == bytes.fromhex("0F 3F 06 03 5F 01 26 01 00")
    assert wires.read(Register.RX_ADDR_P1, 5) == bytes.fromhex("FE 68 52 4D 54")
    assert wires.byte(Register.RX_ADDR_P2) == 5
    assert wires.read(Register.RX_PW_P0, 1) + wires.read(Register.RX_PW_P2, 1) == b"\x20\x20"
    assert driver.chip.ce.value


def test_row_51_the_settings_of_2019_and_others_reach_the_chip(lab):
    driver = lab.driver(
        5, crc_bytes=1, data_rate=DataRate.MBPS_2, power=TxPower.DBM_MINUS_12, channel=80
    )
    values = registers_of(lab, driver, Register.CONFIG, Register.RF_SETUP, Register.RF_CH)
    assert bytes(values) == bytes.fromhex("0B 0A 50")


def test_row_51_every_register_is_written_for_the_chip_was_not_reset(lab):
    driver = lab.driver(5, begin=False)
    wires = Wires(lab, driver.chip)
    for register in (Register.EN_AA, Register.DYNPD, Register.FEATURE, Register.RX_PW_P3):
        wires.write(register, 0x07)
    wires.write(Register.SETUP_AW, 0x01)
    wires.load()
    driver.begin()
    values = registers_of(
        lab, driver, Register.EN_AA, Register.DYNPD, Register.FEATURE, Register.RX_PW_P3,
        Register.SETUP_AW, Register.FIFO_STATUS,
    )  # fmt: skip
    assert bytes(values) == bytes.fromhex("3F 00 01 00 03 11")


@pytest.mark.parametrize("receiver_present", [True, False])
def test_row_52_after_every_send_it_listens_again_with_only_its_own_pipes(lab, receiver_present):
    driver = lab.driver(5)
    if receiver_present:
        lab.driver(10, 100.0)
    opened = set()
    write = driver.chip.registers.write

    def watch(register, data):
        if register is Register.EN_RXADDR:
            opened.add(data[0])
        write(register, data)

    driver.chip.registers.write = watch
    assert driver.send(10, PAYLOAD) == receiver_present
    assert registers_of(lab, driver, Register.CONFIG, Register.EN_RXADDR, Register.SETUP_RETR) == [
        0x0F,
        0x06,
        0x5F,
    ]
    assert opened == {0x06, 0x07}
    lab.wait_us(200)
    assert driver.chip.listening_since_ns is not None


def test_row_53_a_node_does_not_acknowledge_mail_for_another(lab):
    node_5, node_10, node_7 = lab.driver(5), lab.driver(10, 50.0), lab.driver(7, 100.0)
    assert node_5.send(10, PAYLOAD)
    assert not node_7.send(130, PAYLOAD)
    assert node_5.receive(0.1) == []
    assert [received.pipe for received in node_10.receive(0.1)] == [2]


def test_row_54_mail_for_node_0_reaches_node_0_only(lab):
    sender = lab.driver(5)
    others = [lab.driver(node, 10.0 * node) for node in (0, 1, 2)]
    assert sender.send(0, PAYLOAD)
    assert [other.receive(0.05) for other in others] == [[(2, PAYLOAD)], [], []]


def test_row_55_a_broadcast_without_a_receiver_returns_in_less_than_3_ms(lab):
    driver = lab.driver(5)
    begin_s = lab.clock.now_s()
    assert driver.broadcast(PAYLOAD)
    assert lab.clock.now_s() - begin_s < 0.003


@pytest.mark.parametrize("miso", [0x00, 0xFF])
def test_row_56_a_chip_that_is_absent_is_reported_at_once(lab, miso):
    driver = lab.driver(5, begin=False)
    driver.chip.faults.miso_stuck_at = miso
    with pytest.raises(RadioError, match=f"no nRF24L01\\+ answers.*0x{miso:02X}.*wiring"):
        driver.begin()


def test_row_56_a_register_that_reads_back_wrong_is_named(lab):
    driver = lab.driver(5, begin=False)
    write = driver.chip.registers.write
    driver.chip.registers.write = lambda register, data: (
        None if register is Register.RF_CH else write(register, data)
    )
    with pytest.raises(RadioError, match="RF_CH was written as 01 and reads as 02"):
        driver.begin()


def test_row_56_a_missing_spi_device_is_named_with_the_way_to_switch_it_on():
    with pytest.raises(HardwareUnavailable, match=r"/dev/spidev97\.3") as refused:
        open_spi(97, 3)
    text = str(refused.value)
    assert "\n" not in text
    assert "raspi-config" in text or "python3-spidev" in text


def test_row_57_after_a_brown_out_the_driver_sets_the_chip_up_again(lab, caplog):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    assert sender.send(10, b"\x01" * 32)
    sender.chip.brown_out()
    with caplog.at_level(logging.WARNING):
        sender.send(10, b"\x02" * 32)
        assert sender.send(10, b"\x03" * 32)
    assert sender.statistics().restarts == 1
    assert "CONFIG reads 0x08" in caplog.text
    assert receiver.receive(0.1)[-1] == (2, b"\x03" * 32)


@pytest.mark.parametrize("irq", [True, False], ids=["IRQ", "polling"])
def test_row_57_a_listener_notices_a_brown_out_by_itself(lab, irq):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0, irq=irq)
    assert receiver.receive(0.1) == []
    receiver.chip.brown_out()
    assert receiver.receive(2.0) == []
    assert receiver.statistics().restarts == 1
    assert sender.send(10, PAYLOAD)
    assert receiver.receive(0.1) == [(2, PAYLOAD)]


def test_a_chip_that_disappears_costs_sends_and_is_found_when_it_is_back(lab):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    sender.chip.faults.miso_stuck_at = 0x00
    assert not sender.send(10, PAYLOAD)
    assert not sender.broadcast(PAYLOAD)
    assert not sender.working
    sender.chip.faults.miso_stuck_at = None
    lab.wait_us(1_100_000)
    assert sender.send(10, PAYLOAD)
    assert receiver.receive(0.1) == [(2, PAYLOAD)]
    assert sender.statistics().restarts == 1


@pytest.mark.parametrize("bytes_after_status", [1, 32])
def test_zeros_behind_a_right_status_are_no_payloads(lab, caplog, bytes_after_status):
    """A bad MISO: FIFO_STATUS reads 0, "a payload waits", and RX_P_NO says that none does."""
    driver = lab.driver(5)
    spi = driver.chip.spi
    transfer = spi.xfer2

    def without_data(out):
        answer = transfer(out)
        return [answer[0], *bytes(len(out) - 1)] if len(out) <= 1 + bytes_after_status else answer

    spi.xfer2 = without_data
    with caplog.at_level(logging.WARNING):
        assert driver.receive(0.05) == []
    assert not driver.working
    assert driver.statistics().received == 0
    assert "FIFO_STATUS reads 0x00" in caplog.text
    assert "check MISO" in caplog.text
    spi.xfer2 = transfer
    lab.wait_us(1_100_000)
    sender = lab.driver(10, 100.0)
    assert driver.receive(0.05) == []
    assert sender.send(5, PAYLOAD)
    assert driver.receive(0.05) == [(2, PAYLOAD)]


@pytest.mark.parametrize("level", [True, False], ids=["high", "low"])
def test_an_irq_pin_that_is_stuck_is_given_up_for_polling(lab, level):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    receiver.chip.faults.irq_stuck_at = level
    receiver.chip.update_irq()

    def send():
        for number in range(10):
            lab.clock.sleep(0.15)
            assert sender.send(10, bytes((number,)) * 32)

    def receive():
        got = []
        while len(got) < 10:
            got += [received.payload[0] for received in receiver.receive(0.3)]
        return got

    assert lab.at_once(send, receive)[1] == list(range(10))
    assert receiver.statistics().irq_fallbacks == 1
    begin_s = lab.clock.now_s()
    assert sender.send(10, PAYLOAD)
    receiver.receive(1.0)
    assert lab.clock.now_s() - begin_s < 0.02


@pytest.mark.parametrize("fault", ["dead_transmitter", "dead_receiver"])
def test_a_radio_that_is_half_dead_cannot_be_reached_with_acknowledgement(lab, fault):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    setattr(receiver.chip.faults, fault, True)
    assert not sender.send(10, PAYLOAD)
    assert len(receiver.receive(0.1)) == (1 if fault == "dead_transmitter" else 0)


def test_a_chip_that_is_silent_for_95_ms_is_set_up_again(lab):
    sender = lab.driver(5)
    lab.driver(10, 100.0)
    start = sender.chip.transmitter.start
    sender.chip.transmitter.start = lambda settling_ns: None
    assert not sender.send(10, PAYLOAD)
    sender.chip.transmitter.start = start
    lab.wait_us(1_100_000)
    restarts = sender.statistics().restarts
    assert restarts >= 1  # with each try that found the chip set up and silent
    assert sender.send(10, PAYLOAD)
    assert sender.statistics().restarts == restarts


def test_closing_powers_the_chip_down(lab):
    with lab.driver(5, begin=False) as driver:
        assert driver.working
    assert registers_of(lab, driver, Register.CONFIG) == [0x0C]
    assert not driver.chip.ce.value
    assert not driver.send(10, PAYLOAD)


def test_a_payload_of_another_length_is_refused(lab):
    driver = lab.driver(5)
    with pytest.raises(ValueError, match="payload of 31 bytes: must have 32"):
        driver.send(10, bytes(31))


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"channel": 126}, "invalid channel 126: must be 0..125"),
        ({"crc_bytes": 0}, "invalid crc_bytes 0: must be 1..2"),
        ({"retransmit_delay": 0}, "at least 1 .500 us. at 250 kbit/s"),
        ({"base_address": 0x544D526801}, "must end in 00"),
        ({"broadcast_id": 253}, "invalid broadcast_id 253: must be 254..255"),
    ],
)
def test_settings_that_no_chip_has_are_refused_with_a_reason(wrong, why):
    with pytest.raises(ConfigurationError, match=why):
        RadioSettings(**wrong)


def test_two_damaged_frames_do_not_end_a_train(lab):
    sender, receiver = lab.driver(1), lab.driver(2, x_m=5.0)
    payloads = [bytes((number,)) * 32 for number in range(3)]
    frames = []

    def loses(hop):
        if hop.packet is None:
            return False  # an acknowledgement
        frames.append(hop)
        return len(frames) in (2, 3)  # the second payload, twice

    lab.loses = loses
    waiting = iter(payloads[1:])
    took = []

    def following(frames):
        took.append(frames)
        return next(waiting, None)

    assert sender.try_once(2, payloads[0], False, 1, 2, following) == (True, 1)
    assert took == [1, 3, 1]
    assert [received.payload for received in receiver.receive(0.01)] == payloads
