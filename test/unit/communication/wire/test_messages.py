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

from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import (
    GoToLocationMessage,
    HeartbeatMessage,
    IntroduceMessage,
    LocationMessage,
    Message,
    MissingMessage,
    MovementNegotiationMessage,
    next_hop,
)
from drone_mesh.communication.wire.packet_types import FLOATS, MessageType
from drone_mesh.drone.location import Location
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


@pytest.mark.parametrize(("is_goal", "last_byte_of_time"), [(False, "7f"), (True, "ff")])
@pytest.mark.parametrize("now_s", [0x7F030201, 0xFF030201])  # the second: after 2038
def test_a_location_says_in_the_highest_bit_of_its_time_whether_it_is_a_goal(
    is_goal, last_byte_of_time, now_s
):
    payload = messages.own_location(Location(1.5, -2.0, -3), is_goal, now_s, me=1, to=4)
    body = f"00 00 c0 3f 00 00 00 c0 fd ff 01 02 03 {last_byte_of_time}"
    assert payload == padded(f"01 01 01 04 04 {body}")
    assert messages.is_goal(payload) is is_goal
    assert messages.place_in(payload) == Location(1.5, -2.0, -3)


@pytest.mark.parametrize(("name", "arguments", "wire"), VECTORS)
def test_the_functions_without_objects_read_the_same_fields_as_the_classes(name, arguments, wire):
    payload, message = bytes.fromhex(wire), from_line(name, arguments)
    creator, from_, kind, to, forward = messages.header(payload)
    assert (creator, from_, to, forward) == (
        message.creator, message.from_, message.to, message.forward,
    )  # fmt: skip
    assert kind == (message.type if name == "Message" else message.TYPE)
    assert messages.hop(payload) == (from_, to)
    assert (messages.sender(payload), messages.receiver(payload)) == (from_, to)
    assert (messages.type_of(payload), messages.addressee(payload)) == (kind, forward)
    read = {
        "HeartbeatMessage": lambda: (
            *messages.heartbeat_body(payload)[:1],
            messages.preferred_gateway(payload),
            messages.hops(payload),
        ),
        "IntroduceMessage": lambda: messages.present_body(payload),
        "LocationMessage": lambda: (*messages.place_in(payload), message.time_since_posix),
    }
    if name in read:
        assert read[name]() == pytest.approx(dataclasses.astuple(message)[4:], rel=1e-6)
    if name == "HeartbeatMessage":
        assert messages.heartbeat_body(payload) == dataclasses.astuple(message)[4:]
    if name == "IntroduceMessage":
        assert messages.hops(payload) == message.hops_until_gateway


@pytest.mark.parametrize(("name", "arguments", "wire"), VECTORS)
def test_the_functions_without_objects_write_the_same_bytes_as_the_original(name, arguments, wire):
    payload, message = bytes.fromhex(wire), from_line(name, arguments)
    head = (message.creator, message.from_, message.to, message.forward)
    if name == "Message":
        assert messages.packet(message.type, *head).hex() == wire
    elif name == "LocationMessage":
        place = Location(message.latitude, message.longitude, message.height)
        is_goal, time_s = divmod(message.time_since_posix, 2**31)
        new = messages.own_location(place, is_goal, time_s, message.creator, message.forward)
        assert new[:5] == bytes((head[0], head[0], 1, head[3], head[3]))
        assert new[5:] == payload[5:]
    elif name == "HeartbeatMessage":  # a new one has no hops, and each relay counts one
        new = messages.heartbeat(*head, bool(message.know_gateway), message.preferred_gateway)
        for _relay in range(message.hops):
            relayed = next_hop(new, message.from_, message.to)
            assert relayed is not None
            new = relayed
        assert new.hex() == wire
    elif name == "IntroduceMessage":  # only its creator sends one, to every node in range
        new = messages.present(
            message.creator, message.hops_until_gateway, bool(message.know_gateway)
        )
        assert new[:5] == bytes((message.creator, message.creator, 3, 254, 254))
        assert new[5:] == payload[5:]
    else:
        body = message.BODY.pack(*dataclasses.astuple(message)[4:])
        assert messages.packet(message.TYPE, *head, body).hex() == wire


def test_the_vectors_cover_every_class():
    assert {name for name, _arguments, _wire in VECTORS} == {type(m).__name__ for m, _ in LITERAL}


@pytest.mark.parametrize(("message", "wire"), LITERAL, ids=lambda value: type(value).__name__)
def test_has_these_bytes_on_the_air(message, wire):
    assert message.to_payload() == padded(wire)
    assert type(message).from_payload(padded(wire)) == message


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
        MissingMessage(1, -1, 3, 4, 5),
        MissingMessage(1, 2, 3, 4, 256),
        GoToLocationMessage(1, 2, 3, 4, 0.0, 0.0, 40000),
        GoToLocationMessage(1, 2, 3, 4, 1e300, 0.0, 0),
        LocationMessage(1, 2, 3, 4, 0.0, 0.0, 0, 2**32),
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
header = st.tuples(byte, byte, byte, byte)


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
    of_another = kind in (MessageType.LAST_PLACE, MessageType.GATEWAY_PLACE)
    body = bytes(3 if of_another else 0) + numbers
    payload = bytes((ids[0], ids[1], kind, ids[2], ids[3])) + body.ljust(27, b"\0")
    decoded(payload)
    has_two = of_another or kind in (MessageType.LOCATION, MessageType.MOVE_TO_LOCATION)
    has_one = kind == MessageType.MOVEMENT_NEGOTIATION
    has_numbers = kind in FLOATS
    assert has_numbers == (has_two or has_one)
    finite = not has_numbers or messages.is_finite(payload)
    assert finite == (not (has_two or (has_one and not second)))
    if has_one and not second:
        assert not math.isfinite(MovementNegotiationMessage.from_payload(payload).cost)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("00", "01 07"),
        ("01 05", "02 05 07"),
        ("10 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d 0e 0f 10",) * 2,
    ],
)
def test_each_node_that_forwards_an_echo_adds_its_id_up_to_16(before, after):
    def echo(from_, to, route):
        header = bytes((1, from_, 194, to, 9))
        return (header + bytes.fromhex("34 12") + bytes.fromhex(route)).ljust(32, b"\0")

    assert messages.next_hop(echo(1, 7, before), 7, 8) == echo(7, 8, after)
