"""How fast an outbox sends: a window (RFC 5681) and a timeout (RFC 6298) as in TCP, or trains."""

from __future__ import annotations

import math

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import MOST_OPEN

FIRST_SIZE = 32  # less than a message of 1,024 bytes
LEAST_SIZE = 4
MOST_SIZE = 256  # six messages of 1,024 bytes
FIRST_TIMEOUT_S = 1.0  # RFC 6298, 2.1
# Over relays on a shared channel, as in CoAP (RFC 7252, 4.8: 2 to 3 s). After a burst of messages
# an answer takes longer than a second; if each asked then, the questions would fill the channel.
FIRST_RELAYED_S = 3.0
LEAST_TIMEOUT_S = 0.3  # above the half second of circulation after one doubling
MOST_TIMEOUT_S = 30.0  # three check periods; with less, POLLs alone fill a channel


class CongestionWindow:
    """How many fragments may be under way to one destination without an acknowledgement.

    Slow start and halving after a loss, counted in fragments.
    """

    def __init__(self) -> None:
        self.size = float(FIRST_SIZE)
        self._slow_start = True

    def grow(self, arrived: int) -> None:
        """This many fragments have arrived."""
        self.size += arrived if self._slow_start else arrived / self.size * 4
        self.size = min(self.size, float(MOST_SIZE))

    def on_loss(self) -> None:
        """Fragments are missing."""
        self._slow_start = False
        self.size = max(float(LEAST_SIZE), self.size / 2)

    def on_silence(self) -> None:
        """Shrink the window, as no answer came."""
        self.size, self._slow_start = float(LEAST_SIZE), True


class RoundTrip:
    """The timeout for one destination, estimated from its answers."""

    def __init__(self) -> None:
        self.first_s = FIRST_TIMEOUT_S  # before the first answer
        self.mean_s: float | None = None  # of the answers so far
        self._deviation_s = 0.0

    def measured(self, seconds: float) -> None:
        """An answer arrived after `seconds`, to a question that was sent only once."""
        if self.mean_s is None:
            self.mean_s, self._deviation_s = seconds, seconds / 2
            return
        self._deviation_s += (abs(seconds - self.mean_s) - self._deviation_s) / 4
        self.mean_s += (seconds - self.mean_s) / 8

    def timeout_s(self, unanswered: int) -> float:
        """How long to wait for an answer, given the number of unanswered questions."""
        timeout_s = self.first_s
        if self.mean_s is not None:
            timeout_s = max(LEAST_TIMEOUT_S, self.mean_s + 4 * self._deviation_s)
        return min(MOST_TIMEOUT_S, timeout_s * 2.0 ** min(unanswered, 8))


FIRST_LENGTH = 32  # in fragments
LEAST_LENGTH = 8
MOST_LENGTH = 80  # two messages of 1,024 bytes; a relay forwards it in one piece
MOST_IN_TURN = 6  # with 12, turns are long and few


class Train:
    """The packets of one outbox since its receiver's last answer, on a shared channel.

    A relay cannot receive while it sends, and a sender hears only the first relay, so packets sent
    while earlier ones are under way collide with them. Therefore packets are sent in trains that
    end with a POLL, and the next train follows the answer. If a train loses packets or remains
    without an answer, the next ones are shorter.
    """

    def __init__(self, round_trip: RoundTrip) -> None:
        """`round_trip`: of the outbox; answers to trains are measured in it."""
        self._round_trip = round_trip
        self.length = FIRST_LENGTH
        self.left = 0  # fragments that left
        self.is_open = False  # relays wait for more of it
        self.nonce = 0  # of its latest POLL; 0: none
        self._asks = 0  # POLLs without an answer
        self._asked_s = math.inf

    @property
    def is_full(self) -> bool:
        """Whether to send a POLL next."""
        return self.left >= self.length

    @property
    def waits(self) -> bool:
        """Whether the next train waits for an answer."""
        return self._asks > 0

    @property
    def waits_until_s(self) -> float:
        """When to ask again for the answer that the next train waits for."""
        return self._asked_s + self._round_trip.timeout_s(max(0, self._asks - 1))

    @property
    def most_messages(self) -> int:
        """How many messages may be on their way at once: few if answers wait for others' turns."""
        is_slow = (self._round_trip.mean_s or 0.0) > FIRST_TIMEOUT_S
        return MOST_IN_TURN if is_slow else MOST_OPEN

    def fragment_left(self, kind: int) -> None:
        self.left += 1
        self.is_open |= kind != packets.FRAGMENTS.start

    def end_left(self, nonce: int, now_s: float) -> None:
        """The POLL that ends it was sent."""
        self.is_open = False
        if nonce != packets.NO_ANSWER:
            self.nonce, self._asked_s = nonce, now_s
            self._asks += 1

    def answered(self, nonce: int, arrived: bool, now_s: float) -> bool:
        """An answer came; `arrived`: nothing is known to be missing. True: it ends the train."""
        ends = self.waits and nonce == self.nonce
        if ends:
            self._round_trip.measured(now_s - self._asked_s)
        if ends or (arrived and not self.waits):
            self.end(arrived)
        return ends

    def end(self, arrived: bool) -> None:
        """The train is over; `arrived`: nothing of it is known to be missing."""
        if not arrived:
            self.length = max(LEAST_LENGTH, self.length // 2)
        elif self.is_full:
            self.length = min(MOST_LENGTH, 2 * self.length)
        self.left = self.nonce = self._asks = 0
        self._asked_s = math.inf
