"""Keeps a WorldWindow in a process of its own, which nothing in the simulation waits for."""

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
from drone_mesh.view.picture import Scene

LOOK_PERIOD_S = 0.05  # wall; at most 20 scenes a second
END_TIMEOUT_S = 3.0  # wall; from the end of the pipe to that of the process

_log = logging.getLogger(__name__)


def require_screen() -> None:
    """Raise ConfigurationError unless there is an X server that lets us in.

    pybullet ends the whole process instead of saying so.
    """
    display = os.environ.get("DISPLAY", "")
    hint = "start it with gui:=false, or where DISPLAY names a screen"
    if not display:
        raise ConfigurationError(f"gui: there is no screen here (DISPLAY is not set); {hint}")
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError as error:
        raise ConfigurationError(f"gui: no X11 library on this machine; {hint}") from error
    x11.XOpenDisplay.restype = ctypes.c_void_p
    connection = x11.XOpenDisplay(None)
    if not connection:
        raise ConfigurationError(f"gui: the screen {display} does not answer; {hint}")
    x11.XCloseDisplay(ctypes.c_void_p(connection))


class WindowProcess:
    """Shows what `look` returns, at most 20 times a second, until somebody closes the window.

    `look` is called in a thread of this object, which is the only one that waits for the window.
    """

    def __init__(self, look: Callable[[], Scene]) -> None:
        """Raises ConfigurationError when there is no screen."""
        require_screen()
        self._look = look
        self._stopped = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None

    @property
    def pid(self) -> int | None:
        """Of the window's process; None before the start."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Open the window; returns before it is there."""
        ours, theirs = multiprocessing.Pipe()
        # Where Python finds this package only because we were told so, the window has to be told.
        paths = [os.environ.get("PYTHONPATH", ""), str(Path(drone_mesh.__file__).parents[1])]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "drone_mesh.view.show_window", str(theirs.fileno())],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in paths if path)},
            pass_fds=[theirs.fileno()],
            stdout=subprocess.DEVNULL,  # pybullet's many words
            start_new_session=True,  # Ctrl-C is for us; its sign to end is the end of the pipe
        )
        theirs.close()  # so that our end notices when the window is gone
        self._thread = threading.Thread(
            target=self._run, args=(ours, self._process), name="world window", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Close the window; returns when its process and the thread have ended."""
        self._stopped.set()
        if self._thread is None or self._process is None:
            return
        self._process.terminate()  # it has nothing to put in order, and closing takes a second
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
            _log.info("the world's window is closed; the simulation goes on")
        else:
            _log.warning(
                "the world's window ended by itself (exit code %s); the simulation goes on",
                process.returncode,
            )

    def _send(self, scenes: Connection) -> None:
        """Send what changes, until the window is to go or has gone."""
        shown: Scene | None = None
        while not self._stopped.wait(LOOK_PERIOD_S):
            scene = self._look()
            if scene != shown:
                scenes.send(scene)
                shown = scene
            elif scenes.poll():  # it never says a word: this is its end
                return
