"""The order of the unit tests."""

import pytest


def pytest_collection_modifyitems(items: "list[pytest.Item]") -> None:
    """Begin with what takes long on its own, or at the end one worker waits for the other."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
