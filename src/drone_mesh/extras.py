"""Programs that need an extra of the package: without it, one line that says which."""

from __future__ import annotations

import signal
import sys
from typing import Callable

Main = Callable[[], int]


def run_with_extra(program: str, extra: str, load: Callable[[], Main]) -> int:
    """Run what `load` imports; the exit status, 1 if a package is missing."""
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C leaves no traceback
    try:
        main = load()
    except ImportError as error:
        print(
            f"{program} needs the Python package {error.name}: pip install 'drone_mesh[{extra}]'",
            file=sys.stderr,
        )
        return 1
    finally:
        signal.signal(signal.SIGINT, before)
    return main()
