"""Radios: the two ways in which the nodes of a host can be given antennas and workers."""

from __future__ import annotations

from typing import Protocol

from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.execution import ExecutorSlot, MeshExecutor
from drone_mesh.ros.host.simulator_link import SimulatorLink
from drone_mesh.ros.host.virtual_nrf24 import VirtualNRF24


class Radios(Protocol):
    """Antennas of all nodes of a host. Any thread may call every function."""

    own_threads: bool
    """Whether antennas have threads of their own, which only stopping their node ends."""

    @property
    def ready(self) -> bool:
        """Whether packets can be sent."""

    @property
    def never_handed_over(self) -> int:
        """Packets, since the start, that the simulated air never received."""

    @property
    def under_way(self) -> int:
        """Packets that were handed over, less those worked off; 0 if these radios do not wait."""

    def figures(self) -> dict[str, float]:
        """Of the channel that all nodes share, for people; empty if they do not share one."""

    def start(self) -> None:
        """Get ready; does not wait for it."""

    def slot(self) -> ExecutorSlot:
        """A place for one more node to be driven in."""

    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node, which is driven in `slot`."""

    def remove(self, node_id: int) -> None:
        """The antenna of this node has stopped for good."""

    def time_advanced(self) -> None:
        """The clock was moved."""

    def fall_silent(self) -> None:
        """Make every send fail at once from now on."""

    def close(self) -> None:
        """Stop all workers and threads; returns when they have ended."""


class VirtualRadios:
    """An ideal disc, in the process of the WirelessSignalSimulator; all nodes share one worker."""

    own_threads = False

    def __init__(self, executor: MeshExecutor) -> None:
        self._executor = executor
        self._link = SimulatorLink(executor)

    @property
    def ready(self) -> bool:
        """Whether there is a simulator."""
        return self._link.connected

    @property
    def never_handed_over(self) -> int:
        """Packets, since the start, that no simulator accepted."""
        return self._link.never_handed_over

    @property
    def under_way(self) -> int:
        """See SimulatorLink."""
        return self._link.under_way

    def figures(self) -> dict[str, float]:
        """None: packets do not meet on an ideal disc."""
        return {}

    def start(self) -> None:
        """Look for a simulator from now on."""
        self._link.start()

    def slot(self) -> ExecutorSlot:
        """A place in the executor of the host."""
        return self._executor.slot()

    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node."""
        return VirtualNRF24(node_id, self._link, slot)

    def remove(self, node_id: int) -> None:
        """Nothing to do: the antenna has left the link."""

    def time_advanced(self) -> None:
        """Nothing to do: the host moves its executor itself."""

    def fall_silent(self) -> None:
        """Look for no simulator any more. A send does not take long."""
        self._link.stop()

    def close(self) -> None:
        """Nothing is left to close."""
