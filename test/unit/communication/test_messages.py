"""The packets: the original's bytes, literal bytes, what is refused."""

from __future__ import annotations

import dataclasses
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drone_mesh.communication import messages
from drone_mesh.communication.messages import (
    GoToLocationMessage,
    HeartbeatMessage,
    IntroduceMessage,
    LocationMessage,
    Message,
    MessageType,
    MissingMessage,
    MovementNegotiationMessage,
    next_hop,
)
from drone_mesh.errors import PacketError

VECTORS = [
    line.split("|")
    for line in (Path(__file__).parent / "wire.txt").read_text(encoding="ascii").splitlines()
]

LITERAL = [  # message, its bytes up to the last that is not zero
    (Message(1, 2, 2, 3, 4), "01 02 02 03 04"),
    (Message(1, 2, 200, 3, 4), "01 02 c8 03 04"),
    (
        LocationMessage(1, 2, 3, 4, 1.5, -2.0, -3, 0x01020304),
        "01 02 01 03 04 00 00 c0 3f 00 00 00 c0 fd ff 04 03 02 01",
    ),
    (IntroduceMessage(1, 2, 3, 254, 255, True), "01 02 03 03 fe ff 01"),
    (HeartbeatMessage(1, 2, 3, 4, True, 9, 7), "01 02 04 03 04 01 09 07"),
    (MissingMessage(1, 2, 3, 4, 253), "01 02 05 03 04 fd"),
    (
        GoToLocationMessage(1, 2, 3, 4, 1.5, -2.0, 500),
        "01 02 06 03 04 00 00 c0 3f 00 00 00 c0 f4 01",
    ),
    (MovementNegotiationMessage(1, 2, 3, 4, -1.0), "01 02 07 03 04 00 00 80 bf"),
]


def decoded(payload: bytes) -> Any:
    """The message, of the class that the type calls for."""
    of_type = {type(message).TYPE: type(message) for message, _ in LITERAL[2:]}
    kind = payload[2] if len(payload) > 2 else 0
    return of_type.get(kind, Message).from_payload(payload)


def padded(text: str) -> bytes:
    return bytes.fromhex(text).ljust(32, b"\0")


def from_line(name: str, arguments: str) -> Any:
    """The message of one line of wire.txt, made with its arguments in their order."""
    made_of = getattr(messages, name)
    texts = arguments.split(",")
    fields = dataclasses.fields(made_of)
    assert len(texts) == len(fields)
    return made_of(
        *(float(text) if field.type == "float" else int(text) for text, field in zip(texts, fields))
    )


@pytest.mark.parametrize(("name", "arguments", "wire"), VECTORS)
def test_encodes_as_the_original_did(name, arguments, wire):
    assert from_line(name, arguments).to_payload().hex() == wire


@pytest.mark.parametrize(("name", "arguments", "wire"), VECTORS)
def test_decodes_what_the_original_encoded(name, arguments, wire):
    payload = bytes.fromhex(wire)
    message = getattr(messages, name).from_payload(payload)
    assert message.to_payload() == payload
    wanted = dataclasses.astuple(from_line(name, arguments))
    assert dataclasses.astuple(message) == pytest.approx(wanted, rel=1e-6)


def test_the_vectors_cover_every_class():
    assert {name for name, _arguments, _wire in VECTORS} == {type(m).__name__ for m, _ in LITERAL}


@pytest.mark.parametrize(("message", "wire"), LITERAL, ids=lambda value: type(value).__name__)
def test_has_these_bytes_on_the_air(message, wire):
    assert message.to_payload() == padded(wire)
    assert type(message).from_payload(padded(wire)) == message


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (0, "NOTDEFINED"),
        (1, "LOCATION"),
        (2, "REQUESTLOCATION"),
        (3, "PRESENT"),
        (4, "HEARTBEAT"),
        (5, "MISSING"),
        (6, "MOVE_TO_LOCATION"),
        (7, "MOVEMENT_NEGOTIATION"),
    ],
)
def test_types_have_these_numbers(number, kind):
    assert MessageType[kind] == number


@pytest.mark.parametrize("kind", [0, 2, 8, 127, 128, 255])
def test_a_type_without_a_body_becomes_a_plain_message(kind):
    payload = bytes([1, 2, kind, 3, 4]) + bytes(range(27))
    assert Message.from_payload(payload) == Message(1, 2, kind, 3, 4)


@pytest.mark.parametrize("length", [0, 4, 31, 33])
@pytest.mark.parametrize("decode", [type(message).from_payload for message, _ in LITERAL])
def test_another_length_is_refused(decode, length):
    with pytest.raises(PacketError, match=f"expected 32 bytes, got {length}"):
        decode(bytes(length))


@pytest.mark.parametrize(
    "made_of", sorted({type(message) for message, _ in LITERAL} - {Message}, key=str)
)
def test_the_bytes_of_another_type_are_refused(made_of):
    with pytest.raises(PacketError, match=f"type 2 is not {made_of.TYPE.name}"):
        made_of.from_payload(padded("01 02 02 03 04"))


