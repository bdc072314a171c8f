"""CommonFrame: whether another node uses the same coordinate frame as this one.

Drones whose coordinates have different origins must not fly to each other's places. Each node's
PRESENT carries a digest of its origin; a place is accepted only from a neighbour with the same
digest. Every node does this, so no place crosses the border between two frames, over any number of
hops.
"""

from __future__ import annotations

NO_FRAME = 0  # the digest of a node without an origin, or without support for origins


class CommonFrame:
    """The frames of the neighbours. Belongs to the component's thread."""

    def __init__(self, digest: int) -> None:
        """`digest` is this node's own."""
        self.digest = digest
        self._digests: dict[int, int] = {}  # neighbour -> its digest

    def heard(self, neighbour: int, digest: int) -> bool:
        """Record a neighbour's digest; returns whether its frame is this node's."""
        self._digests[neighbour] = digest
        return digest == self.digest

    def refuses(self, from_: int) -> bool:
        """Whether places from this neighbour may refer to another frame.

        A node with an origin waits for a neighbour's PRESENT; a node without one assumes that a
        neighbour that has not introduced itself has no origin either.
        """
        return self._digests.get(from_, NO_FRAME) != self.digest

    def is_foreign(self, from_: int) -> bool:
        """Whether this neighbour has introduced itself with another frame."""
        return from_ in self._digests and self.refuses(from_)
