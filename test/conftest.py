"""What all tests need of the process that runs them."""

import os
import signal

# Tests replace methods of classes, which a compiled class does not notice: they run in Python,
# unless whoever starts them chooses the core.
os.environ.setdefault("DRONE_MESH_CORE", "python")

# A shell that runs in the background starts its children with SIGINT ignored, and they pass that
# on; the programs under test would then not see the Ctrl-C that they are tested with.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
