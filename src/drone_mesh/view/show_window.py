"""The program in the window's process: python -m drone_mesh.view.show_window PIPE."""

from __future__ import annotations

import sys
from multiprocessing.connection import Connection

from drone_mesh.view.window import WorldWindow

REACT_PERIOD_S = 0.03  # wall; between two checks of keys and mouse


def show_scenes(scenes: Connection) -> None:
    """Show the scenes from the pipe until it ends or the window is closed."""
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


if __name__ == "__main__":
    show_scenes(Connection(int(sys.argv[1])))
