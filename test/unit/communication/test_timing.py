"""What is due how often, and limits on nodes that do not exist (docs/security.md, "Limits")."""

from __future__ import annotations

import random
import tracemalloc

import pytest
from rig import Rig

from drone_mesh.communication.timing import RateLimit, Strangers, Throttle


def heartbeat(creator, to=1):
    """A heartbeat of a router that knows no gateway: a gateway answers it."""
    return bytes((creator, creator, 4, to, to, 0, 255, 0)).ljust(32, b"\0")


def missing(creator, node, to=1):
    return bytes((creator, creator, 5, to, to, node)).ljust(32, b"\0")


def test_a_rate_is_limited_per_period_and_node():
    limit = RateLimit(2, 10.0)
    assert [limit.count(5, at_s) for at_s in (0.0, 1.0, 2.0, 9.9)] == [True, True, False, False]
    assert limit.count(6, 2.0)
    assert limit.reached(5, 9.9)
    assert not limit.reached(5, 10.0)
    assert limit.count(5, 10.0)


def test_a_node_that_acknowledged_a_packet_does_not_count_as_a_stranger():
    strangers = Strangers()
    strangers.known.add(5)
    for node in range(100, 200):
        strangers.gave_up(node, 1.0)
    assert strangers.ignores(6, 1.0)
    assert not strangers.ignores(5, 1.0)
    assert not strangers.ignores(6, 11.0)


def test_invented_nodes_get_a_limited_number_of_answers():
    rig = Rig(node_id=1, gateway=True)
    rig.know_neighbour(2)
    rig.antenna.dead.update(range(100, 250))
    for creator in range(100, 250):
        rig.mesh.on_msg(heartbeat(creator), rig.now_s)
        rig.wait(0.02)
    invented = {packet[3] for packet in rig.tried() if packet[3] >= 100}
    assert len(invented) == 16


def test_nodes_that_exist_are_answered_during_such_a_storm():
    rig = Rig(node_id=1, gateway=True)
    rig.mesh.on_msg(heartbeat(2), rig.now_s)
    rig.antenna.dead.update(range(100, 250))
    for creator in range(100, 250):
        rig.mesh.on_msg(heartbeat(creator), rig.now_s)
    rig.forget()
    rig.mesh.on_msg(heartbeat(2), rig.now_s)
    assert [packet[3] for packet in rig.sent(kind=4)] == [2]


def test_strangers_are_answered_again_when_the_storm_is_over():
    rig = Rig(node_id=1, gateway=True)
    rig.antenna.dead.update(range(100, 250))
    for creator in range(100, 250):
        rig.mesh.on_msg(heartbeat(creator), rig.now_s)
    rig.wait(10.0)
    rig.forget()
    rig.mesh.on_msg(heartbeat(3), rig.now_s)
    assert 3 in [packet[3] for packet in rig.sent(kind=4)]


def test_the_same_missing_node_is_announced_a_limited_number_of_times():
    rig = Rig(node_id=1)
    rig.know_neighbour(2, 3)
    for _ in range(100):
        rig.mesh.on_msg(bytes((9, 2, 2, 1, 1)).ljust(32, b"\0"), rig.now_s)  # 9 is behind 2
        rig.mesh.on_msg(missing(2, 9), rig.now_s)
    told = [packet for packet in rig.sent(kind=5) if packet[5] == 9]
    assert [packet[3] for packet in told] == [3] * 64


@pytest.mark.parametrize("gateway", [False, True])
def test_memory_is_bounded_by_the_number_of_ids(gateway):
    """Measured where every table has each id already, and old incomplete messages are dropped."""
    rng = random.Random(1)
    rig = Rig(node_id=1, gateway=gateway)

    def storm(packets):
        for _ in range(packets):
            creator, from_ = rng.randrange(254), rng.choice((0, *range(2, 254)))
            forward = rng.choice((1, 1, 254, rng.randrange(254)))
            head = bytes((creator, from_, rng.randrange(256), 1, forward))
            rig.mesh.on_msg(head + rng.getrandbits(27 * 8).to_bytes(27, "little"), rig.now_s)
            rig.antenna.calls.clear()
            rig.events.clear()
            rig.forget()
            rig.wait(0.01)

    tracemalloc.start()
    try:
        for creator in set(range(254)) - {1}:
            for forward in (1, 254):  # a fragment, of which each sender has its own memory
                rig.mesh.on_msg(bytes((creator, 0, 129, 1, forward)).ljust(32, b"\0"), rig.now_s)
        storm(12_000)
        before, _ = tracemalloc.get_traced_memory()
        storm(1500)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 100_000


def test_each_reason_is_due_once_a_period_and_always_counted():
    throttle = Throttle(period_s=10.0)
    assert [throttle.count("bad", now_s) for now_s in (0.0, 9.9, 10.0, 10.1)] == [
        True,
        False,
        True,
        False,
    ]
    assert throttle.count("worse", 10.1)
    assert throttle.counts == {"bad": 4, "worse": 1}


def test_a_clock_that_jumped_back_silences_nothing():
    throttle = Throttle(period_s=10.0)
    throttle.count("bad", 500.0)
    assert throttle.count("bad", 1.0)
