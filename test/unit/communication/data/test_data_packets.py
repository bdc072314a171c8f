import pytest

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.packets import Ack, Head, Poll
from drone_mesh.errors import PacketError

HEAD = Head(
    number=3, session=0x0201, port=7, length=20, reliable=True, behind=2, order=0x0504,
    checksum=0x0908,
)  # fmt: skip


def test_the_first_fragment_has_ten_bytes_of_header_and_the_first_seventeen_of_the_payload():
    body = packets.first_body(HEAD, b"abcdefghijklmnopqrst", room=27)
    assert body == bytes.fromhex("03 01 02 07 14 28 04 05 08 09") + b"abcdefghijklmnopq"
    assert packets.head_of(body) == HEAD


def test_a_further_fragment_has_one_byte_of_header():
    payload = bytes(range(100))
    assert packets.further_body(3, 1, payload, room=27) == b"\x03" + payload[17:43]
    assert packets.further_body(3, 2, payload, room=20) == b"\x03" + payload[29:48]


@pytest.mark.parametrize(
    ("length", "room", "count"),
    [
        (0, 27, 1),
        (17, 27, 1),
        (18, 27, 2),
        (43, 27, 2),
        (44, 27, 3),
        (1024, 27, 40),
        (1024, 20, 55),
    ],
)
def test_the_length_of_a_message_decides_its_number_of_fragments(length, room, count):
    assert packets.count_of(length, room) == count


@pytest.mark.parametrize("room", [20, 27])
@pytest.mark.parametrize("length", [0, 1, 17, 18, 500, 1024])
def test_a_payload_is_reassembled_from_its_fragments(room, length):
    payload = bytes(n % 251 for n in range(length))
    head = HEAD._replace(length=length)
    count = packets.count_of(length, room)
    bodies = [packets.first_body(head, payload, room)]
    bodies += [packets.further_body(3, n, payload, room) for n in range(1, count)]
    padded = [body.ljust(27, b"\0") for body in bodies]
    assert all(len(body) <= room for body in bodies)
    assert packets.joined(padded, length, room) == payload


def test_a_head_with_an_impossible_length_is_refused():
    with pytest.raises(PacketError, match="2047 bytes"):
        packets.head_of(bytes.fromhex("03 01 02 07 ff 07 04 05 08 09"))


def test_an_ack_and_a_poll_have_these_bytes_and_fit_the_smallest_space():
    ack = Ack(session=0x0201, nonce=5, number=3, has=0b101, newest=2, done=0b11)
    assert packets.ack_body(ack) == bytes.fromhex(
        "01 02 05 03 05 00 00 00 00 00 00 00 02 03 00 00 00"
    )
    assert packets.ack_of(packets.ack_body(ack)) == ack
    poll = Poll(session=0x0201, nonce=5, number=3, checksum=0x0706)
    assert packets.poll_body(poll) == bytes.fromhex("01 02 05 03 06 07")
    assert packets.poll_of(packets.poll_body(poll)) == poll
    assert len(packets.ack_body(ack)) <= packets.LEAST_ROOM


def test_an_echo_answer_carries_the_route_as_far_as_there_is_room():
    assert packets.echo_body(0x0102, (7, 8)) == bytes.fromhex("02 01 02 07 08")
    assert packets.echo_of(bytes.fromhex("02 01 02 07 08 00 00")) == (0x0102, (7, 8))
    assert packets.echo_of(packets.echo_body(1, tuple(range(30)), room=20))[1] == tuple(range(17))
