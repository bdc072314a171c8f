"""RelayedWay: how one outbox shares the channel with the relays on its way.

It sends trains instead of single packets (see Train). Without relays on the same channel there is
no train.
"""

from __future__ import annotations

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.fragmentation import MOST_OPEN
from drone_mesh.communication.data.round_trip import FIRST_TIMEOUT_S, RoundTrip
from drone_mesh.communication.data.train import Train

MOST_IN_TURN = 6  # our choice: with 12, turns are long and few


class RelayedWay:
    """The train that is under way, if there are relays."""

    def __init__(self, round_trip: RoundTrip) -> None:
        """`round_trip`: of the outbox; answers to trains are measured in it."""
        self.train: Train | None = None
        self._round_trip = round_trip

    def set_relayed(self, relayed: bool) -> None:
        """Set whether there are relays on the same channel."""
        if not relayed:
            self.train = None
        elif self.train is None:
            self.train = Train()

    def begin_again(self) -> None:
        """Its messages were taken away."""
        self.train = None

    @property
    def is_open(self) -> bool:
        """Whether relays wait for more of a train."""
        return self.train is not None and self.train.is_open

    @property
    def most_messages(self) -> int:
        """How many messages may be on their way at once: few if answers wait for others' turns."""
        takes_turns = self.train is not None and self._round_trip.mean_s > FIRST_TIMEOUT_S
        return MOST_IN_TURN if takes_turns else MOST_OPEN

    def waits_until_s(self, train: Train) -> float:
        """When to ask again for the answer that a train waits for."""
        return train.asked_s + self._round_trip.timeout_s(max(0, train.asks - 1))

    def interrupted(self) -> None:
        """Nothing follows for now, so relays need not wait."""
        if self.train is not None:
            self.train.is_open = False

    def fragment_left(self, kind: int) -> None:
        """A fragment was sent."""
        if self.train is not None:
            self.train.left += 1
            self.train.is_open |= kind != packets.FRAGMENTS.start

    def end_left(self, nonce: int, now_s: float) -> None:
        """The POLL that ends a train was sent."""
        train = self.train
        assert train is not None
        train.is_open = False
        if nonce != packets.NO_ANSWER:
            train.asked(nonce, now_s)

    def answered(self, nonce: int, arrived: bool, now_s: float) -> bool:
        """An answer came; `arrived`: nothing is known to be missing. True: it ends a train."""
        train = self.train
        if train is None:
            return False
        ends = train.waits and nonce == train.nonce
        if ends:
            self._round_trip.measured(now_s - train.asked_s)
        if ends or (arrived and not train.waits):
            train.end(arrived)
        return ends

    def measures(self, nonce: int) -> bool:
        """Whether an answer with this nonce is to the train, which measures itself."""
        return self.train is not None and nonce == self.train.nonce != 0
