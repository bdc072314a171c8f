"""The types of the package's messages are those of msg/ and srv/."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_stubs_of_messages_and_services_fit_their_definitions():
    check = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "message_stubs"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stderr
