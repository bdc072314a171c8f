"""raspberry_radio on emulated chips: its output for a good radio and for each fault."""

from __future__ import annotations

import random
import threading
from typing import Iterator

import pytest

from drone_mesh.channel.runtime import Runtime
from drone_mesh.communication.wire.messages import IntroduceMessage
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.chip_core import ChipVariant
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.registers import Register
from drone_mesh.nrf24.settings import BroadcastMode, DataRate, RadioSettings
from drone_mesh.raspberry import radio_tests
from drone_mesh.raspberry.field_radio import FieldRadio
from drone_mesh.raspberry.options import parse_gateway
from drone_mesh.raspberry.radio_command import main
from drone_mesh.raspberry.wiring_options import Hardware

SETTINGS = RadioSettings()


class NoWire:
    """A CE pin that is not connected to the chip."""

    value = False

    def close(self) -> None:
        """Nothing is held."""


class Rig:
    def __init__(self) -> None:
        self.clock = WallClock()
        self.air = Air(self.clock, LogDistance(random.Random(1)), random.Random(2))
        self.chip = EmulatedChip(self.air, "radio")
        self.radio = self.make(self.chip, 253)

    def make(self, chip: EmulatedChip, node_id: int, ce=None, settings=SETTINGS) -> FieldRadio:
        return FieldRadio(chip.spi, ce or chip.ce, node_id, settings, self.clock.runtime)

    def check(self) -> list[str]:
        return list(radio_tests.check(self.radio, self.chip.irq))


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.clock.close()


def test_a_good_radio_passes_every_check(rig):
    lines = rig.check()
    assert len(lines) == 5
    assert all(line.startswith("ok ") for line in lines)
    assert rig.chip.warnings == []


def test_a_chip_without_plus_passes_with_the_settings_that_it_needs(rig):
    rig.chip = EmulatedChip(rig.air, "old", variant=ChipVariant(plus=False))
    plain = RadioSettings(data_rate=DataRate.MBPS_1, broadcast_mode=BroadcastMode.SHOCKBURST)
    rig.radio = rig.make(rig.chip, 253, settings=plain)
    lines = rig.check()
    assert [line[:3] for line in lines] == ["ok "] * 5, lines
    assert rig.chip.warnings == []


def test_a_tool_takes_what_all_radios_of_a_mesh_have_in_common(monkeypatch, capsys):
    monkeypatch.setattr(radio_tests, "check", lambda radio, _irq: [str(radio.settings)])
    line = "--emulated 30 --channel 82 --rate 1M --crc 8 --broadcast shockburst check"
    assert main(line.split()) == 0
    wanted = RadioSettings(
        channel=82,
        data_rate=DataRate.MBPS_1,
        crc_bytes=1,
        broadcast_mode=BroadcastMode.SHOCKBURST,
    )
    assert capsys.readouterr().out == f"{wanted}\n"


def test_without_a_chip_the_wiring_is_named(rig):
    rig.chip.faults.miso_stuck_at = 0xFF
    with pytest.raises(RadioError, match="no nRF24L01.* answers on SPI .*check the wiring"):
        rig.check()


def test_a_ce_pin_that_is_not_wired_is_named(rig):
    rig.radio = rig.make(rig.chip, 253, NoWire())
    with pytest.raises(RadioError, match="is CE wired"):
        rig.check()


def test_a_supply_that_dips_while_it_sends_is_named(rig):
    lines = radio_tests.check(rig.radio, None)
    for line in lines:
        if line.startswith("ok   CE"):
            break
    register = rig.radio.link.read_byte(Register.SETUP_AW)
    rig.radio.link.write_byte(Register.RX_PW_P1, 0)  # what a brown-out leaves behind
    assert register == 3
    with pytest.raises(RadioError, match="supply: RX_PW_P1 lost its setting .*capacitor"):
        list(lines)


@pytest.mark.parametrize(("level", "said"), [(False, "low although"), (True, "never falls")])
def test_an_irq_pin_that_is_stuck_is_named(rig, level, said):
    rig.chip.faults.irq_stuck_at = level
    assert said in rig.check()[-1]


def test_a_scan_shows_where_another_radio_sends(rig):
    other = rig.make(EmulatedChip(rig.air, "other", (3.0, 0.0, 0.0)), 7)
    other.set_up()
    rig.radio.set_up()
    ended = threading.Event()

    def send() -> None:
        while not ended.is_set():
            other.broadcast(bytes(32))

    sender = threading.Thread(target=send)
    sender.start()
    try:
        heard = sum(rig.radio.hears_carrier(SETTINGS.channel) for _ in range(300))
        elsewhere = sum(rig.radio.hears_carrier(90) for _ in range(50))
    finally:
        ended.set()
        sender.join()
    assert heard > 0
    assert elsewhere == 0
    rig.radio.back_to_channel()
    assert rig.radio.link.read_byte(Register.RF_CH) == SETTINGS.channel


def test_the_channels_suggested_are_quiet_apart_and_in_the_band():
    heard = [9] * 126
    for channel in (30, 31, 32, 33, 34, 70, 71, 72, 73, 74, 100, 101, 102, 103, 104):
        heard[channel] = 0
    chosen = radio_tests.quietest(heard, 2)
    assert set(chosen) == {32, 72}


@pytest.mark.parametrize(
    ("nodes", "rate"), [(2, "250k"), (50, "250k"), (51, "1M"), (101, "1M"), (254, "2M")]
)
def test_the_rate_suggested_is_the_slowest_that_carries_so_many_nodes(nodes, rate):
    assert radio_tests.rate_for(nodes) == rate


