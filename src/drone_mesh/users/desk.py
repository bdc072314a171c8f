"""UsersDesk: gives other threads of the process access to a node's data service."""

from __future__ import annotations

import base64
import queue
import threading
from typing import Callable, Optional

from drone_mesh.communication.data.echo import EchoAnswer
from drone_mesh.communication.data.ticket import Ticket, TicketState
from drone_mesh.communication.data.transport import ReceivedMessage, Receiver, Transport
from drone_mesh.errors import MessageRefused

HANDOVER_S = 5.0  # our choice: a node accepts a message within this time
LONGEST_WAIT_S = 300.0  # our choice: a reliable message is given up before
MOST_UNREAD = 256  # messages that may wait for a slow listener; the oldest is dropped

Submit = Callable[[Callable[[float], None]], None]
"""Runs a function, with the time, on the thread that owns the node. Any thread may call it."""


def in_json(message: ReceivedMessage) -> dict[str, object]:
    """A message as programs of users read it."""
    fields = message._asdict()
    del fields["received_s"]  # of a clock that other programs do not have
    return {**fields, "payload": base64.b64encode(message.payload).decode()}


WhenOver = Callable[[Optional[Ticket], Optional[MessageRefused]], None]


def check_wait(seconds: float) -> None:
    """Raise MessageRefused unless a caller may wait for so long."""
    if not 0.0 <= seconds <= LONGEST_WAIT_S:  # NaN neither
        raise MessageRefused(f"invalid wait {seconds:g}: must be 0..{LONGEST_WAIT_S:g} seconds")


class Sending:
    """One message submitted by another thread. The node's thread sets its fields."""

    def __init__(self, to: int, payload: bytes, port: int, reliable: bool) -> None:
        self._arguments = (to, payload, port, reliable)
        self._handed_in = threading.Event()
        self._ended = threading.Event()
        self._ticket: Ticket | None = None
        self._refusal: MessageRefused | None = None
        self._lock = threading.Lock()
        self._when_over: WhenOver | None = None

    def ticket(self) -> Ticket:
        """The ticket; raises MessageRefused with the reason if there is none."""
        if not self._handed_in.wait(HANDOVER_S):
            raise MessageRefused("the node is too busy to take a message, or it has stopped")
        if self._refusal is not None:
            raise self._refusal
        assert self._ticket is not None
        return self._ticket

    def wait(self, seconds: float) -> bool:
        """Whether the message was delivered (without acknowledgement: sent) within `seconds`."""
        ticket = self.ticket()
        if seconds > 0 and not self._ended.wait(seconds):
            return False
        return ticket.state is not TicketState.GIVEN_UP

    def in_words(self, waited_s: float) -> str:
        """The ticket in words; if the message is still on its way, that too."""
        ticket = self.ticket()
        if waited_s > 0 and not ticket.final:
            return f"{ticket}; not delivered within {waited_s:g} s, the node keeps trying"
        return str(ticket)

    @property
    def is_taken(self) -> bool:
        """Whether the node has accepted or refused it."""
        return self._handed_in.is_set()

    @property
    def is_over(self) -> bool:
        """Whether the message was refused or has its final state."""
        return self._ended.is_set() or (self._handed_in.is_set() and self._ticket is None)

    def when_over(self, call: WhenOver) -> None:
        """Call `call` with the ticket or refusal once it is over; on this or the node's thread."""
        self._when_over = call
        self._call_when_over()

    def hand_in(self, transport: Transport, now_s: float) -> None:
        """Pass the message to the node's transport; called on the node's thread."""
        to, payload, port, reliable = self._arguments
        try:
            ticket = transport.send(to, payload, now_s, port=port, reliable=reliable)
        except MessageRefused as error:
            self._refusal = error
        else:
            ticket.changed = self._changed
            self._ticket = ticket
            self._changed(ticket)
        self._handed_in.set()
        self._call_when_over()

    def _changed(self, ticket: Ticket) -> None:
        if ticket.final:
            self._ended.set()
            self._call_when_over()

    def _call_when_over(self) -> None:
        """Call the function of `when_over` once it is set and the sending is over."""
        with self._lock:
            call = self._when_over if self._handed_in.is_set() and self.is_over else None
            if call is not None:
                self._when_over = None
        if call is not None:
            call(self._ticket, self._refusal)


class Listener:
    """The messages that arrive from now on, for one other thread."""

    def __init__(self, port: int | None) -> None:
        self._port = port
        self.close: Callable[[], None] = lambda: None  # no more messages
        self._messages: queue.Queue[ReceivedMessage] = queue.Queue(MOST_UNREAD)
        self.dropped = 0  # messages dropped because they were not read in time

    def next(self, timeout_s: float) -> ReceivedMessage | None:
        """The next message; None if none arrived in time."""
        try:
            return self._messages.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def put(self, message: ReceivedMessage) -> None:
        """Add a message; called on the node's thread."""
        if self._port not in (None, message.port):
            return
        while True:
            try:
                self._messages.put_nowait(message)
                return
            except queue.Full:
                self.dropped += 1
                try:
                    self._messages.get_nowait()
                except queue.Empty:
                    continue


class UsersDesk:
    """Sends, listens and requests echoes on behalf of other threads. Any thread may use it.

    The functions that it submits run on the node's thread; a lock guards the receivers.
    """

    def __init__(self, node_id: int, submit: Submit) -> None:
        """It serves nothing until `open` is called with the node's transport."""
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

    def echo(self, to: int, timeout_s: float) -> EchoAnswer | None:
        """Request an echo and wait for it; None: no answer.

        Raises MessageRefused if there is no route to it, or if a key is the likely reason that no
        answer came.
        """
        transport = self._require()
        answers: queue.Queue[EchoAnswer | str] = queue.Queue()
        hint = ""

        def ask(now_s: float) -> None:
            nonlocal hint
            hint = transport.hint()
            try:
                if transport.echo(to, answers.put, now_s) is None:
                    answers.put(transport.unreachable(to))
            except MessageRefused as error:
                answers.put(str(error))

        self._submit(ask)
        try:
            answer = answers.get(timeout=timeout_s)
        except queue.Empty:
            if hint:
                raise MessageRefused(f"no answer within {timeout_s:g} s{hint}") from None
            return None
        if isinstance(answer, str):
            raise MessageRefused(answer)
        return answer

    def _require(self) -> Transport:
        if self._transport is None:
            raise MessageRefused(f"node {self.node_id} has not started yet")
        return self._transport

    def _received(self, message: ReceivedMessage) -> None:
        with self._lock:
            receivers = list(self._receivers)
        for receiver in receivers:
            receiver(message)
