"""PacketRadio: what a half-duplex packet radio must be able to do to stand under a mesh."""

from __future__ import annotations

from typing import Callable, Protocol

from drone_mesh.channel.medium_access import MediumAccess


class PacketRadio(Protocol):
    """One radio that sends to a node with acknowledgement, and to all without.

    One thread at a time sends. While it sends it hears nothing. A failing radio raises nothing: its
    sends fail until it works again.
    """

    node_id: int
    access: MediumAccess  # when this radio may send

    def try_once(
        self,
        node_id: int,
        payload: bytes,
        again: bool,
        retransmits: int,
        delay: int,
        following: Callable[[], bytes | None],
    ) -> bool:
        """Try once to send a packet to a node, and wait; True: the node acknowledged it.

        `again`: an earlier try failed. `retransmits`, `delay`: as `access.retransmits` returned
        them. After an acknowledgement, `following` may return another packet for the same node,
        which is sent at once, and so on; the result is then that of the last packet.
        """

    def drop(self) -> None:
        """Give up the packet that was tried last."""

    def broadcast(self, payload: bytes) -> bool:
        """Send to every node in range, without acknowledgement; True: it was sent."""
