"""Starts consoles by forking, so that what they import is imported once for all of them.

Reads orders from standard input, a JSON text in each line: {"start": [arguments of
console_process.py]}, whose console prints its process id; {"end": process id}, which interrupts it
and prints its exit code, or null if it had to be killed.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import traceback

import console_process

END_LIMIT_S = 10.0
POLL_PERIOD_S = 0.01


def start(arguments: list[str]) -> None:
    """Fork; the child is a console until it is interrupted."""
    if os.fork():
        return
    code = 1
    try:
        print(os.getpid(), flush=True)
        console_process.main(arguments)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)  # a child must not run its parent's clean-up


def end(pid: int) -> int | None:
    """Interrupt it; its exit code, or None if it did not end."""
    os.kill(pid, signal.SIGINT)
    deadline_s = time.monotonic() + END_LIMIT_S
    while True:
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            return os.WEXITSTATUS(status) if os.WIFEXITED(status) else -os.WTERMSIG(status)
        if time.monotonic() > deadline_s:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return None
        time.sleep(POLL_PERIOD_S)


def main() -> None:
    for line in sys.stdin:
        order = json.loads(line)
        if "start" in order:
            start(order["start"])
        else:
            print(json.dumps(end(order["end"])), flush=True)


if __name__ == "__main__":
    main()
