"""The ROS side: nodes, hosts, services and views. No other package imports it."""

import contextlib
import sys

# genpy loads numpy, where there is one, only to know its types when it explains what is wrong with
# a message: 0.08 s of each program's start.
if "numpy" not in sys.modules:
    sys.modules["numpy"] = None  # type: ignore[assignment]
    with contextlib.suppress(ImportError):  # without ROS some modules serve all the same
        import genpy  # noqa: F401
    del sys.modules["numpy"]
