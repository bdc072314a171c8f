"""Tickets: the progress of submitted messages."""

from __future__ import annotations

import enum
from typing import Callable

from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE

TO_ALL = BROADCAST  # destination: every node of the mesh, best effort
TO_GATEWAY = NO_ROUTE  # destination: the sender's current gateway


class TicketState(enum.Enum):
    """The progress of a message."""

    QUEUED = "queued"  # waiting, completely or in part
    SENT = "sent"  # completely sent; final for an unreliable message
    DELIVERED = "delivered"  # its receiver has it; final
    GIVEN_UP = "given up"  # `reason` says why; final


class Ticket:
    """One message under way. Any thread may read it; the component's thread changes it."""

    __slots__ = ("changed", "number", "port", "reason", "reliable", "size", "state", "to")

    def __init__(self, number: int, to: int, port: int, size: int, reliable: bool) -> None:
        self.number = number  # counts the messages of this node, from 1
        self.to = to  # as requested: a node, TO_ALL or TO_GATEWAY
        self.port = port
        self.size = size  # bytes
        self.reliable = reliable
        self.state = TicketState.QUEUED
        self.reason = ""  # why it was given up, or what it waits for
        # Called with the ticket when its state changes, in the component's thread; it must not
        # call back into the component.
        self.changed: Callable[[Ticket], None] | None = None

    def set_state(self, state: TicketState, reason: str = "") -> None:
        """Change the state."""
        if state is not self.state:
            self.state, self.reason = state, reason
            if self.changed is not None:
                self.changed(self)

    @property
    def final(self) -> bool:
        """Whether the state is final."""
        if self.state is TicketState.SENT:
            return not self.reliable
        return self.state in (TicketState.DELIVERED, TicketState.GIVEN_UP)

    def __str__(self) -> str:
        words = f"message {self.number} to {destination_in_words(self.to)}: {self.state.value}"
        return f"{words}: {self.reason}" if self.reason else words


def destination_in_words(to: int) -> str:
    """A destination as text."""
    return {TO_ALL: "all nodes", TO_GATEWAY: "the gateway"}.get(to, f"node {to}")
