"""Users' messages are secret and authentic from end to end."""

from __future__ import annotations

import hashlib

import pytest
from cryptography.hazmat.primitives.ciphers import Cipher
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.ciphers.modes import ECB
from proofs.stranger import Hole, Tap
from seal_rig import KEY, OTHER_KEY

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.seals.message_seal import MessageSeal
from drone_mesh.inprocess import Network

TO_ALL = 254
PLACE = b"\x34\x12\x07\x05\x00"


def test_a_sealed_message_has_these_bytes():
    pair = KEY.pair(5, 0)
    context = b"\x05\x00" + PLACE
    tag = hashlib.blake2s(context + b"21.5", key=pair, digest_size=6, person=b"message").digest()
    key = hashlib.blake2s(key=pair, digest_size=16, person=b"encrypt").digest()
    # Counter mode, with the block cipher alone: the first block is the nonce and a counter of 0.
    block = Cipher(AES(key), ECB()).encryptor().update(context + tag + b"\0\0\0")
    encrypted = bytes(a ^ b for a, b in zip(b"21.5", block))
    sealed = MessageSeal(KEY).seal(5, 0, PLACE, b"21.5")
    assert sealed == encrypted + tag
    assert sealed.hex() == "0a7d96790c2649e535fe"


@pytest.mark.parametrize("size", [0, 1, 15, 16, 17, 1024])
@pytest.mark.parametrize("to", [0, TO_ALL])
def test_the_receiver_reads_what_was_sealed(size, to):
    payload = bytes(n % 251 for n in range(size))
    sealed = MessageSeal(KEY.for_node(5)).seal(5, to, PLACE, payload)
    assert MessageSeal(KEY.for_node(0)).open(5, to, PLACE, sealed) == payload
    assert len(sealed) == size + 6


@pytest.mark.parametrize("at", range(11))
def test_a_changed_bit_does_not_open(at):
    sealed = bytearray(MessageSeal(KEY).seal(5, 0, PLACE, b"close"))
    sealed[at] ^= 1
    assert MessageSeal(KEY).open(5, 0, PLACE, bytes(sealed)) is None


@pytest.mark.parametrize(
    ("key", "creator", "to", "place"),
    [
        (OTHER_KEY, 5, 0, PLACE),
        (KEY, 6, 0, PLACE),
        (KEY, 5, 1, PLACE),
        (KEY, 0, 5, PLACE),
        (KEY, 5, TO_ALL, PLACE),
        (KEY, 5, 0, b"\x34\x12\x07\x06\x00"),
    ],
)
def test_nothing_opens_at_another_place(key, creator, to, place):
    sealed = MessageSeal(KEY).seal(5, 0, PLACE, b"close")
    assert MessageSeal(key).open(creator, to, place, sealed) is None


def test_what_is_too_short_for_a_seal_does_not_open():
    assert MessageSeal(KEY).open(5, 0, PLACE, b"short") is None


def test_the_same_text_looks_different_at_each_place():
    seal = MessageSeal(KEY)
    places = [PLACE, b"\x34\x12\x07\x06\x00", b"\x35\x12\x07\x05\x00"]
    seen = {seal.seal(5, 0, place, b"21.5")[:4] for place in places}
    assert len(seen) == 3
    assert b"21.5" not in seen


@pytest.mark.parametrize("to", [0, TO_ALL])
@pytest.mark.parametrize("key", [None, KEY])
def test_a_listener_reads_a_message_only_without_a_key(key, to):
    network = Network(seed=1, key=key)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    assert network.run_until(network.all_connected, 60.0)
    heard = []
    antenna = network.nodes[1].antenna
    for name in ("send_message_to", "broadcast_message"):
        send = getattr(antenna, name)

        def record(payload, send=send):
            heard.append(payload)
            return send(payload)

        setattr(antenna, name, record)
    network.send(1, to, b"secret")
    network.run_for(2.0)
    assert network.received[0][-1].payload == b"secret"
    assert any(b"secret" in payload for payload in heard) == (key is None)


def test_the_tag_of_an_acknowledgement_has_these_bytes():
    made = hashlib.blake2s(b"\x00\x05body", key=KEY.pair(0, 5), digest_size=3, person=b"received")
    tag = MessageSeal(KEY).acknowledgement_tag(0, 5, b"body")
    assert tag == made.digest()
    assert tag != MessageSeal(KEY).acknowledgement_tag(5, 0, b"body")
    assert tag != MessageSeal(OTHER_KEY).acknowledgement_tag(0, 5, b"body")


@pytest.mark.parametrize("key", [None, KEY])
def test_a_relay_cannot_acknowledge_the_message_that_it_drops(key):
    network = Network(seed=1, key=key)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.add_router(2, 12.0, 0.0)
    assert network.run_until(network.all_connected, 60.0)
    record = []
    relay = network.nodes[1]
    relay.receiver = Hole(network, 1, [])
    relay.receiver = Tap(network, 1, record)
    ticket = network.send(2, 0, b"x")
    network.run_for(0.1)
    first = next(r.payload for r in record if r.payload[2] == packets.FRAGMENTS[0])
    session = int.from_bytes(first[6:8], "little")
    body = packets.ack_body(packets.Ack(session, 0, first[5], packets.COMPLETE, first[5], 1))
    forged = bytes((0, 1, packets.ACK, 2, 2)) + body
    network.nodes[2].component.on_msg(forged.ljust(32, b"\0"), network.now_s())
    is_believed = ticket.state is TicketState.DELIVERED
    assert is_believed == (key is None)
