from __future__ import annotations

from random import Random

import pytest
from seal_rig import FRESH_S, KEY, OTHER_KEY, introduce, node, packet

from drone_mesh.communication.seals.seal import HopSeal, NotOpened, _epoch_state

HEARTBEAT = packet("05 05 04 01 01 01 00 00")  # of node 5 for node 1
PRESENT = packet("05 05 03 fe fe 01 01")


@pytest.fixture
def link():
    """Node 1, which knows the epoch of node 5, and node 5."""
    receiver, sender = node(1), node(5)
    introduce(receiver, sender, 5)
    return receiver, sender


def test_a_sealed_packet_has_these_bytes_on_the_air():
    sealed = node(5).seal(HEARTBEAT)
    assert sealed[:25] == HEARTBEAT[:25]
    assert sealed[25:27] == b"\x01\x00"  # the first packet of this start
    assert sealed[27:] == bytes.fromhex("4e124fd2ae")


def test_an_authentic_packet_opens_once(link):
    receiver, sender = link
    sealed = sender.seal(HEARTBEAT)
    assert receiver.open(sealed, 1.0) == HEARTBEAT
    assert receiver.open(sealed, 1.0) is None


@pytest.mark.parametrize("byte", range(32))
def test_no_changed_byte_goes_unnoticed(link, byte):
    receiver, sender = link
    sealed = bytearray(sender.seal(HEARTBEAT))
    sealed[byte] ^= 1
    assert receiver.open(bytes(sealed), 1.0) is None


def test_each_receiver_of_a_broadcast_finds_its_own_id_in_it(link):
    receiver, sender = link
    sealed = sender.seal(PRESENT)
    arrived = sealed[:3] + b"\x01" + sealed[4:]
    assert receiver.open(arrived, 1.0) == PRESENT[:3] + b"\x01" + PRESENT[4:]


def test_packets_may_overtake_each_other_but_not_come_twice(link):
    receiver, sender = link
    sealed = [sender.seal(HEARTBEAT) for _ in range(500)]
    assert receiver.open(sealed[-1], 1.0) is not None
    assert all(receiver.open(s, 1.0) for s in sealed[:-1])
    assert not any(receiver.open(s, 1.0) for s in sealed)


def test_a_packet_far_behind_the_newest_is_too_old(link):
    receiver, sender = link
    first = sender.seal(HEARTBEAT)
    for _ in range(512):
        newest = sender.seal(HEARTBEAT)
    assert receiver.open(newest, 1.0) is not None
    assert receiver.open(first, 1.0) is None


def test_the_counter_goes_on_after_its_low_bytes_have_wrapped(link):
    receiver, sender = link
    first = sender.seal(HEARTBEAT)
    for round_ in range(5):
        for _ in range(2**14):
            sealed = sender.seal(HEARTBEAT)
        assert receiver.open(sealed, 1.0) is not None, round_
    assert receiver.open(first, 1.0) is None


def test_no_packet_of_a_stranger_opens():
    receiver, sender = node(1), node(5)
    assert receiver.open(sender.seal(HEARTBEAT), 0.0) is None


def test_after_a_restart_of_the_sender_old_packets_never_open_again(link):
    receiver, sender = link
    recorded = [sender.seal(HEARTBEAT) for _ in range(100)]
    restarted = node(5, seed=1)
    assert receiver.open(restarted.seal(HEARTBEAT), 1.0) is None
    introduce(receiver, restarted, 5, 3.0)
    assert receiver.open(restarted.seal(HEARTBEAT), 3.0) is not None
    assert not any(receiver.open(r, 3.0) for r in recorded)


def test_a_receiver_that_lost_its_memory_opens_no_old_packet(link):
    _, sender = link
    recorded = [sender.seal(HEARTBEAT) for _ in range(100)]
    receiver = node(1, seed=1)
    introduce(receiver, sender, 5)
    assert not any(receiver.open(r, 0.0) for r in recorded)
    assert receiver.open(sender.seal(HEARTBEAT), 0.0) is not None


def test_a_recorded_answer_to_a_challenge_is_worthless(link):
    receiver, sender = link
    old = sender.answer(receiver.challenge(5, 5.0), 5.0)
    assert receiver.answered(old, 5.0) is False
    restarted = node(1, seed=1)
    assert restarted.challenge(5, 6.0) is not None
    assert restarted.answered(old, 6.0) is None
    assert not restarted.knows(5, 6.0)


