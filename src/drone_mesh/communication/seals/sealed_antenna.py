"""SealedAntenna: an antenna of a mesh with a key (docs/security.md).

It stands between an antenna and a mesh component, and has the interface of each for the other.
Neither of them handles seals; the component only puts less into a packet (`reserved_bytes`).
"""

from __future__ import annotations

import random
from collections import defaultdict, deque
from typing import Callable, Sequence

from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    PAYLOAD_BYTES,
    IMeshDebugInfo,
    IMeshNetwork,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.seals.end_to_end import (
    EndToEnd,
    Expired,
    NotProven,
    Replayed,
    reserved_bytes,
)
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.seals.message_seal import MessageSeal
from drone_mesh.communication.seals.seal import (
    LATE_ANSWER_S,
    SEAL_AT,
    SEAL_BYTES,
    HopSeal,
    NotOpened,
)
from drone_mesh.communication.timing import ChannelUse, Medium, MeshTiming
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import CREATOR_AT, FORWARD_AT, TO_AT, TYPE_AT
from drone_mesh.communication.wire.packet_types import MessageType

# A neighbour on this node's way up or down sends something once per check period. A former one, to
# which routes may still lead, is silent for longer: a packet that begins with a handshake is easily
# lost on a shared channel (docs/shared-channel.md).
FRESH_PERIODS = 6.0
FOREIGN_AFTER_S = 20.0  # two check periods; a restarted neighbour answers by then
FORGOTTEN_S = 60.0  # then the counts start again
LEAST_PACKETS = 3  # damage that a checksum does not show is rarer
REPEATED_S, REPEATED = 2.0, 4  # a challenge is pending for as long; packets, at most
LEAST_CHALLENGES = 2  # without an answer: one may be lost

_CHALLENGE, _ANSWER = int(MessageType.SEAL_CHALLENGE), int(MessageType.SEAL_ANSWER)
_PRESENT, _BEACON = int(MessageType.PRESENT), int(MessageType.BEACON)
_ORDER = int(MessageType.MOVE_TO_LOCATION)
_NO_SEAL = bytes(SEAL_BYTES)


