"""Creates repair strategies by name, for launch arguments."""

from __future__ import annotations

from typing import Callable

from drone_mesh.by_name import create_by_name
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR
from drone_mesh.communication.repair.strategies.field import Field
from drone_mesh.communication.repair.strategies.follow import Follow
from drone_mesh.communication.repair.strategies.home import Home
from drone_mesh.communication.repair.strategies.inward import Inward
from drone_mesh.communication.repair.strategies.nearest import Nearest
from drone_mesh.communication.repair.strategies.stay import Stay
from drone_mesh.communication.repair.strategies.thesis import Thesis

REPAIR_STRATEGIES: dict[str, Callable[[], IRepairStrategy]] = {
    DEFAULT_REPAIR: Thesis,
    "field": Field,
    "follow": Follow,
    "home": Home,
    "inward": Inward,
    "nearest": Nearest,
    "stay": Stay,
}


def create_repair_strategy(chosen: str | Callable[[], IRepairStrategy]) -> IRepairStrategy:
    """A new strategy: a name in REPAIR_STRATEGIES, "package.module:Class" or a class.

    Raises ConfigurationError, with the known names, for anything else.
    """
    return create_by_name("repair strategy", chosen, REPAIR_STRATEGIES, IRepairStrategy)
