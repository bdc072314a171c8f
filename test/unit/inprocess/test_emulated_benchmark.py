"""The benchmark of the emulator runs the mesh that its options describe."""

from __future__ import annotations

import re

import pytest

from drone_mesh.inprocess import emulated_benchmark


@pytest.mark.parametrize("rate", ["250k", "1M", "2M"])
def test_with_power_that_falls_with_distance_the_range_is_the_same_at_every_rate(rate, capsys):
    """The nodes stand 6 m apart; the edge is at 9 m."""
    options = ["--nodes", "3", "--seconds", "3", "--links", "distance", "--rate", rate]
    assert emulated_benchmark.main(options) == 0
    connected = next(line for line in capsys.readouterr().out.splitlines() if "connected" in line)
    assert connected.endswith(" s"), connected


def test_it_sends_messages_and_switches_a_relay_off(capsys):
    """Router 2 hears the gateway through router 1 only, and takes its place."""
    options = ["--nodes", "3", "--spacing", "8.98", "--seconds", "3", "--messages", "2", "--death"]
    assert emulated_benchmark.main(options) == 0
    said = capsys.readouterr().out
    assert "messages that arrived         2 of 2; delay p50 " in said
    assert re.search(r"after the death of node 1 +the 1 behind it connected in [\d.]+ s", said)


def test_messages_and_a_death_need_emulated_time(capsys):
    with pytest.raises(SystemExit):
        emulated_benchmark.main(["--wall", "--death"])
    assert "need emulated time" in capsys.readouterr().err
