"""Keeps a WorldWindow in a process of its own, which nothing in the simulation waits for."""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import os
import signal
import sys
import threading
from multiprocessing.connection import Connection
from typing import Callable

from drone_mesh.errors import ConfigurationError
from drone_mesh.world.picture import Scene
from drone_mesh.world.window import WorldWindow

LOOK_PERIOD_S = 0.05  # wall; at most 20 scenes a second
REACT_PERIOD_S = 0.03  # wall; between two looks at keys and mouse
END_TIMEOUT_S = 3.0  # wall; a window that has not closed by then is ended

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
        context = multiprocessing.get_context("spawn")  # a fork would copy locks that are held
        self._ours, self._theirs = context.Pipe()
        self._process = context.Process(
            target=_show_scenes, args=(self._theirs,), name="world window", daemon=True
        )
        self._thread = threading.Thread(target=self._run, name="world window", daemon=True)

    @property
    def pid(self) -> int | None:
        """Of the window's process; None before the start."""
        return self._process.pid

    def start(self) -> None:
        """Open the window; returns before it is there."""
        self._process.start()
        self._theirs.close()  # so that our end notices when the window is gone
        self._thread.start()

    def stop(self) -> None:
        """Close the window; returns when its process and the thread have ended."""
        self._stopped.set()
        self._thread.join(END_TIMEOUT_S)
        if self._thread.is_alive():  # the window takes no more scenes
            self._process.terminate()
            self._thread.join()

    def _run(self) -> None:
        shown: Scene | None = None
        try:
            while not self._stopped.wait(LOOK_PERIOD_S):
                scene = self._look()
                if scene != shown:
                    self._ours.send(scene)
                    shown = scene
                elif self._ours.poll():  # it never says a word: this is its end
                    break
        except (BrokenPipeError, ConnectionResetError):
            pass
        self._ours.close()
        self._process.join(END_TIMEOUT_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join()
        if self._stopped.is_set():
            return
        if self._process.exitcode == 0:
            _log.info("the world's window is closed; the simulation goes on")
        else:
            _log.warning(
                "the world's window ended by itself (exit code %s); the simulation goes on",
                self._process.exitcode,
            )


def _show_scenes(scenes: Connection) -> None:
    """What the window's process does: show what comes, until nothing does or it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches us, too; our end is the pipe's
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # pybullet's many words
    window = WorldWindow()
    try:
        while window.is_open():
            if scenes.poll(REACT_PERIOD_S):
                scene = scenes.recv()
                while scenes.poll():
                    scene = scenes.recv()
                window.show(scene)
            window.react()
    except EOFError:
        pass
    finally:
        window.close()
