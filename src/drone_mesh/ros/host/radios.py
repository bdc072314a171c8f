"""Radios: how the nodes of a host get their antennas."""

from __future__ import annotations

import abc

from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.execution import ExecutorSlot


class Radios(abc.ABC):
    """Antennas of all nodes of a host. Any thread may call every function."""

    in_wall_time = False
    """Whether they run in wall time, in threads of their own, which end only when a node stops."""

    never_handed_over = 0
    """Packets, since the start, that the simulated air never accepted."""

    under_way = 0
    """Packets handed over minus packets processed; 0 if the world does not wait for these."""

    @property
    def ready(self) -> bool:
        """Whether packets can be sent."""
        return True

    def figures(self) -> dict[str, float]:
        """Figures of the channel that all nodes share; empty if they do not share one."""
        return {}

    @abc.abstractmethod
    def start(self) -> None:
        """Start connecting; does not wait for the connection."""

    @abc.abstractmethod
    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node that runs in `slot`."""

    def remove(self, node_id: int) -> None:  # noqa: B027 - most have nothing left of it
        """The antenna of this node has stopped for good."""

    @abc.abstractmethod
    def fall_silent(self) -> None:
        """From now on no send blocks: each fails at once, or stays quick."""

    def close(self) -> None:  # noqa: B027 - most have ended when they are silent
        """Stop all threads; returns when they have ended."""
