"""Echoes: the round-trip time of a packet to a node, and the nodes that it passes."""

from __future__ import annotations

from typing import Callable, NamedTuple

from drone_mesh.communication.data import packets

MOST_AWAITED = 64  # answers; the oldest is given up
SendPacket = Callable[[int, int, bytes], bool]
"""Sends a packet with a type and a body to a node; False: it could not be sent."""


class EchoAnswer(NamedTuple):
    """The answer to an echo."""

    node: int  # the node that answered
    token: int  # of the echo
    round_trip_s: float
    route: tuple[int, ...]  # the nodes that forwarded the echo, in order

    @property
    def hops(self) -> int:
        """Links to that node."""
        return len(self.route) + 1


OnEchoAnswer = Callable[[EchoAnswer], None]
"""Called in the component's thread; must not call back into the component."""


class Echoes:
    """Sends echoes, answers those of others, and reports each answer to its caller."""

    def __init__(self, send: SendPacket, room: int) -> None:
        """`room`: bytes of a body."""
        self._send = send
        self._room = room
        self._token = 0
        self._awaited: dict[int, tuple[int, float, OnEchoAnswer]] = {}

    def send(self, to: int, on_answer: OnEchoAnswer, now_s: float) -> int | None:
        """Send an echo to a node; returns its token, or None if there is no route."""
        token = self._token = (self._token + 1) & 0xFFFF
        while len(self._awaited) >= MOST_AWAITED:
            del self._awaited[next(iter(self._awaited))]
        self._awaited[token] = to, now_s, on_answer
        if self._send(packets.ECHO, to, packets.echo_body(token)):
            return token
        self._awaited.pop(token, None)
        return None

    def asked(self, creator: int, body: bytes) -> None:
        """Answer an echo that arrived."""
        token, route = packets.echo_of(body)
        self._send(packets.ECHO_ANSWER, creator, packets.echo_body(token, route, self._room))

    def answered(self, creator: int, body: bytes, now_s: float) -> None:
        """Process an answer; an unexpected one is ignored."""
        token, route = packets.echo_of(body)
        to, sent_s, on_answer = self._awaited.get(token, (-1, 0.0, None))
        if to == creator and on_answer is not None:
            del self._awaited[token]
            on_answer(EchoAnswer(creator, token, now_s - sent_s, route))
