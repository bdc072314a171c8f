"""Random faults: the repair does no harm, and heals what can be healed."""

from __future__ import annotations

import pytest

from drone_mesh.lab.sequence import run_sequence
from drone_mesh.lab.sequences import harm, main

SEQUENCES, AT_ONCE = 300, 10
LARGEST = 14  # nodes: a second for ten sequences; the command runs meshes of up to 60


@pytest.mark.parametrize("first", range(0, SEQUENCES, AT_ONCE))
def test_no_sequence_ends_with_stacked_drones_or_a_needless_flight_or_a_node_given_up(first):
    outcomes = [run_sequence(seed, largest=LARGEST) for seed in range(first, first + AT_ONCE)]
    assert [outcome for outcome in outcomes if harm(outcome)] == []


def test_a_drone_that_knows_where_the_gateway_moved_flies_though_another_sought_it_elsewhere():
    moved = run_sequence(7027)
    assert (moved.incidents, moved.unexplained, moved.stacked) == ("gateway moved", 0, 0)


def test_the_same_seed_gives_the_same_outcome():
    one, other = (run_sequence(3, largest=LARGEST) for _ in range(2))
    assert one == other


def test_the_command_continues_where_it_was_stopped(tmp_path, capsys):
    table = tmp_path / "outcomes.csv"
    assert main(["--runs", "2", "--csv", str(table)]) == 0
    assert main(["--runs", "3", "--csv", str(table)]) == 0
    lines = table.read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[0] for line in lines] == ["seed", "0", "1", "2"]
    assert "3 sequences, seeds 0..2" in capsys.readouterr().out


def test_a_table_that_cannot_be_used_is_refused_before_the_first_sequence(tmp_path, capsys):
    assert main(["--runs", "1", "--csv", str(tmp_path / "none" / "table")]) == 2
    assert capsys.readouterr().err == (f"--csv {tmp_path}/none/table: No such file or directory\n")
    other = tmp_path / "other.csv"
    other.write_text("a,b\n1,2\n")
    assert main(["--runs", "1", "--csv", str(other)]) == 2
    assert capsys.readouterr().err == f"--csv {other}: not a table of this program\n"
