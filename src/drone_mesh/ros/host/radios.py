"""Radios: the two ways to give the nodes of a host antennas and workers."""

from __future__ import annotations

from typing import Protocol

from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.execution import ExecutorSlot
from drone_mesh.ros.host.simulator_link import SimulatorLink
from drone_mesh.ros.host.virtual_nrf24 import VirtualNRF24


class Radios(Protocol):
    """Antennas of all nodes of a host. Any thread may call every function."""

    own_threads: bool
    """Whether antennas have threads of their own, which end only when their node stops."""

    @property
    def ready(self) -> bool:
        """Whether packets can be sent."""

    @property
    def never_handed_over(self) -> int:
        """Packets, since the start, that the simulated air never accepted."""

    @property
    def under_way(self) -> int:
        """Packets handed over minus packets processed; 0 if these radios do not wait."""

    def figures(self) -> dict[str, float]:
        """Figures of the channel that all nodes share; empty if they do not share one."""

    def start(self) -> None:
        """Start connecting; does not wait for the connection."""

    def slot(self) -> ExecutorSlot:
        """A slot for one more node."""

    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node that runs in `slot`."""

    def remove(self, node_id: int) -> None:
        """The antenna of this node has stopped for good."""

    def time_advanced(self) -> None:
        """The clock has advanced."""

    def fall_silent(self) -> None:
        """From now on every send fails at once."""

    def close(self) -> None:
        """Stop all workers and threads; returns when they have ended."""


class VirtualRadios(SimulatorLink):
    """An ideal disc, in the process of the WirelessSignalSimulator; all nodes share one worker."""

    own_threads = False

    def figures(self) -> dict[str, float]:
        """Empty: on an ideal disc packets do not collide."""
        return {}

    def slot(self) -> ExecutorSlot:
        """A slot in the executor of the host."""
        return self.executor.slot()

    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node."""
        return VirtualNRF24(node_id, self, slot)

    def remove(self, node_id: int) -> None:
        """Does nothing: the antenna has already left the link."""

    def time_advanced(self) -> None:
        """Does nothing: the host advances its executor itself."""

    def fall_silent(self) -> None:
        """Stop looking for a simulator; sends to a connected one stay quick."""
        self.stop()

    def close(self) -> None:
        """Does nothing: there is nothing left to close."""
