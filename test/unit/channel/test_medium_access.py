"""The rules of access to the channel, by themselves, under a virtual clock.

docs/radio.md, "Driver rules".
"""

from __future__ import annotations

import heapq
import random

import pytest

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.channel.medium_access import Fate, MediumAccess
from drone_mesh.channel.packet_queue import ALL_NODES
from drone_mesh.channel.trains import InTrain
from drone_mesh.communication.wire.packet_types import Priority

CYCLE_S = 0.0026
RULES = AccessRules.for_cycle(CYCLE_S)
PACKET = bytes(32)


def packet(number: int) -> bytes:
    return number.to_bytes(32, "little")


class Contest:
    """Senders that cannot hear each other, and one receiver. Tries that overlap all fail."""

    def __init__(self, senders: int, seed: int = 1) -> None:
        self.now_s = 0.0
        self.nodes = [MediumAccess(RULES, random.Random(f"{seed} {n}")) for n in range(senders)]
        self.delivered: list[list[float]] = [[] for _ in range(senders)]
        self.lost = 0
        self.tries = 0

    def offer_all(self, packets: int) -> None:
        for node in self.nodes:
            for number in range(packets):
                assert node.offer(0, packet(number), self.now_s)

    def run(self, until_s: float) -> None:
        under_way: list[tuple[float, int, float, object]] = []  # end, sender, start, packet
        last: list[tuple[float, float, int]] = []  # start, end, sender of recent tries
        while True:
            sending = {entry[1] for entry in under_way}
            starts = [
                (max(node.next_try_s, self.now_s), sender)
                for sender, node in enumerate(self.nodes)
                if sender not in sending
            ]
            start_s, sender = min(starts, default=(float("inf"), -1))
            if under_way and under_way[0][0] <= start_s:
                end_s, sender, began_s, tried = heapq.heappop(under_way)
                self.now_s = end_s
                alone = not any(
                    other != sender and began < end_s and ended > began_s
                    for began, ended, other in last
                )
                fate = self.nodes[sender].tried(tried, alone, end_s)
                if fate is Fate.DELIVERED:
                    self.delivered[sender].append(end_s)
                self.lost += fate is Fate.GIVEN_UP
                last = [one for one in last if one[1] > end_s - 2 * CYCLE_S]
            elif start_s <= until_s:
                self.now_s = start_s
                due = self.nodes[sender].due(start_s)
                if due is None:  # rounding
                    self.now_s += 1e-9
                    continue
                self.tries += 1
                heapq.heappush(under_way, (start_s + CYCLE_S, sender, start_s, due))
                last.append((start_s, start_s + CYCLE_S, sender))
            else:
                return


@pytest.mark.parametrize("senders", [2, 10, 50])
def test_contenders_that_start_at_the_same_moment_all_get_through_within_seconds(senders):
    contest = Contest(senders)
    contest.offer_all(1)
    contest.run(30.0)
    delivered = [times[0] for times in contest.delivered if times]
    assert len(delivered) + contest.lost == senders
    assert contest.lost <= senders // 10
    assert max(delivered) < 10.0


@pytest.mark.parametrize("senders", [2, 10, 50])
def test_the_channel_is_shared_fairly_and_no_contender_starves(senders):
    contest = Contest(senders)
    packets = 300 // senders
    contest.offer_all(packets)
    contest.run(120.0)
    counts = [len(times) for times in contest.delivered]
    assert min(counts) > 0
    fairness = sum(counts) ** 2 / (senders * sum(count**2 for count in counts))  # Jain's index
    assert fairness > 0.9


