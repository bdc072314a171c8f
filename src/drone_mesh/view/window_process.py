"""Runs a WorldWindow in a separate process, so that the simulation never waits for it."""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import os
import subprocess
import sys
import threading
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Callable

import drone_mesh
from drone_mesh.errors import ConfigurationError
from drone_mesh.view.scene import Scene
from drone_mesh.world.physics import require_pybullet

POLL_PERIOD_S = 0.05  # wall; at most 20 scenes a second
END_TIMEOUT_S = 3.0  # wall; between the end of the pipe and the end of the process

_log = logging.getLogger(__name__)


def require_screen(argument: str) -> None:
    """Raise ConfigurationError unless an X server accepts a connection.

    pybullet would end the whole process without a message, and Qt with a list of its plugins.
    `argument` is the launch argument that asks for a window.
    """
    display = os.environ.get("DISPLAY", "")
    hint = f"use {argument}:=false, or set DISPLAY to a screen"
    if not display:
        raise ConfigurationError(f"{argument}: no screen (DISPLAY is not set); {hint}")
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError as error:
        raise ConfigurationError(f"{argument}: libX11 is not installed; {hint}") from error
    x11.XOpenDisplay.restype = ctypes.c_void_p
    connection = x11.XOpenDisplay(None)
    if not connection:
        raise ConfigurationError(f"{argument}: the screen {display} does not answer; {hint}")
    x11.XCloseDisplay(ctypes.c_void_p(connection))


class WindowProcess:
    """Shows what `read_scene` returns, at most 20 times a second, until the window is closed.

    `read_scene` is called in this object's thread, the only one that waits for the window.
    """

    def __init__(self, read_scene: Callable[[], Scene]) -> None:
        """Raises ConfigurationError if there is no screen or no pybullet."""
        require_screen("gui")
        require_pybullet("gui")
        self._read_scene = read_scene
        self._stopped = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None

    @property
    def pid(self) -> int | None:
        """The window's process id; None before the start."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Open the window; returns before it is visible."""
        ours, theirs = multiprocessing.Pipe()
        # The new process must find this package even if only our sys.path has it.
        paths = [os.environ.get("PYTHONPATH", ""), str(Path(drone_mesh.__file__).parents[1])]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "drone_mesh.view.window_process", str(theirs.fileno())],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in paths if path)},
            pass_fds=[theirs.fileno()],
            stdout=subprocess.DEVNULL,  # pybullet prints a lot
            start_new_session=True,  # Ctrl-C must not reach the window, which ends with the pipe
        )
        theirs.close()  # so that our end notices when the window is gone
        self._thread = threading.Thread(
            target=self._run, args=(ours, self._process), name="world window", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Close the window; returns when its process and this object's thread have ended."""
        self._stopped.set()
        if self._thread is None or self._process is None:
            return
        self._process.terminate()  # it has nothing to save, and closing it properly takes a second
        self._thread.join()

    def _run(self, scenes: Connection, process: subprocess.Popen[bytes]) -> None:
        try:
            self._send(scenes)
        except (BrokenPipeError, ConnectionResetError):
            pass
        finally:
            scenes.close()
        try:
            process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self._stopped.is_set():
            return
        if process.returncode == 0:
            _log.info("the world's window was closed; the simulation continues")
        else:
            _log.warning(
                "the world's window failed with exit code %s; the simulation continues",
                process.returncode,
            )

    def _send(self, scenes: Connection) -> None:
        """Send each new scene, until this object is stopped or the window is gone."""
        shown: Scene | None = None
        while not self._stopped.wait(POLL_PERIOD_S):
            scene = self._read_scene()
            if scene != shown:
                scenes.send(scene)
                shown = scene
            elif scenes.poll():  # it never sends anything, so this is the end of the pipe
                return


def _show_scenes(scenes: Connection) -> None:
    """The window's process: show the scenes from the pipe until it ends or the window is closed."""
    from drone_mesh.view.window import WorldWindow  # only here: the other side opens no window

    window = WorldWindow()
    try:
        while window.is_open():
            if scenes.poll(POLL_PERIOD_S):
                window.show(scenes.recv())
    except EOFError:
        pass
    finally:
        window.close()


if __name__ == "__main__":
    _show_scenes(Connection(int(sys.argv[1])))
