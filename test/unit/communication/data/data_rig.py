"""An outbox without a mesh, and messages for it."""

from __future__ import annotations

from drone_mesh.communication.data.outbox import Outbox
from drone_mesh.communication.data.outgoing import LIFETIME_S, OutgoingMessage, Ticket

ROOM = 27


def outbox_to_0(session=7, relayed=False):
    """An outbox to node 0, without seals."""
    outbox = Outbox(0, session, ROOM, lambda _state: None, lambda _place, text: text, str)
    outbox.set_relayed(relayed)
    return outbox


def submit(outbox, number, payload=bytes(16), reliable=True, now_s=0.0):
    """Submit a message to port 5; returns its ticket."""
    ticket = Ticket(number, 0, 5, len(payload), reliable)
    outbox.waiting.append(OutgoingMessage(ticket, payload, now_s + LIFETIME_S))
    return ticket
