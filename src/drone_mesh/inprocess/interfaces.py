"""What a radio of the in-process network must offer: an air, and an antenna for each node."""

from __future__ import annotations

import abc
import random
from typing import Callable, Iterable, Mapping, Protocol

from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.inprocess.clock import Clock


class Host(Protocol):
    """The node in which an antenna is installed."""

    @property
    def node_id(self) -> int: ...

    @property
    def drone(self) -> IDroneEngine: ...

    def hear(self, payload: bytes) -> None:
        """Hand a packet to the mesh software of the node now."""

    def submit(self, work: Callable[[float], None]) -> None:
        """Run `work(now_s)` in the mesh software of the node now."""


class IInProcessAntenna(IWirelessCommunication):
    """The antenna of one node of the network."""

    powered: bool

    @abc.abstractmethod
    def switch_power(self, on: bool) -> None:
        """Power on or off, and inform the mesh software."""

    def on(self) -> bool:
        """Whether it has power."""
        return self.powered


class IInProcessAir:
    """A medium with its clock; pass one to Network as its radio.

    Experiments ask which one it is. It is no `abc.ABC`, as mypyc gives a hierarchy of those one
    cache of such answers: what was asked first would hold for all.
    """

    clock: Clock
    max_distance_m: float  # the range, for pictures and path searches
    on_packet: Callable[[bytes], object] = len
    """Called with each packet that a mesh hands to its antenna, except on the disc, which has
    `carries`; set by experiments."""
    hears: Callable[[int, int], bool] | None = None
    """Whether the second node hears the first one, if they are in range; None: every link works
    both ways. Packets on the disc follow it, those on other airs their link model. Set by
    experiments."""

    @property
    @abc.abstractmethod
    def delivered(self) -> int:
        """The number of packets so far that reached a node."""

    @abc.abstractmethod
    def antenna(self, host: Host, rng: random.Random) -> IInProcessAntenna:
        """A new antenna for that node."""

    @abc.abstractmethod
    def in_range(self, node: int) -> Mapping[int, IInProcessAntenna]:
        """By id: the antennas that `node` could reach if they were on."""

    @abc.abstractmethod
    def flight(self, node: int, started: bool) -> None:
        """A drone took off (True) or stopped (False)."""

    @abc.abstractmethod
    def moved(self, nodes: Iterable[int]) -> None:
        """Pilots have flown these drones to other places."""

    def run(self, function: Callable[[], None]) -> None:
        """Run a function that starts or stops antennas, at once or where it may wait."""
        function()

    def stop(self) -> None:  # noqa: B027 - most airs hold nothing
        """Wait until all nodes have stopped."""
