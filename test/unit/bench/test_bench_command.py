"""The command line of the benchmark."""

import json

import pytest

from drone_mesh.bench import command
from drone_mesh.communication.seals.key_file import write_key_file
from drone_mesh.communication.seals.keys import MeshKey


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as exit_:
        command.main(arguments)
    captured = capsys.readouterr()
    return exit_.value.code, captured.out, captured.err


def test_in_process_needs_no_ros_and_prints_the_same_as_table_and_json(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(command.inprocess, "SIZES", (9,))
    code, out, err = run(
        capsys, "--only", "inprocess", "--quick", "--json", str(tmp_path / "figures.json")
    )
    assert code == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    (result,) = figures["inprocess"]
    assert result["drones"] == 9
    assert result["all_connected"] is True
    assert f"{result['running_per_cpu_s']:.0f} ({result['running_per_wall_s']:.0f})" in out
    assert "in process" in err


def test_with_a_key_one_line_compares_packets_per_core_second_without_and_with_it(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.setattr(command.inprocess, "SIZES", (4,))
    write_key_file(tmp_path / "mesh.key", MeshKey(bytes(range(16))))
    figures = tmp_path / "figures.json"
    arguments = ("--only", "inprocess", "--quick", "--key-file", str(tmp_path / "mesh.key"))
    code, out, _err = run(capsys, *arguments, "--json", str(figures))
    assert code == 0
    cost = json.loads(figures.read_text())["seal"]
    (line,) = [line for line in out.splitlines() if line.startswith("4 nodes, 6 m, in process: ")]
    assert f"{cost['without_key']:.0f} packets per second of processor time without a key" in line
    assert f"{cost['with_key']:.0f} with one" in line


def test_without_ros_it_says_what_to_do(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    code, out, _err = run(capsys, "--quick")
    assert "source the setup.bash" in code
    assert "--only inprocess" in code
    assert out == ""


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--sizes", "17"], "such as 100/6"),
        (["--sizes", "300/6"], "at most 254"),
        (["--hours", "0"], "must be a number above 0"),
        (["--hours", "many"], "must be a number above 0"),
        (["--launch", "hosts=2"], "name:=value"),
        (["--only", "everything"], "invalid choice"),
    ],
)
def test_wrong_options_are_refused_with_the_reason(capsys, arguments, why):
    code, _out, err = run(capsys, *arguments)
    assert code == 2
    assert why in err


def test_a_missing_folder_for_the_figures_is_refused_before_anything_is_measured(capsys, tmp_path):
    code, _out, err = run(capsys, "--only", "inprocess", "--json", str(tmp_path / "no" / "x.json"))
    assert "no such directory" in code
    assert err == ""
