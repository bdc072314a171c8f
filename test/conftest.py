"""What all tests need of the process that runs them."""

import signal

# A shell that runs in the background starts its children with SIGINT ignored, and they pass that
# on; the programs under test would then not see the Ctrl-C that they are tested with.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
