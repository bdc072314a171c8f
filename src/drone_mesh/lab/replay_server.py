"""The web console for a recorded run, with its time line."""

from __future__ import annotations

import time
from typing import Sequence

from drone_mesh.console.controls import RecordingControls
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.runner import ConsoleRunner
from drone_mesh.console.server import ConsoleServer
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.web import LOOPBACK
from drone_mesh.web.access import Access

POLL_PERIOD_S = 0.5  # period of checks for Ctrl-C


def serve_replay(
    states: Sequence[MeshStatus], events: Sequence[EventRecord], title: str, port: int
) -> None:
    """Serve until Ctrl-C. Raises ConfigurationError if the port is not available."""
    whole = History.of_run(states, events)
    server = ConsoleServer(
        FrameStore(), RecordingControls(), Access(), recording=title, whole=whole, is_played=False
    )
    runner = ConsoleRunner(server, LOOPBACK, port)
    runner.start()
    print(f"{title}: {runner.url}  (Ctrl-C ends it)", flush=True)
    try:
        while True:
            time.sleep(POLL_PERIOD_S)
    except KeyboardInterrupt:
        pass
    finally:
        runner.stop()