def test_more_contenders_do_not_lower_what_the_channel_carries_below_half():
    def carried_per_s(senders):
        contest = Contest(senders)
        contest.offer_all(1000 // senders)
        contest.run(5.0)
        return sum(map(len, contest.delivered)) / 5.0

    assert carried_per_s(50) > 0.5 * carried_per_s(10)


@pytest.fixture
def access():
    return MediumAccess(RULES, random.Random(1))


def test_a_receiver_that_is_gone_costs_at_most_18_frames_and_later_packets_6(access):
    costs = []
    now_s = 0.0
    for number in range(3):
        access.offer(7, packet(number), now_s)
        frames, fate = 0, Fate.WAITS
        while fate is Fate.WAITS:
            now_s = max(now_s, access.next_try_s)
            due = access.due(now_s)
            frames += 1 + access.retransmits()[0]
            now_s += CYCLE_S
            fate = access.tried(due, False, now_s)
        costs.append(frames)
    assert costs == [18, 6, 6]
    assert access.contention == 0.0  # it says nothing about the channel


def test_a_receiver_that_is_heard_again_gets_all_tries(access):
    now_s = 0.0

    def tries():
        nonlocal now_s
        access.offer(7, PACKET, now_s)
        count, fate = 0, Fate.WAITS
        while fate is Fate.WAITS:
            now_s = max(now_s, access.next_try_s)
            fate = access.tried(access.due(now_s), False, now_s)
            count += 1
        return count

    assert [tries(), tries()] == [9, 3]
    access.heard(7, now_s)
    assert tries() == 9


def test_waiting_for_one_receiver_does_not_delay_the_others(access):
    access.offer(7, packet(1), 0.0)
    now_s = access.next_try_s
    access.tried(access.due(now_s), False, now_s)
    access.offer(8, packet(2), now_s)
    now_s = access.next_try_s
    assert access.due(now_s).receiver == 8


def test_packets_for_one_receiver_keep_their_order(access):
    for number in range(5):
        access.offer(7, packet(number), 0.0)
    now_s, order = 0.0, []
    while len(access):
        now_s = max(now_s, access.next_try_s)
        due = access.due(now_s)
        if access.tried(due, random.Random(now_s).random() < 0.5, now_s) is Fate.DELIVERED:
            order.append(due.payload[0])
    assert order == [0, 1, 2, 3, 4]


def test_control_packets_go_before_data(access):
    access.offer(7, packet(1), 0.0, Priority.DATA)
    access.offer(8, packet(2), 0.0, Priority.CONTROL)
    assert access.due(1.0).receiver == 8


def test_users_data_does_not_wait_while_a_packet_of_the_mesh_for_the_same_node_pauses(access):
    access.offer(7, packet(1), 0.0)
    now_s = 0.0
    for _ in range(8):
        now_s = max(now_s, access.next_try_s)
        assert access.tried(access.due(now_s), False, now_s) is Fate.WAITS
    access.offer(7, packet(2), now_s, Priority.DATA)
    assert access.next_try_s < now_s + 10 * CYCLE_S
    assert access.due(access.next_try_s).payload == packet(2)


def test_a_packet_of_the_mesh_does_not_wait_while_users_data_for_the_same_node_pauses(access):
    access.offer(7, packet(1), 0.0, Priority.DATA)
    now_s = 0.0
    for _ in range(8):
        now_s = max(now_s, access.next_try_s)
        assert access.tried(access.due(now_s), False, now_s) is Fate.WAITS
    access.offer(7, packet(2), now_s)
    assert access.next_try_s < now_s + 10 * CYCLE_S
    assert access.due(access.next_try_s).payload == packet(2)


def test_if_both_may_go_to_the_same_node_the_packet_of_the_mesh_goes_first(access):
    access.offer(7, packet(1), 0.0, Priority.DATA)
    access.offer(7, packet(2), 1.0)
    assert access.due(1.0).payload == packet(2)


def test_users_data_waits_for_an_answer_to_a_challenge_which_opens_it():
    answer = bytes((3, 3, 127, 7, 7)).ljust(32, b"\0")
    access = MediumAccess(RULES, random.Random(1))
    access.offer(7, answer, 0.0)
    access.tried(access.due(0.0), False, 0.0)
    access.offer(7, packet(2), 0.0, Priority.DATA)
    access.offer(8, packet(3), 0.0, Priority.DATA)
    now_s = access.next_try_s
    assert access.due(now_s).payload == packet(3)  # another node needs no answer
    access.tried(access.due(now_s), True, now_s)
    now_s = access.next_try_s
    assert access.due(now_s).payload == answer
    access.tried(access.due(now_s), True, now_s)
    assert access.due(access.next_try_s).payload == packet(2)


def test_a_burst_is_paced(access):
    for receiver in range(100):
        access.offer(receiver, PACKET, 0.0)
    now_s = 0.0
    while len(access):
        now_s = max(now_s, access.next_try_s)
        access.tried(access.due(now_s), True, now_s + CYCLE_S)
        now_s += CYCLE_S
    assert now_s > 100 * (CYCLE_S + 0.8 * RULES.gap_s)


def test_a_broadcast_and_the_answers_to_one_are_spread():
    waits = []
    for seed in range(200):
        access = MediumAccess(RULES, random.Random(seed))
        access.offer(ALL_NODES, PACKET, 1.0)
        waits.append(access.next_try_s - 1.0)
    assert 0.0 <= min(waits) < 0.1 * RULES.broadcast_jitter_s
    assert 0.9 * RULES.broadcast_jitter_s < max(waits) <= RULES.broadcast_jitter_s
    access = MediumAccess(RULES, random.Random(1))
    access.heard(3, 1.0, broadcast=Priority.CONTROL)
    access.offer(3, PACKET, 1.0)
    assert access.next_try_s > 1.0


@pytest.mark.parametrize(
    ("silent_s", "tries"), [(1.0, RULES.tries), (60.0, RULES.tries_when_silent)]
)
def test_a_receiver_that_may_be_gone_gets_few_tries(access, silent_s, tries):
    access.heard(7, 0.0)
    access.offer(7, PACKET, silent_s)
    now_s, tried = silent_s, 0
    while len(access):
        now_s = max(now_s, access.next_try_s)
        access.tried(access.due(now_s), False, now_s)
        tried += 1
    assert tried == tries


@pytest.mark.parametrize("asked", Priority)
@pytest.mark.parametrize("sent", Priority)
def test_only_answers_wait_after_a_broadcast(access, asked, sent):
    access.heard(3, 1.0, broadcast=asked)
    access.offer(3, PACKET, 1.0, sent)
    assert (access.next_try_s > 1.0) == (asked is sent)


def test_a_broadcast_at_a_random_time_of_its_sender_does_not_wait(access):
    access.offer(ALL_NODES, PACKET, 1.0, jittered=False)
    assert access.next_try_s == 1.0


def test_where_tries_are_limited_a_packet_whose_sender_begins_anew_is_tried_once(access):
    access.limit_tries(4)
    access.offer(7, PACKET, 0.0, jittered=False, once=True)
    assert access.tried(access.due(0.0), False, 0.0) is Fate.GIVEN_UP
    assert access.offer(7, PACKET, 1.0)
    assert access.tried(access.due(1.0), False, 1.0) is Fate.WAITS


def test_where_tries_are_limited_such_a_packet_is_tried_at_a_random_moment():
    waits = []
    for seed in range(200):
        access = MediumAccess(RULES, random.Random(seed))
        access.limit_tries(4)
        access.offer(7, PACKET, 1.0, once=True)
        waits.append(access.next_try_s - 1.0)
    assert 0.0 <= min(waits) < 0.1 * RULES.once_jitter_s
    assert 0.9 * RULES.once_jitter_s < max(waits) <= RULES.once_jitter_s


def test_on_a_full_channel_too_it_is_tried_once_and_at_a_random_moment(access):
    access.contention = RULES.busy_at
    access.offer(7, PACKET, 0.0, once=True)
    assert 0.0 < access.next_try_s < RULES.once_jitter_s
    assert access.tried(access.due(RULES.once_jitter_s), False, 1.0) is Fate.GIVEN_UP


def test_elsewhere_it_is_tried_at_once_and_as_often_as_any(access):
    access.offer(7, PACKET, 1.0, once=True)
    assert access.tried(access.due(1.0), False, 1.0) is Fate.WAITS


def test_the_same_bytes_for_the_same_receiver_wait_only_once(access):
    assert access.offer(7, PACKET, 0.0)
    assert access.offer(7, PACKET, 0.0)
    assert len(access) == 1


def test_a_full_queue_refuses_packets(access):
    taken = [access.offer(7, packet(number), 0.0) for number in range(RULES.queue_length + 1)]
    assert taken == [True] * RULES.queue_length + [False]


def test_failing_tries_make_the_pauses_longer_and_the_mesh_patient(access):
    assert access.patience == 0.0
    for number in range(50):
        access.offer(7, packet(number), 0.0)
        due = access.due(1e9)
        access.tried(due, False, 0.0)
        access.tried(due, True, 0.0)
    assert access.contention > 0.8
    assert access.patience == RULES.most_patience


def test_what_was_cleared_is_not_tried_again(access):
    access.offer(7, PACKET, 0.0)
    due = access.due(0.0)
    access.clear()
    assert len(access) == 0
    assert access.tried(due, False, 0.1) in (Fate.WAITS, Fate.GIVEN_UP)
    assert len(access) == 0
    assert access.due(100.0) is None


def loaded(data, control=0):
    """A node with packets of users and of the mesh for node 5, and others of the mesh for 6."""
    node = MediumAccess(RULES, random.Random(1))
    for number in range(data):
        assert node.offer(5, packet(number), 0.0, Priority.DATA)
    for number in range(control):
        assert node.offer(6, packet(1000 + number), 0.0)
    return node


def train(node, now_s=1.0):
    """The packets that leave without a gap."""
    left = [node.due(now_s)]
    while left[-1] is not None:
        following = node.following(left[-1], now_s)
        node.tried(left[-1], True, now_s)
        left.append(following)
    return left[:-1]


def test_users_packets_leave_in_trains_of_bounded_length_in_their_order():
    node = loaded(RULES.train + 10)
    assert [sent.payload for sent in train(node)] == [packet(n) for n in range(RULES.train)]
    assert len(train(node, 2.0)) == 10


def test_a_packet_of_the_mesh_is_no_train():
    node = loaded(0, control=3)
    assert len(train(node)) == 1


def test_a_packet_of_the_mesh_ends_a_train():
    node = loaded(10)
    first = node.due(1.0)
    assert node.following(first, 1.0) is not None
    node.offer(6, packet(1000), 1.0)
    assert node.following(first, 1.0) is None


def test_on_a_busy_channel_users_packets_leave_one_by_one():
    node = loaded(10)
    node.contention = RULES.busy_at
    assert len(train(node)) == 1


def test_after_a_train_there_is_time_for_an_answer():
    node = loaded(3)
    train(node, 1.0)
    node.offer(5, packet(99), 1.0)
    assert node.next_try_s >= 1.0 + RULES.train_gap_s > 1.0 + RULES.train_pause_s


def test_a_node_that_hears_a_train_waits_for_its_end_but_not_for_ever():
    node = loaded(0, control=1)
    now_s = 1.0
    node.heard(5, now_s, train=InTrain.PERHAPS)
    while node.due(now_s) is None:
        assert now_s < 1.0 + 2 * RULES.most_yield_s, "it waits for ever"
        now_s += RULES.train_pause_s / 2
        node.heard(5, now_s, train=InTrain.PERHAPS)
    assert now_s >= 1.0 + RULES.most_yield_s - RULES.train_pause_s
    quiet = loaded(0, control=1)
    quiet.heard(5, 1.0, train=InTrain.PERHAPS)
    assert quiet.due(1.0) is None
    assert quiet.due(1.0 + RULES.train_pause_s) is not None


def test_a_relay_takes_no_pause_for_the_end_of_a_train_whose_end_is_announced():
    relay = loaded(1)
    relay.heard(5, 1.0, train=InTrain.MORE)
    assert relay.due(1.0 + 2 * RULES.train_pause_s) is None
    relay.heard(6, 1.01, train=InTrain.LAST)  # the end of another one
    assert relay.due(1.01) is None
    relay.heard(5, 1.02, train=InTrain.LAST)
    assert relay.due(1.02) is not None


def test_a_relay_does_not_wait_for_ever_for_an_end_that_got_lost():
    relay = loaded(1)
    relay.heard(5, 1.0, train=InTrain.MORE)
    assert relay.due(1.0 + RULES.train_hold_s) is not None
    now_s = 2.0
    while relay.due(now_s) is None or now_s == 2.0:
        assert now_s < 2.0 + 2 * RULES.most_hold_s, "it waits for ever"
        relay.heard(5, now_s, train=InTrain.MORE)
        now_s += RULES.train_pause_s


def test_what_waits_in_a_back_off_goes_when_its_receiver_has_been_heard():
    node = loaded(1)
    now_s = 1.0
    while node.next_try_s < now_s + 20 * CYCLE_S:
        now_s = max(now_s, node.next_try_s)
        assert node.tried(node.due(now_s), False, now_s) is Fate.WAITS
    now_s += 10 * CYCLE_S
    node.heard(5, now_s, train=InTrain.PERHAPS)
    assert node.next_try_s <= now_s + RULES.train_pause_s
