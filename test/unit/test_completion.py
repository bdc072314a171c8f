"""Tab completion of the scripts, as bash asks for it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def complete(*words: str) -> list[str]:
    """What bash offers for the last of these words."""
    script = (
        '. scripts/completion.bash; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); '
        'function=$(complete -p "$1"); function=${function#*-F }; ${function%% *}; '
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "--norc", "-c", script, "bash", *words],
        cwd=str(ROOT),
        check=True,
        capture_output=True,
        text=True,
        timeout=20,
    )
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("scripts/run", "rout"), ["routers:=", "routing:="]),
        (("scripts/run", "routers:=", "--ro"), ["--ros-args"]),
        (("./scripts/test", ""), ["unit", "lint", "rostest", "--help"]),
        (("scripts/test", "li"), ["lint"]),
        (("scripts/test", "rostest", "test/rostest/repa"), ["test/rostest/repair.test"]),
        (("scripts/test", "lint", ""), []),
    ],
)
def test_the_scripts_complete_their_arguments(words, offered):
    assert complete(*words) == offered