def test_an_answer_without_a_challenge_is_ignored(link):
    receiver, sender = link
    challenge = receiver.challenge(5, 5.0)
    answer = sender.answer(challenge, 5.0)
    assert receiver.answered(answer, 5.0) is False  # its epoch is not new
    assert receiver.answered(answer, 5.0) is None


def test_a_node_with_another_key_neither_answers_nor_is_answered():
    receiver, stranger = node(1), node(5, key=OTHER_KEY)
    assert not stranger.is_proven(receiver.challenge(5, 0.0))
    assert not receiver.is_proven(stranger.challenge(1, 0.0))


def test_a_withheld_packet_is_worthless_after_a_silence(link):
    receiver, sender = link
    kept = sender.seal(HEARTBEAT)
    assert receiver.open(kept, FRESH_S + 0.1) is None
    introduce(receiver, sender, 5, FRESH_S + 0.1)
    assert receiver.open(kept, FRESH_S + 0.1) is None


@pytest.mark.parametrize("made", [HEARTBEAT, PRESENT], ids=["to one", "to all"])
def test_a_withheld_packet_is_worthless_twenty_seconds_after_a_later_one(link, made):
    """Somebody may jam one packet and let the others of its sender pass."""
    receiver, sender = link
    kept, slow = sender.seal(made), sender.seal(made)
    assert receiver.open(sender.seal(made), 5.0) is not None
    assert receiver.open(slow, 14.9) is not None  # it waited in a queue
    for now_s in (15.0, 25.0):
        assert receiver.open(sender.seal(made), now_s) is not None
    assert receiver.open(kept, 25.0) is None
    assert receiver.why_not(kept, 25.0) is NotOpened.REPLAYED


def test_a_node_is_not_challenged_again_at_once():
    receiver = node(1)
    assert receiver.challenge(5, 0.0) is not None
    assert receiver.challenge(5, 1.9) is None
    assert receiver.challenge(5, 2.0) is not None


def test_another_radio_with_ones_own_id_is_challenged_again_soon_and_may_answer_late():
    receiver, other = node(5), node(5, seed=1)
    first = receiver.challenge(5, 0.0)
    assert receiver.challenge(5, 0.4) is None
    assert receiver.challenge(5, 0.5) is not None
    assert receiver.answered(other.answer(first, 0.6), 0.6) is True


@pytest.mark.parametrize(("late_s", "is_believed"), [(9.9, True), (10.1, False)])
def test_on_a_busy_channel_an_answer_may_come_after_the_next_challenge(late_s, is_believed):
    receiver, sender = node(1), node(5)
    first = receiver.challenge(5, 0.0)
    for second in range(2, 10, 2):
        assert receiver.challenge(5, float(second)) is not None
    assert (receiver.answered(sender.answer(first, 1.0), late_s) is True) is is_believed
    assert receiver.knows(5, late_s) is is_believed


def test_a_late_answer_lets_no_packet_pass_twice(link):
    receiver, sender = link
    answer = sender.answer(receiver.challenge(5, 5.0), 5.0)
    assert receiver.challenge(5, 7.0) is not None
    old = [sender.seal(packet) for packet in [PRESENT, HEARTBEAT] * 100]
    assert all(receiver.open(sealed, 8.0) for sealed in old)
    assert receiver.answered(answer, 8.0) is False
    assert not any(receiver.open(sealed, 8.0) for sealed in old)


def test_invented_ids_get_a_limited_number_of_challenges():
    receiver = node(1)
    sent = [receiver.challenge(n % 250 + 2, n * 0.001) for n in range(10_000)]  # 1,000 a second
    assert 16 <= sum(c is not None for c in sent) <= 16 * (10 / 0.5 + 1)


def test_a_challenge_that_is_answered_makes_room_for_the_next():
    receiver = node(1)
    for other in range(2, 202):
        introduce(receiver, node(other), other)


