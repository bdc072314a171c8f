import data_cases
import pytest


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_no_message_is_lost_or_comes_twice_or_out_of_order_when_packets_and_a_relay_get_lost(first):
    problems = {seed: data_cases.run_case(seed) for seed in range(first, first + 20)}
    assert {seed: problem for seed, problem in problems.items() if problem} == {}


def test_nor_on_one_channel_that_all_nodes_share():
    problems = {seed: data_cases.run_case(seed, "shared") for seed in range(10)}
    assert {seed: problem for seed, problem in problems.items() if problem} == {}


def test_the_same_seed_gives_the_same_run():
    assert data_cases.fingerprint(7) == data_cases.fingerprint(7)
