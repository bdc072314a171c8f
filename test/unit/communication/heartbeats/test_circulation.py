"""The memory of the guard against circulating packets."""

from __future__ import annotations

from proofs.fuzz import tables

from drone_mesh.communication.heartbeats.delivery import CirculationGuard, came_round


def test_a_passage_is_remembered_for_half_a_second_whenever_it_came():
    for first_s in (0.0, 0.1, 0.3, 0.49, 0.5, 0.7):
        guard = CirculationGuard()
        for tenth in range(30):  # other packets, so that it forgets
            now_s = tenth / 10
            guard.passed(tenth, came_from=2, went_to=3, now_s=now_s)
            if now_s <= first_s < now_s + 0.1:
                guard.passed(b"packet", came_from=2, went_to=3, now_s=first_s)
            if now_s >= first_s:
                first = guard.first_passage(b"packet", now_s)
                assert (first is not None) == (now_s < first_s + 0.5), (first_s, now_s)
                assert first is None or came_round(first, creator=1, came_from=4) == 3
                assert first is None or came_round(first, creator=1, came_from=2) is None


def test_it_keeps_the_packets_of_half_a_second_in_each_of_two_tables():
    guard = CirculationGuard()
    for number in range(5000):  # 1000 a second
        guard.passed(number, came_from=2, went_to=3, now_s=number / 1000)
    assert 400 < tables([guard]).largest <= 501
