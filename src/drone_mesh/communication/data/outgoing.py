"""One message of an outbox, and the state of its fragments."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from drone_mesh.communication.data.packets import Head
from drone_mesh.communication.data.ticket import Ticket

LIFETIME_S = 240.0  # a repair takes up to two minutes and a flight


class DataPacket(NamedTuple):
    """A packet to send, without its header."""

    kind: int
    body: bytes
    message: OutgoingMessage
    ends_train: bool = False


class OutgoingMessage:
    """One message under way."""

    __slots__ = (
        "asked_s", "asks", "expires_s", "head", "known", "left_s", "nonce", "payload", "sealed",
        "sent", "ticket", "to_send", "whole",
    )  # fmt: skip

    def __init__(self, ticket: Ticket, payload: bytes, now_s: float) -> None:
        self.ticket = ticket
        self.payload = payload
        self.sealed = b""  # the bytes to send, once it is under way
        self.expires_s = now_s + LIFETIME_S
        self.left_s = math.inf  # when its last fragment left
        self.begin()

    def begin(self) -> None:
        """Reset the message, as if nothing of it had been sent."""
        self.head: Head | None = None  # once it is under way
        self.to_send: deque[int] = deque()  # indices of fragments
        self.whole = False  # whether each fragment has left at least once
        self.sent = 0  # fragments that left, as bits
        self.known = 0  # fragments that the receiver has, as bits
        self.asked_s = math.inf  # since when an answer is awaited
        self.asks = 0  # questions without an answer
        self.nonce = 0  # of the latest POLL; 0: none

    @property
    def in_flight(self) -> int:
        """Fragments that were sent, with unknown outcome."""
        return bin(self.sent & ~self.known).count("1")