@pytest.mark.slow
def test_a_scan_ends_with_options_that_the_gateway_takes(capsys):
    assert main(["--emulated", "30", "scan", "--rounds", "1", "--nodes", "101"]) == 0
    options = capsys.readouterr().out.splitlines()[-1].rpartition(": ")[2].split()
    radio = parse_gateway(options, {}).radio
    assert radio.data_rate is DataRate.MBPS_1
    assert 1 <= radio.channel <= 82


@pytest.mark.slow
def test_a_range_test_counts_what_another_node_acknowledges_at_each_power_and_rate(capsys):
    line = ["--emulated", "30", "range", "--to", "1", "--packets", "2"]
    assert main([*line, "--distance", "30"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split(",")[:3] for row in rows[1:5]] == [
        ["250", power, "2"] for power in ("0", "-6", "-12", "-18")
    ]
    assert rows[5].startswith("# measured in 2019 ")
    assert main([*line, "--all-rates"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert {row.split(",")[0] for row in rows[1:]} == {"250", "1000", "2000"}


class BusyMachine:
    """The process waits for a core each time before it looks at the clock."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self.sleep = runtime.sleep

    def now_s(self) -> float:
        self._runtime.sleep(0.1)
        return self._runtime.now_s()


def test_a_machine_that_is_busy_while_a_packet_is_sent_is_no_fault_of_the_radio(rig):
    runtime = BusyMachine(rig.clock.runtime)
    radio = FieldRadio(rig.chip.spi, rig.chip.ce, 253, SETTINGS, runtime)
    radio.set_up()
    assert not radio.send(SETTINGS.node_address(5), bytes(32)).acknowledged


def test_what_is_heard_is_decoded(rig):
    other = rig.make(EmulatedChip(rig.air, "other", (3.0, 0.0, 0.0)), 7)
    other.set_up()
    heard: list[str] = []
    lines = radio_tests.listen(rig.radio, lambda: bool(heard))
    sender = threading.Timer(
        0.3, other.broadcast, [IntroduceMessage(7, 7, 254, 254, 2, True).to_payload()]
    )
    sender.start()
    heard.append(next(lines))
    sender.join()
    assert "PRESENT made by 7, from 7 to 254, for 254: hops_until_gateway 2" in heard[0]


def test_a_packet_of_a_type_that_is_not_known_is_shown_as_bytes():
    assert radio_tests.decoded(bytes((1, 2, 200, 3, 4)).ljust(32, b"\x05")).startswith(
        "type 200 made by 1, from 2 to 3, for 4: 0102c803040505"
    )


def test_a_report_that_cannot_be_written_is_refused_before_the_check(tmp_path, capsys):
    file = tmp_path / "no" / "report.txt"
    assert main(["--emulated", "30", "report", str(file)]) == 1
    output = capsys.readouterr()
    assert not output.out
    assert f"cannot write the report to {file}: No such file or directory" in output.err


@pytest.mark.slow
def test_a_full_disk_ends_a_report_with_one_line(capsys):
    assert main(["--emulated", "30", "report", "/dev/full"]) == 1
    line = "cannot write the report to /dev/full: No space left on device"
    assert line in capsys.readouterr().err


@pytest.mark.slow
def test_an_interrupted_report_leaves_the_earlier_one(tmp_path, monkeypatch):
    file = tmp_path / "report.txt"
    file.write_text("of yesterday\n", encoding="utf-8")

    def interrupted(*_arguments):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(radio_tests, "scan", interrupted)
    main(["--emulated", "30", "report", str(file)])
    assert file.read_text(encoding="utf-8") == "of yesterday\n"


@pytest.mark.slow
def test_a_report_holds_checks_scan_and_machine(tmp_path, capsys):
    file = tmp_path / "report.txt"
    assert main(["--emulated", "30", "report", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    assert "radio emulated: these results do not come from a real chip" in text
    assert "== check\nok   registers" in text
    assert "125 2525 MHz" in text
    assert "Python" in text
    assert "report written to" in capsys.readouterr().out


def test_without_hardware_it_says_what_to_do_and_fails(capsys):
    assert main(["--spi", "99.0", "check"]) == 1
    assert capsys.readouterr().err.startswith("FAIL ")


@pytest.fixture
def wired(rig, monkeypatch) -> Rig:
    """The chip of the rig is the hardware of this machine."""
    wired = (rig.chip.spi, rig.chip.ce, rig.chip.irq)
    monkeypatch.setattr(Hardware, "open", lambda _hardware: wired)
    return rig


def test_a_stuck_irq_pin_is_a_failure_like_any_other(wired, capsys):
    wired.chip.faults.irq_stuck_at = True
    assert main(["--irq", "24", "check"]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith("FAIL IRQ: never falls")


def test_a_report_of_a_radio_that_fails_is_written_and_ends_as_a_failure(wired, tmp_path, capsys):
    wired.chip.faults.miso_stuck_at = 0xFF
    assert main(["report", str(tmp_path / "radio.txt")]) == 1
    assert "== check\nFAIL no nRF24L01+ answers" in (tmp_path / "radio.txt").read_text()
    assert "report written to" in capsys.readouterr().out


def test_it_releases_spi_and_both_pins_when_it_ends(wired, monkeypatch, capsys):
    closed = []
    for name in ("spi", "ce", "irq"):
        device = getattr(wired.chip, name)
        monkeypatch.setattr(device, "close", lambda name=name: closed.append(name), raising=True)
    assert main(["--irq", "24", "check"]) == 0, capsys.readouterr().err
    assert sorted(closed) == ["ce", "irq", "spi"]


@pytest.mark.parametrize("metres", ["nan", "-5", "0", "1e9"])
def test_a_distance_that_is_none_is_refused(capsys, metres):
    with pytest.raises(SystemExit) as ended:
        main([f"--emulated={metres}", "scan"])
    assert ended.value.code == 2
    assert "must be a number 0.1..100000" in capsys.readouterr().err
