"""Silences nodes: a thousand runs would log each warning a thousand times."""

from __future__ import annotations

import contextlib
import logging
from typing import Iterator


@contextlib.contextmanager
def quiet_nodes() -> Iterator[None]:
    """Log only critical messages of the package; restore the level at the end."""
    logger = logging.getLogger("drone_mesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
