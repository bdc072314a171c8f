"""The order and time limits of the unit tests, and settings of hypothesis for a busy machine."""

import gc
from typing import Iterator

import pytest
from hypothesis import HealthCheck, settings

# The time of one draw or one example depends on the machine's load, so it has no limit.
settings.register_profile(
    "busy machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("busy machine")

# Seconds until a slow test counts as hung: the only limit of the programs that it runs. One
# that computes for 25 s on an idle core takes many times as long beside other work.
SLOW_HANGS_AFTER_S = 600


def pytest_collection_modifyitems(items: "list[pytest.Item]") -> None:
    """Begin with the slow tests; at the end, one worker would have to wait for the other.

    Slow tests get a time limit of their own.
    """
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
    for item in items:
        if item.get_closest_marker("slow") is not None:
            item.add_marker(pytest.mark.timeout(SLOW_HANGS_AFTER_S))


@pytest.hookimpl(hookwrapper=True)
def pytest_collection() -> Iterator[None]:
    """Search for garbage less often, and not at all while tests are collected.

    Whole meshes are made and dropped by the thousand, and each search would look again at all that
    was imported and collected so far: a tenth of all processor time.
    """
    gc.disable()
    yield
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
    gc.enable()