def test_counters_end_with_a_new_epoch(link):
    receiver, sender = link
    sender._count = 2**32 - 2
    introduce(receiver, sender, 5, 4.0)
    last, next_ = sender.seal(HEARTBEAT), sender.seal(HEARTBEAT)
    assert receiver.open(last, 4.0) is not None
    assert receiver.open(next_, 4.0) is None
    introduce(receiver, sender, 5, 7.0)
    assert receiver.open(sender.seal(HEARTBEAT), 7.0) is not None
    assert receiver.open(last, 7.0) is None


def test_a_captured_node_cannot_pose_as_another_one_to_a_neighbour():
    receiver, sender = node(1), node(5)
    captured = HopSeal(5, KEY.for_node(7), Random("5 0"), FRESH_S)  # poses as node 5
    introduce(receiver, sender, 5)
    with pytest.raises(AssertionError, match="a node has its own keys"):
        captured.seal(HEARTBEAT)


def sealed_as(node_id, captured_keys, epoch, count, payload):
    """A packet to all in the name of `node_id`, made with the network key of another node."""
    forger = HopSeal(node_id, captured_keys, Random("forger"), FRESH_S)
    forger._epoch, forger._count = epoch, count - 1
    forger._state_to_all = _epoch_state(captured_keys.network, epoch)
    return forger.seal(payload)


@pytest.mark.parametrize("ahead", [33, 600, 32_000])
def test_a_count_that_a_broadcast_claims_does_not_raise_the_bar_for_the_pair(link, ahead):
    receiver, sender = link
    forged = sealed_as(5, KEY.for_node(7), sender._epoch, sender._count + ahead, PRESENT)
    assert receiver.open(forged, 1.0) is not None
    for _ in range(10):
        assert receiver.open(sender.seal(HEARTBEAT), 1.0) == HEARTBEAT


@pytest.mark.parametrize("ahead", [100, 600, 32_000])
def test_one_answer_ends_what_a_broadcast_claimed(link, ahead):
    receiver, sender = link
    old = sender.seal(PRESENT)
    forged = sealed_as(5, KEY.for_node(7), sender._epoch, sender._count + ahead, PRESENT)
    assert receiver.open(forged, 1.0) is not None
    introduce(receiver, sender, 5, 3.0)
    assert receiver.open(sender.seal(PRESENT), 3.0) is not None
    assert receiver.open(old, 3.0) is None
    assert receiver.open(forged, 3.0) is not None  # the forger can always make another one
    introduce(receiver, sender, 5, 9.0)
    assert receiver.open(sender.seal(PRESENT), 9.0) is not None


def test_what_an_answer_overtook_after_a_long_silence_is_late_and_not_replayed(link):
    receiver, sender = link
    sealed = sender.seal(PRESENT)
    overtaken = sealed[:3] + b"\x01" + sealed[4:]
    receiver.answered(sender.answer(receiver.challenge(5, 65.0), 65.1), 65.2)
    assert receiver.open(overtaken, 65.3) is None
    assert receiver.why_not(overtaken, 65.3) is NotOpened.LATE


def test_a_known_neighbour_is_challenged_less_and_less_while_its_answers_show_no_reason(link):
    receiver, sender = link
    asked = []
    for tenth in range(10, 3000):
        challenge = receiver.challenge(5, tenth / 10)
        if challenge is not None:
            asked.append(tenth / 10)
            receiver.answered(sender.answer(challenge, tenth / 10), tenth / 10)
    pauses = [round(after - before) for before, after in zip(asked, asked[1:])]
    assert pauses[:4] == [2, 4, 8, 16]
    assert set(pauses[4:]) == {16}
    restarted = node(5, seed=1)
    introduce(receiver, restarted, 5, 400.0)
    assert receiver.challenge(5, 402.0) is not None


def test_an_answered_challenge_gets_no_second_answer_and_does_not_use_up_the_limit(link):
    receiver, sender = link
    old = receiver.challenge(5, 5.0)
    assert sender.answer(old, 5.0) is not None
    assert not any(sender.answer(old, 5.0 + n / 100) for n in range(1000))
    assert sender.answer(receiver.challenge(5, 15.0), 15.0) is not None


def test_recorded_challenges_get_a_limited_number_of_answers():
    answers = 0
    victim = node(5)
    for other in range(6, 206):
        challenger = node(other)
        for n in range(8):
            challenge = challenger.challenge(5, 2.0 * n)
            answers += victim.answer(challenge, 0.001 * n) is not None
    assert answers == 64
