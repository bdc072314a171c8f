"""Quiet nodes: a thousand runs would log each warning of the nodes a thousand times."""

from __future__ import annotations

import contextlib
import logging
from typing import Iterator


@contextlib.contextmanager
def quiet_nodes() -> Iterator[None]:
    """Only critical messages of the package are logged; the level comes back at the end."""
    logger = logging.getLogger("drone_mesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
