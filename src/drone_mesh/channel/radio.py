"""PacketRadio: what a half-duplex packet radio must be able to do to stand under a mesh."""

from __future__ import annotations

from typing import Callable, NamedTuple, Protocol, Sequence

from drone_mesh.channel.medium_access import MediumAccess
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.timing import Medium


class Received(Protocol):
    """A payload from the air."""

    @property
    def payload(self) -> bytes:
        """The bytes that were sent."""

    @property
    def to_all(self) -> bool:
        """Whether it was broadcast."""


class Try(NamedTuple):
    """The outcome of one try to send a packet to a node."""

    acknowledged: bool
    frames: int  # sent for it, those included that the radio repeated by itself


class PacketRadio(Protocol):
    """One radio that sends to a node with acknowledgement, and to all without.

    One thread sends and one calls `receive`, at the same time. While it sends it hears nothing.
    Once it has begun, a failing radio raises nothing: sends fail until it works again.
    """

    node_id: int
    access: MediumAccess  # when this radio may send
    working: bool  # whether it answered when it was last used; read from any thread

    @property
    def medium(self) -> Medium:
        """The properties of its channel. Constant."""

    def begin(self) -> None:
        """Set it up and listen. Raises a MeshError that names the remedy if it does not work."""

    def power_down(self) -> None:
        """Neither send nor receive until `begin`."""

    def close(self) -> None:
        """Power down and release the hardware."""

    def try_once(
        self,
        node_id: int,
        payload: bytes,
        again: bool,
        retransmits: int,
        delay: int,
        following: Callable[[int], bytes | None],
    ) -> Try:
        """Try once to send a packet to a node, and wait.

        `again`: an earlier try failed. `retransmits`, `delay`: as `access.retransmits` returned
        them. After an acknowledgement, `following` gets the number of frames that it took, and may
        return another packet for the same node, which is sent at once, and so on; the result is
        then that of the last packet.
        """

    def drop(self) -> None:
        """Give up the packet that was tried last."""

    def broadcast(self, payload: bytes) -> bool:
        """Send to every node in range, without acknowledgement; True: it was sent."""

    def receive(self, timeout_s: float) -> Sequence[Received]:
        """The payloads that have arrived, oldest first; waits up to `timeout_s` for one."""

    def hears_power(self) -> bool | None:
        """Whether there is power in its channel now, of whatever sender; None: it cannot tell."""

    def statistics(self) -> RadioStatistics:
        """The current counters."""
