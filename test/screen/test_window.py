"""The world's window on a virtual screen: its content, and that closing it does no harm."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess

import numpy as np
import pytest
from patience import wait_for
from PIL import ImageGrab

from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.state.condition import Condition
from drone_mesh.view.palette import LIGHT, rgb
from drone_mesh.view.scene import DronePicture, Scene
from drone_mesh.view.window_process import WindowProcess, require_screen

SCENE = Scene(
    [
        DronePicture(0, Role.GATEWAY, (-1.0, 0.0, 0.0)),
        DronePicture(1, Role.ROUTER, (1.0, 0.0, 0.0)),
        DronePicture(2, Role.ROUTER, (1.0, 2.0, 0.0), Condition.DISCONNECTED),
    ],
    title="a title",
)

needs_screen = pytest.mark.skipif(
    shutil.which("Xvfb") is None, reason="Xvfb, the virtual screen, is not installed"
)


@pytest.fixture(scope="module")
def display():
    """A virtual screen of its own, with a number that the server chooses.

    Without ``-noreset`` the server starts over when its last client leaves, and refuses
    whoever connects meanwhile: the window of the next test.
    """
    read, write = os.pipe()
    options = ["-screen", "0", "1300x820x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), *options],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as numbers:
        number = numbers.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


@pytest.fixture
def screen(display, monkeypatch):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    return display


@pytest.fixture
def window(screen):
    window = WindowProcess(lambda: SCENE)
    window.start()
    yield window
    window.stop()


def pixels_like(screen, colour):
    """How many pixels of the screen have this hue, light or dark."""
    pixels = np.asarray(ImageGrab.grab(xdisplay=screen).convert("RGB")).astype(float)
    hues, wanted = (
        values - values.min(axis=-1, keepdims=True)
        for values in (pixels.reshape(-1, 3), np.array(rgb(colour)))
    )
    strength = np.linalg.norm(hues, axis=1)
    likeness = hues @ wanted / (np.maximum(strength, 1) * np.linalg.norm(wanted))
    return int(np.sum((likeness > 0.98) & (strength > 40)))


def wait_until_shown(screen):
    wait_for("a gateway on the screen", lambda: pixels_like(screen, LIGHT.gateway) > 100)


@needs_screen
def test_the_drones_are_on_the_screen_in_their_colours_until_it_is_stopped(screen, window):
    wait_until_shown(screen)
    for colour in (LIGHT.connected, LIGHT.disconnected):
        wait_for(f"{colour} on it", lambda colour=colour: pixels_like(screen, colour) > 100)
    window.stop()
    # The screen's server notices it a moment later.
    wait_for("an empty screen", lambda: pixels_like(screen, LIGHT.gateway) == 0)


@needs_screen
def test_a_window_that_crashes_does_no_harm_and_is_reported(screen, caplog):
    looks = []
    window = WindowProcess(lambda: looks.append(1) or SCENE)
    window.start()
    wait_until_shown(screen)
    os.kill(window.pid, signal.SIGKILL)
    wait_for("a warning", lambda: "exit code -9" in caplog.text)
    window.stop()


@needs_screen
def test_it_can_be_stopped_before_it_has_started(screen):
    window = WindowProcess(lambda: SCENE)
    window.start()
    window.stop()
    with pytest.raises(ProcessLookupError):
        os.kill(window.pid, 0)


@needs_screen
def test_a_screen_that_answers_is_enough(screen):
    require_screen("gui")


@pytest.mark.parametrize(
    ("display", "why"),
    [("", "DISPLAY is not set"), ("no-such-host.invalid:5", "the screen .* does not answer")],
)
def test_without_a_screen_it_reports_that_in_one_line(monkeypatch, display, why):
    monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(ConfigurationError, match=f"^gui: .*{why}.*gui:=false"):
        WindowProcess(lambda: SCENE)
