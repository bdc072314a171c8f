"""scripts/autopilots with ArduPilot's own software, as its user sees it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from pilot_side import PilotSide, PilotSideError

ROOT = Path(__file__).resolve().parents[2]
PILOTS_PORT = 5762  # of the first copter


@pytest.mark.skipif("PYTEST_XDIST_WORKER" in os.environ, reason="its ports are those of others")
def test_a_ready_copter_is_left_to_its_pilot_and_ctrl_c_leaves_nothing_behind(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    with subprocess.Popen(
        [sys.executable, str(ROOT / "test" / "autopilot" / "autopilots.py"), "1"],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        text=True,
    ) as autopilots:
        assert autopilots.stdout is not None
        assert autopilots.stdout.readline().startswith("raspberry_router --id 1 ")
        assert "1 copters are ready" in autopilots.stdout.readline()
        with contextlib.closing(PilotSide(f"tcp:127.0.0.1:{PILOTS_PORT}", 1)) as pilot:
            assert pilot.mode == "GUIDED"
            pilot.choose("LOITER")
        autopilots.send_signal(signal.SIGINT)
        assert autopilots.wait(10.0) == 0
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(PilotSideError):
        PilotSide(f"tcp:127.0.0.1:{PILOTS_PORT}", 1, within_s=0.5)
