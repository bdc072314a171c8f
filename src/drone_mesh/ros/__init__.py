"""The ROS side: nodes, hosts, services and views. No other package imports it."""

import contextlib
import sys

# genpy loads numpy, where there is one, only to name its types in errors about fields: that is most
# of its time, for which each program and each of its processes would wait.
if "numpy" not in sys.modules:
    sys.modules["numpy"] = None  # type: ignore[assignment]
    with contextlib.suppress(ImportError):  # without ROS some modules serve all the same
        import genpy.message  # noqa: F401
    del sys.modules["numpy"]
