import pytest
from chip_lab import Lab


@pytest.fixture
def lab():
    return Lab()