class SealedAntenna(IWirelessCommunication, IMeshSeals, IMeshNetwork):
    """Seals what the component sends, and hands it only what is authentic.

    All calls come from the thread of the component, as for every antenna; `on` and `channel_use`
    may be called by any other.
    """

    has_key = True

    def __init__(
        self,
        antenna: IWirelessCommunication,
        node_id: int,
        keys: Keys,
        rng: random.Random,
        clock: Callable[[], float],
        timing: MeshTiming | None = None,
    ) -> None:
        """`rng` draws epochs and nonces: random.SystemRandom, except in simulations.

        `clock` gives the time of the component, in seconds.
        """
        self._antenna = antenna
        self._node_id = node_id
        fresh_s = FRESH_PERIODS * (timing or MeshTiming()).check_period_s
        self._seal = HopSeal(node_id, keys, rng, fresh_s)
        self._end_to_end = EndToEnd(node_id, keys, rng)
        self._message_seal = MessageSeal(keys)
        self._mesh: IMeshNetwork | None = None
        self._present = b""  # the last one, for neighbours that could not open it
        # By neighbour: what it acknowledges also if it cannot open it before it knows the epoch
        self._sent: defaultdict[int, deque[tuple[float, bytes]]]
        self._sent = defaultdict(lambda: deque(maxlen=REPEATED))
        self._unopened: dict[int, list[float]] = {}  # by node: the first challenges, not answered
        # By node, since when and how many: packets of somebody else
        self._forged: dict[int, tuple[float, int]] = {}
        self._doubtful: dict[int, bytes] = {}  # by node: a packet that its next answer decides
        self._clock = clock
        self.complaints = Complaints(node_id)

    # For the component -----------------------------------------------------------------------

    @property
    def medium(self) -> Medium:
        return self._antenna.medium

    def reserved_bytes(self, kind: int) -> int:
        return reserved_bytes(kind)

    def seal_message(self, creator: int, to: int, place: bytes, payload: bytes) -> bytes:
        return self._message_seal.seal(creator, to, place, payload)

    def open_message(self, creator: int, to: int, place: bytes, sealed: bytes) -> bytes | None:
        return self._message_seal.open(creator, to, place, sealed)

    def acknowledgement_tag(self, creator: int, to: int, body: bytes) -> bytes:
        return self._message_seal.acknowledgement_tag(creator, to, body)

    def without_proof(self, payload: bytes) -> bytes:
        return self._end_to_end.without_proof(payload)

    def may_be_gateway(self, node: int) -> bool:
        return self._end_to_end.is_gateway(node)

    def foreign_neighbour(self) -> str:
        return self.complaints.foreign_neighbour(self._clock())

    def channel_use(self) -> ChannelUse:
        return self._antenna.channel_use()

    def hears_power(self) -> bool | None:
        return self._antenna.hears_power()

    def works(self) -> bool:
        return self._antenna.works()

    def patience(self) -> float:
        return self._antenna.patience()

    def limit_tries(self, most: int) -> None:
        self._antenna.limit_tries(most)

    def data_room(self) -> int:
        return self._antenna.data_room()

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        self._mesh = mesh
        self._antenna.start_antenna(self)

    def stop_antenna(self) -> None:
        self._antenna.stop_antenna()
        self._mesh = None

    def send_message_to(self, payload: bytes) -> bool:
        """As for every antenna; True also for a packet that its addressee could not verify yet."""
        if payload[CREATOR_AT] == self._node_id:
            proven = self._proven(payload)
            if proven is None:
                return True
            payload = proven
            if payload[TYPE_AT] == _ORDER:
                way = self._end_to_end.way_of_order(payload[FORWARD_AT])
                if way is not None and way != payload[TO_AT]:
                    sealed = self._sealed(messages.readdressed(payload, way))
                    if self._antenna.send_message_to(sealed):
                        return True
        return self._antenna.send_message_to(self._sealed(payload))

    def send_messages(self, payloads: Sequence[bytes]) -> list[bool]:
        proven = [self._proven(payload) for payload in payloads]
        sealed = [self._sealed(payload) for payload in proven if payload is not None]
        taken = iter(self._antenna.send_messages(sealed))
        return [payload is None or next(taken) for payload in proven]

    def broadcast_message(self, payload: bytes) -> None:
        payload = self._end_to_end.seal(payload, self._clock()) or payload
        kind = payload[TYPE_AT]
        # On a shared channel, where the next beacon costs less, none is repeated for a newcomer.
        if kind == _PRESENT or (kind == _BEACON and not self.medium.policy.queued):
            self._present = payload
        self._antenna.broadcast_message(self._seal.seal(payload))

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        self._antenna.debugging_mode(info, on)

    def switch_power(self, on: bool) -> None:
        self._antenna.switch_power(on)

    def on(self) -> bool:
        return self._antenna.on()

    def _sealed(self, payload: bytes) -> bytes:
        """A packet for one neighbour with its seal; kept, in case that neighbour cannot open it."""
        self._sent[payload[TO_AT]].append((self._clock(), payload))
        return self._seal.seal(payload)

    def _proven(self, payload: bytes) -> bytes | None:
        """A packet with its end-to-end seal; None: its addressee could not verify it yet."""
        if payload[CREATOR_AT] != self._node_id or payload[SEAL_AT - 2] or payload[SEAL_AT - 1]:
            return payload
        now_s = self._clock()
        proven = self._end_to_end.seal(payload, now_s)
        if proven is None:
            detail = f"no nonce of node {payload[FORWARD_AT]} was received yet"
            self.complaints.add("a packet could not be sealed", detail, now_s)
        return proven

    # For the antenna -------------------------------------------------------------------------

    def get_node_id(self) -> int:
        return self._node_id

    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Open a packet and pass it on; one that is not authentic ends here."""
        mesh = self._mesh
        if mesh is None:
            return
        if len(payload) != PAYLOAD_BYTES:
            mesh.on_msg(payload, now_s)  # complains
            return
        opened = self._seal.open(payload, now_s)
        if opened is None:
            self._not_opened(payload, now_s)
            return
        forward = opened[FORWARD_AT]
        if forward == self._node_id or forward == BROADCAST:
            try:
                opened = self._end_to_end.open(opened)
            except NotProven as error:
                self._not_proven(error, payload, now_s)
                return
        mesh.on_msg(opened, now_s)

    def on_delivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """A radio that acknowledged a challenge and never answered it is no neighbour."""
        if self._mesh is not None and self._seal.knows(payload[TO_AT], now_s):
            self._mesh.on_delivered(payload[:SEAL_AT] + _NO_SEAL, tries, now_s)

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        kind = payload[TYPE_AT]
        if kind == _CHALLENGE:
            self._unopened.pop(payload[TO_AT], None)  # without an answer for another reason
        if self._mesh is not None and kind not in (_CHALLENGE, _ANSWER, _PRESENT, _BEACON):
            self._mesh.on_undelivered(payload[:SEAL_AT] + _NO_SEAL, tries, now_s)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        if self._mesh is not None:
            self._mesh.on_antenna_power(on, now_s)

    def on_antenna_registered(self, now_s: float) -> None:
        if self._mesh is not None:
            self._mesh.on_antenna_registered(now_s)

    # Packets that do not open ----------------------------------------------------------------

    def _not_opened(self, payload: bytes, now_s: float) -> None:
        from_, kind = messages.sender(payload), messages.type_of(payload)
        if from_ > MAX_NODE_ID:
            self.complaints.dropped("a packet with invalid ids", payload, now_s)
        elif kind == _CHALLENGE:
            self._on_challenge(payload, from_, now_s)
        elif kind == _ANSWER:
            self._on_answer(payload, from_, now_s)
        else:
            self._on_unopened(payload, from_, now_s)

    def _on_unopened(self, payload: bytes, from_: int, now_s: float) -> None:
        why = self._seal.why_not(payload, now_s)
        if why is NotOpened.LATE:
            self.complaints.counts["packets that came late or twice"] += 1
            if payload[FORWARD_AT] != BROADCAST:  # there, it may be the count that was forged
                return
        elif why is NotOpened.REPLAYED:
            self._not_of(from_, payload, now_s)
        elif why is NotOpened.DOUBTFUL:
            self._doubtful[from_] = payload
        elif from_ == self._node_id:
            self.complaints.own_id_heard(now_s)
        elif payload[SEAL_AT:] == _NO_SEAL:
            self._not_answered(from_, payload, now_s)
        self._challenge(from_, now_s)

    def _on_answer(self, answer: bytes, from_: int, now_s: float) -> None:
        has_restarted = self._seal.answered(answer, now_s)
        if has_restarted is None:
            if self._seal.is_proven(answer):
                self._unopened.pop(from_, None)  # to an earlier challenge: it is only slow
            return
        self._unopened.pop(from_, None)
        doubtful = self._doubtful.pop(from_, None)
        if doubtful is not None and not has_restarted:
            self._not_of(from_, doubtful, now_s)

    def _on_challenge(self, challenge: bytes, from_: int, now_s: float) -> None:
        if messages.addressee(challenge) != self._node_id:
            return
        if not self._seal.is_proven(challenge):
            known = self._seal.knows(from_, now_s)
            (self._not_of if known else self._not_answered)(from_, challenge, now_s)
            return
        answer = self._seal.answer(challenge, now_s)
        if answer is None:
            self.complaints.counts["challenges without an answer"] += 1
            return
        self._unopened.pop(from_, None)  # it has a key of this mesh: only the handshake is slow
        self._send(answer)
        if self._present:
            present = messages.readdressed(self._present, from_)
            self._send(self._seal.seal(present))
        for sent_s, payload in self._sent.pop(from_, ()):
            if now_s - sent_s < REPEATED_S:
                self._antenna.send_message_to(self._seal.seal(payload))
        if not self._seal.knows(from_, now_s):
            self._challenge(from_, now_s)

    def _challenge(self, node: int, now_s: float) -> None:
        challenge = self._seal.challenge(node, now_s)
        if challenge is None:
            return
        if self._antenna.medium.policy.challenges_all and self._seal.crowded:
            self._antenna.broadcast_message(challenge)  # some may not exist, some not hear it
            return
        if not self._seal.knows(node, now_s):
            challenged_s = self._unopened.setdefault(node, [])
            if len(challenged_s) < LEAST_CHALLENGES:
                challenged_s.append(now_s)
        self._send(challenge)

    def _send(self, packet: bytes) -> None:
        """Send to the node in byte 3; to another radio with this node's id as to all."""
        if packet[TO_AT] == self._node_id:
            self._antenna.broadcast_message(packet)
        else:
            self._antenna.send_message_to(packet)

    def _not_proven(self, error: NotProven, payload: bytes, now_s: float) -> None:
        """Copies, and packets for an old nonce, are normal; forged orders are not."""
        if payload[TYPE_AT] == _ORDER and not isinstance(error, (Replayed, Expired)):
            self.complaints.dropped(str(error), payload, now_s)
        else:
            self.complaints.counts[f"dropped {error}"] += 1

    def _not_of(self, node: int, payload: bytes, now_s: float) -> None:
        """A packet in the name of this node is not from it, or not from now."""
        since_s, count = self._forged.get(node, (now_s, 0))
        if now_s - since_s > FORGOTTEN_S:
            since_s, count = now_s, 0
        self._forged[node] = since_s, count + 1
        if count + 1 >= LEAST_PACKETS:
            reason = f"replayed or forged packets in the name of node {node}"
            self.complaints.add(reason, payload.hex(), now_s)

    def _not_answered(self, node: int, payload: bytes, now_s: float) -> None:
        """A restarted neighbour is normal; one that never answers a challenge is not."""
        challenged_s = self._unopened.get(node, [])
        if len(challenged_s) < LEAST_CHALLENGES:
            return
        first_s, last_s = challenged_s[0], challenged_s[-1]
        if now_s - first_s > FORGOTTEN_S:
            del self._unopened[node]
            return
        if now_s - first_s < FOREIGN_AFTER_S or now_s - last_s < LATE_ANSWER_S:
            return
        if payload[SEAL_AT:] == _NO_SEAL:
            reason = f"a neighbour, node {node}, sends packets without a seal: it has no key"
        else:
            reason = (
                f"a neighbour, node {node}, sends packets that this node's key does not open: "
                "another mesh or another key?"
            )
        self.complaints.foreign(node, reason, payload, now_s)