@pytest.mark.parametrize(
    "message",
    [
        Message(256, 2, 2, 3, 4),
        Message(1, 2, -1, 3, 4),
        MissingMessage(1, -1, 3, 4, 5),
        MissingMessage(1, 2, 3, 4, 256),
        HeartbeatMessage(1, 2, 3, 4, True, 9, 300),
        IntroduceMessage(1, 2, 3, 4, 300, True),
        GoToLocationMessage(1, 2, 3, 4, 0.0, 0.0, 40000),
        GoToLocationMessage(1, 2, 3, 4, 1e300, 0.0, 0),
        LocationMessage(1, 2, 3, 4, 0.0, 0.0, 0, -1),
        LocationMessage(1, 2, 3, 4, 0.0, 0.0, 0, 2**32),
        MovementNegotiationMessage(1, 2, 3, 4, -1e300),
    ],
    ids=str,
)
def test_a_value_that_does_not_fit_is_refused_with_the_message_in_the_reason(message):
    with pytest.raises(PacketError, match=rf"{type(message).__name__}\(.*does not fit"):
        message.to_payload()


def test_a_packet_is_readdressed_in_byte_3_alone_and_addressed_in_bytes_3_and_4():
    payload = bytes([7, 2, 6, 3, 4]) + bytes(range(100, 127))
    assert messages.readdressed(payload, 8) == bytes([7, 2, 6, 8, 4]) + bytes(range(100, 127))
    assert messages.addressed(payload, 8) == bytes([7, 2, 6, 8, 8]) + bytes(range(100, 127))


def test_the_header_is_read_field_by_field():
    payload = bytes([7, 2, 6, 3, 4]) + bytes(27)
    assert messages.header(payload) == (7, 2, 6, 3, 4)
    assert (messages.sender(payload), messages.type_of(payload)) == (2, 6)
    assert (messages.receiver(payload), messages.addressee(payload)) == (3, 4)


def test_the_next_hop_changes_from_and_to_alone():
    payload = bytes([7, 2, 6, 3, 4]) + bytes(range(100, 127))
    assert next_hop(payload, 3, 8) == bytes([7, 3, 6, 8, 4]) + bytes(range(100, 127))


def test_the_next_hop_of_a_heartbeat_counts():
    assert next_hop(padded("07 02 04 03 04 01 09 00"), 3, 8) == padded("07 03 04 08 04 01 09 01")
    assert next_hop(padded("07 02 04 03 04 01 09 fd"), 3, 8) == padded("07 03 04 08 04 01 09 fe")


@pytest.mark.parametrize("hops", ["fe", "ff"])
def test_a_heartbeat_has_no_255th_hop(hops):
    assert next_hop(padded(f"07 02 04 03 04 01 09 {hops}"), 3, 8) is None


repeatable = settings(derandomize=True, deadline=None, database=None)
byte = st.integers(0, 255)
float32 = st.floats(width=32, allow_nan=False)
header = st.tuples(byte, byte, byte, byte)
a_message = st.one_of(
    st.builds(lambda h, kind: Message(h[0], h[1], kind, h[2], h[3]), header, byte),
    st.builds(
        lambda h, *body: LocationMessage(*h, *body),
        header,
        float32,
        float32,
        st.integers(-(2**15), 2**15 - 1),
        st.integers(0, 2**32 - 1),
    ),
    st.builds(lambda h, *body: IntroduceMessage(*h, *body), header, byte, st.booleans()),
    st.builds(lambda h, *body: HeartbeatMessage(*h, *body), header, st.booleans(), byte, byte),
    st.builds(lambda h, *body: MissingMessage(*h, *body), header, byte),
    st.builds(
        lambda h, *body: GoToLocationMessage(*h, *body),
        header,
        float32,
        float32,
        st.integers(-(2**15), 2**15 - 1),
    ),
    st.builds(lambda h, *body: MovementNegotiationMessage(*h, *body), header, float32),
)


@repeatable
@given(a_message)
def test_what_was_encoded_is_decoded_to_the_same(message):
    payload = message.to_payload()
    assert len(payload) == 32
    assert type(message).from_payload(payload) == message


@repeatable
@given(st.binary(max_size=40))
def test_bytes_from_the_air_are_a_message_or_a_packet_error(payload):
    try:
        message = decoded(payload)
    except PacketError:
        assert len(payload) != 32
    else:
        assert message.to_payload()[:5] == payload[:5]


@repeatable
@given(byte, header, st.sampled_from(["nan", "inf", "-inf"]), st.booleans())
def test_nan_and_infinity_can_be_decoded_and_are_recognised(kind, ids, text, second):
    numbers = (
        struct.pack("<ff", 1.0, float(text)) if second else struct.pack("<ff", float(text), 1.0)
    )
    payload = bytes((ids[0], ids[1], kind, ids[2], ids[3])) + numbers.ljust(27, b"\0")
    decoded(payload)
    has_two = kind in (MessageType.LOCATION, MessageType.MOVE_TO_LOCATION)
    has_one = kind == MessageType.MOVEMENT_NEGOTIATION
    has_numbers = kind in messages.TYPES_WITH_NUMBERS
    assert has_numbers == (has_two or has_one)
    finite = not has_numbers or messages.is_finite(payload)
    assert finite == (not (has_two or (has_one and not second)))
    if has_one and not second:
        assert not math.isfinite(MovementNegotiationMessage.from_payload(payload).cost)


def test_the_fast_functions_for_heartbeats_agree_with_the_class():
    message = messages.HeartbeatMessage(3, 2, 1, 0, True, 7, 0)
    assert messages.heartbeat(3, 2, 1, 0, True, 7) == message.to_payload()
    received = bytes.fromhex("03 02 00 01 00 01 07 09") + bytes(24)
    assert messages.heartbeat_body(received) == (True, 7, 9)
    present = messages.IntroduceMessage(3, 3, 254, 254, 5, True).to_payload()
    assert messages.present_body(present) == (5, True)
