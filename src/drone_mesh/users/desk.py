"""UsersDesk: gives other threads of the process access to a node's data service."""

from __future__ import annotations

import base64
import threading
import time
from collections import deque
from concurrent import futures
from typing import Callable

from drone_mesh.communication.data.outgoing import Ticket, TicketState
from drone_mesh.communication.data.transport import EchoAnswer, ReceivedMessage, Receiver, Transport
from drone_mesh.errors import MessageRefused, QueueFull
from drone_mesh.execution import Submit

HANDOVER_S = 5.0  # a node accepts a message within this time
LONGEST_WAIT_S = 300.0  # a reliable message is given up before
STEP_S = 0.1  # how soon a wait notices that it has to end
MOST_UNREAD = 256  # messages that may wait for a slow listener; the oldest is dropped


def in_json(message: ReceivedMessage) -> dict[str, object]:
    """A message as programs of users read it."""
    fields = message._asdict()
    del fields["received_s"]  # of a clock that other programs do not have
    return {**fields, "payload": base64.b64encode(message.payload).decode()}


def check_wait(seconds: float) -> None:
    """Raise MessageRefused unless a caller may wait for so long."""
    if not 0.0 <= seconds <= LONGEST_WAIT_S:  # NaN neither
        raise MessageRefused(f"invalid wait {seconds:g}: must be 0..{LONGEST_WAIT_S:g} seconds")


class Sending:
    """One message submitted by another thread. The node's thread ends its futures."""

    def __init__(self, to: int, payload: bytes, port: int, reliable: bool) -> None:
        self._arguments = (to, payload, port, reliable)
        self.taken: futures.Future[Ticket] = futures.Future()  # or MessageRefused
        self.over: futures.Future[Ticket] = futures.Future()  # in its final state, or refused

    def ticket(self, within_s: float | None = None) -> Ticket:
        """The ticket; raises MessageRefused with the reason if there is none.

        Blocks for up to `within_s` (HANDOVER_S); raises QueueFull if the node has not taken the
        message by then, and never will.
        """
        try:
            return self.taken.result(HANDOVER_S if within_s is None else within_s)
        except futures.TimeoutError:
            if not self.taken.cancel():
                return self.taken.result(HANDOVER_S)  # it is being taken just now
            reason = "the node is too busy to take a message, or it has stopped; it was not sent"
            raise QueueFull(reason) from None

    def wait(self, seconds: float) -> bool:
        """Whether the message was delivered (without acknowledgement: sent) within `seconds`."""
        ticket = self.ticket()
        if seconds > 0 and not futures.wait([self.over], seconds).done:
            return False
        return ticket.state is not TicketState.GIVEN_UP

    def in_words(self, waited_s: float) -> str:
        """The ticket in words; if the message is still on its way, that too."""
        ticket = self.ticket()
        if waited_s > 0 and not ticket.final:
            return f"{ticket}; not delivered within {waited_s:g} s, the node keeps trying"
        return str(ticket)

    def hand_in(self, transport: Transport, now_s: float) -> None:
        """Pass the message to the node's transport; called on the node's thread."""
        to, payload, port, reliable = self._arguments
        if not self.taken.set_running_or_notify_cancel():
            return
        try:
            ticket = transport.send(to, payload, now_s, port=port, reliable=reliable)
        except MessageRefused as error:
            self.taken.set_exception(error)
            self.over.set_exception(error)
        else:
            ticket.changed = self._changed
            self.taken.set_result(ticket)
            self._changed(ticket)

    def _changed(self, ticket: Ticket) -> None:
        if ticket.final and not self.over.done():
            self.over.set_result(ticket)


class Listener:
    """The messages that arrive from now on, for one other thread."""

    def __init__(self, port: int | None) -> None:
        self._port = port
        self.close: Callable[[], None] = lambda: None  # no more messages
        self._messages: deque[ReceivedMessage] = deque(maxlen=MOST_UNREAD)
        self._arrived = threading.Condition()  # guards the messages
        self.dropped = 0  # messages dropped because they were not read in time

    def next(self, timeout_s: float) -> ReceivedMessage | None:
        """The next message; None if none arrived in time."""
        with self._arrived:
            has_one = self._arrived.wait_for(lambda: len(self._messages) > 0, timeout_s)
            return self._messages.popleft() if has_one else None

    def put(self, message: ReceivedMessage) -> None:
        """Add a message; called on the node's thread."""
        if self._port not in (None, message.port):
            return
        with self._arrived:
            self.dropped += len(self._messages) == MOST_UNREAD
            self._messages.append(message)
            self._arrived.notify()


class UsersDesk:
    """Sends, listens and requests echoes on behalf of other threads. Any thread may use it.

    The functions that it submits run on the node's thread; a lock guards the receivers.
    """

    def __init__(self, node_id: int, submit: Submit) -> None:
        """A desk that is closed until `open` is called with the node's transport."""
        self.node_id = node_id
        self._submit = submit
        self._transport: Transport | None = None
        self._lock = threading.Lock()
        self._receivers: list[Receiver] = []

    def open(self, transport: Transport) -> None:
        """Start serving; before the node starts, or on its thread."""
        self._transport = transport
        transport.on_received(self._received)

    def send(self, to: int, payload: bytes, port: int = 0, reliable: bool = True) -> Sending:
        """Submit a message to the node. The result reports a refusal."""
        sending = Sending(to, payload, port, reliable)
        transport = self._require()
        self._submit(lambda now_s: sending.hand_in(transport, now_s))
        return sending

    def subscribe(self, receiver: Receiver) -> Callable[[], None]:
        """Call `receiver` on the node's thread for each message; returns a function to end it."""
        with self._lock:
            self._receivers.append(receiver)

        def end() -> None:
            with self._lock:
                if receiver in self._receivers:
                    self._receivers.remove(receiver)

        return end

    def listen(self, port: int | None = None) -> Listener:
        """Receive the messages for one port, or for all; close the result."""
        listener = Listener(port)
        listener.close = self.subscribe(listener.put)
        return listener

    def echo(
        self, to: int, timeout_s: float, stopping: Callable[[], bool] = lambda: False
    ) -> EchoAnswer | None:
        """Request an echo and wait for it, or for `stopping`; None: no answer.

        Raises MessageRefused if there is no route to it, or if a key is the likely reason that no
        answer came.
        """
        check_wait(timeout_s)
        transport = self._require()
        answer: futures.Future[EchoAnswer] = futures.Future()
        hint = ""

        def ask(now_s: float) -> None:
            nonlocal hint
            hint = transport.hint()
            try:
                if transport.echo(to, answer.set_result, now_s) is None:
                    raise MessageRefused(transport.unreachable(to))
            except MessageRefused as error:
                answer.set_exception(error)

        self._submit(ask)
        until_s = time.monotonic() + timeout_s
        while not (answer.done() or stopping()):
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                break
            futures.wait([answer], min(left_s, STEP_S))
        if answer.done():
            return answer.result()
        if hint:
            raise MessageRefused(f"no answer within {timeout_s:g} s{hint}")
        return None

    def _require(self) -> Transport:
        if self._transport is None:
            raise MessageRefused(f"node {self.node_id} has not started yet")
        return self._transport

    def _received(self, message: ReceivedMessage) -> None:
        with self._lock:
            receivers = list(self._receivers)
        for receiver in receivers:
            receiver(message)
