"""The way to a real radio: what is missing is named, with what to do about it."""

from __future__ import annotations

import sys
import types
from collections import deque

import pytest

from drone_mesh.nrf24 import pins
from drone_mesh.nrf24.errors import HardwareUnavailable
from drone_mesh.nrf24.pins import open_spi


class FakeSpiDev:
    """A spidev.SpiDev whose device cannot be opened, or can."""

    problem = None

    def open(self, bus, device):
        if self.problem is not None:
            raise self.problem
        self.opened = (bus, device)


@pytest.fixture
def spidev(monkeypatch):
    monkeypatch.setattr(FakeSpiDev, "problem", None)
    monkeypatch.setitem(sys.modules, "spidev", types.SimpleNamespace(SpiDev=FakeSpiDev))
    return FakeSpiDev


def test_the_spi_device_is_opened_in_mode_0_at_8_mhz(spidev):
    spi = open_spi(0, 1)
    assert (spi.opened, spi.mode, spi.max_speed_hz) == ((0, 1), 0, 8_000_000)


@pytest.mark.parametrize(
    ("problem", "advice"),
    [
        (FileNotFoundError(2, "No such file or directory"), "raspi-config.*dtparam=spi=on"),
        (PermissionError(13, "Permission denied"), "usermod -aG spi"),
        (OSError(5, "Input/output error"), "cannot open /dev/spidev0.0: Input/output error"),
    ],
)
def test_an_spi_device_that_cannot_be_opened_is_named_in_one_line(spidev, problem, advice):
    spidev.problem = problem
    with pytest.raises(HardwareUnavailable, match=advice) as refused:
        open_spi(0, 0)
    assert "/dev/spidev0.0" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_missing_spidev_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(HardwareUnavailable, match="python3-spidev"):
        open_spi(0, 0)


def test_a_missing_gpiod_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(HardwareUnavailable, match="pip install 'gpiod>=2'"):
        pins.GpiodCe()


def test_the_older_gpiod_under_the_same_name_is_recognised(monkeypatch):
    monkeypatch.setitem(sys.modules, "gpiod", types.SimpleNamespace(Chip=object))
    with pytest.raises(HardwareUnavailable, match="older than version 2"):
        pins.GpiodCe()


class FakeLines:
    """What request_lines gives: one line with a level and edges."""

    def __init__(self, value):
        self.level = value
        self.levels = []
        self.edges = deque()
        self.released = False

    def set_value(self, _gpio, value):
        self.levels.append(value)

    def get_value(self, _gpio):
        return self.level

    def wait_edge_events(self, _timeout):
        if not self.edges:
            return False
        self.level = self.edges[0]
        return True

    def read_edge_events(self):
        return [self.edges.popleft()]

    def release(self):
        self.released = True


@pytest.fixture
def header(monkeypatch, tmp_path):
    """A machine with two GPIO chips, the second with the header's label."""
    gpiod = pytest.importorskip("gpiod", minversion="2")
    labels = {"gpiochip0": "raspberrypi-exp-gpio", "gpiochip4": "pinctrl-rp1"}
    for name in labels:
        (tmp_path / name).touch()

    class Chip:
        def __init__(self, path):
            self.label = labels[path.rsplit("/", 1)[1]]

        def __enter__(self):
            return self

        def __exit__(self, *_exc):
            pass

        def get_info(self):
            return self

    requests = []

    def request_lines(path, consumer, config):
        ((pin, settings),) = config.items()
        lines = FakeLines(gpiod.line.Value.ACTIVE)
        requests.append((path, pin, settings, lines))
        return lines

    monkeypatch.setattr(gpiod, "Chip", Chip)
    monkeypatch.setattr(gpiod, "request_lines", request_lines)
    find = pins.find_header
    monkeypatch.setattr(pins, "find_header", lambda: find(tmp_path))
    return types.SimpleNamespace(
        gpiod=gpiod, labels=labels, requests=requests, folder=tmp_path, find=find
    )


def test_the_gpio_chip_is_found_by_its_label(header):
    assert header.find(header.folder) == str(header.folder / "gpiochip4")


def test_on_a_machine_without_the_header_the_error_lists_the_names_searched(header):
    header.labels["gpiochip4"] = "INT33FC:00"
    with pytest.raises(HardwareUnavailable, match="pinctrl-bcm2711.*INT33FC:00.*Raspberry Pi?"):
        header.find(header.folder)


def test_ce_is_an_output_that_is_low_from_the_start_and_at_the_end(header):
    value = header.gpiod.line.Value
    ce = pins.GpiodCe()
    (path, pin, settings, lines) = header.requests[0]
    assert (path, pin) == (str(header.folder / "gpiochip4"), 25)
    assert settings.direction is header.gpiod.line.Direction.OUTPUT
    assert settings.output_value is value.INACTIVE
    ce.value = True
    assert ce.value
    ce.close()
    assert lines.levels == [value.ACTIVE, value.INACTIVE]
    assert lines.released


def test_irq_is_believed_by_its_level_and_an_old_edge_does_not_end_the_wait(header):
    value = header.gpiod.line.Value
    irq = pins.GpiodIrq()
    (_path, pin, settings, lines) = header.requests[0]
    assert pin == 24
    assert settings.edge_detection is header.gpiod.line.Edge.FALLING
    assert not irq.wait_low(0.0)
    lines.edges.extend([value.ACTIVE, value.INACTIVE])  # an old one, and the real one
    assert irq.wait_low(5.0)
    assert irq.wait_low(0.0)
    irq.close()
    assert lines.released


def test_a_pin_that_is_in_use_is_named(header, monkeypatch):
    def refuse(*_args, **_kwargs):
        raise OSError(16, "Device or resource busy")

    monkeypatch.setattr(header.gpiod, "request_lines", refuse)
    with pytest.raises(HardwareUnavailable, match="cannot use GPIO25.*Device or resource busy"):
        pins.GpiodCe()
