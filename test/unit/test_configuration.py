"""The factory's configuration: the shipped file, overrides, and what is refused in which words."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from drone_mesh.configuration import FactoryConfiguration, load_configuration
from drone_mesh.errors import ConfigurationError

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "config" / "factory.yaml"


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_the_shipped_file_holds_the_documented_numbers():
    assert load_configuration(SHIPPED, {"seed": 7}) == FactoryConfiguration(
        seed=7,
        gateways=1,
        routers=17,
        gridsize=6,
        spacing=1.0,
        gui=False,
        real_time_factor=1.0,
        max_distance=9.0,
        routing="child_table_tree",
        repair="thesis",
        clearance=1.0,
        lost_place="beside",
        check_period=10.0,
        connection_lost_after=0.0,
        report_period=0.0,
        debug=True,
    )


def test_the_shipped_file_and_the_launch_file_say_what_is_declared():
    check = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "settings"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stderr


def test_a_key_that_is_left_out_has_the_value_of_the_shipped_file(write):
    assert load_configuration(write(""), {"seed": 7}) == load_configuration(SHIPPED, {"seed": 7})
    assert load_configuration(write("routers: 3"), {"seed": 7}) == FactoryConfiguration(
        seed=7, routers=3
    )


def test_an_override_wins_over_the_file_and_an_empty_one_leaves_it(write):
    path = write("routers: 3\nspacing: 6\ngui: true\nseed: 1")
    overrides = {"routers": "16", "spacing": "", "gui": " ", "routing": "flooding"}
    assert load_configuration(path, overrides) == FactoryConfiguration(
        seed=1, routers=16, spacing=6.0, gui=True, routing="flooding"
    )


@pytest.mark.parametrize("routers", [5, "5", " 5", 5.0, "5.0"])
def test_a_number_may_be_written_as_in_yaml_ros_or_a_shell(write, routers):
    configuration = load_configuration(write(""), {"routers": routers})
    assert configuration.routers == 5
    assert type(configuration.routers) is int


@pytest.mark.parametrize(
    ("word", "value"),
    [
        (True, True),
        ("true", True),
        ("True", True),
        (1, True),
        (False, False),
        ("false", False),
        ("0", False),
    ],
)
def test_a_switch_may_be_written_as_in_yaml_ros_or_a_shell(write, word, value):
    assert load_configuration(write(""), {"gui": word}).gui is value


def test_as_fast_as_possible_is_a_factor_of_zero(write):
    assert load_configuration(write("real_time_factor: 0")).real_time_factor == 0.0


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("gateways: -1", "invalid gateways -1: expected a whole number of drones, 0..254"),
        ("routers: 255", "invalid routers 255: expected a whole number of drones, 0..254"),
        ("routers: 1.5", "invalid routers 1.5: expected a whole"),
        ("routers: true", "invalid routers True: expected a whole"),
        ("routers: [1]", r"invalid routers \[1\]: expected a whole"),
        ("routers:", r"invalid routers \(empty\): expected a whole"),
        ("spacing: 0", "invalid spacing 0: expected metres, above 0, at most 1000"),
        ("spacing: .nan", "invalid spacing nan: expected metres"),
        ("max_distance: .inf", "invalid max_distance inf: expected metres, above 0"),
        (
            "real_time_factor: -0.1",
            "invalid real_time_factor -0.1: expected a factor, 0.001..1000, or 0",
        ),
        ("report_period: 29", "invalid report_period 29: expected seconds, 30..3600, or 0"),
        ("connection_lost_after: soon", "invalid connection_lost_after 'soon': expected seconds"),
        ("debug: maybe", "invalid debug 'maybe': expected true or false"),
        ("routing: 3", "invalid routing 3: expected the name of a routing technique"),
        ("seed: -1", "invalid seed -1: expected a whole number, 0..4294967295, or random"),
        ("routters: 3", "unknown key routters; did you mean routers?"),
        ("colour: red", "unknown key colour; known are broker, "),
    ],
)
def test_a_bad_line_is_refused_with_file_line_key_value_and_what_is_allowed(write, line, why):
    path = write(f"# mine\n{line}\n")
    with pytest.raises(ConfigurationError, match=why) as refused:
        load_configuration(path)
    assert str(refused.value).startswith(f"{path}, line 2: ")
    assert "\n" not in str(refused.value)


def test_a_bad_override_is_refused_as_an_argument(write):
    with pytest.raises(
        ConfigurationError, match="^argument: invalid spacing '-1': expected metres"
    ):
        load_configuration(write(""), {"spacing": "-1"})
    with pytest.raises(
        ConfigurationError, match="^argument: unknown key space; did you mean spacing?"
    ):
        load_configuration(write(""), {"space": "1"})


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("routers: 1\nrouters: 2\n", "line 2: duplicate key routers"),
        ("routers: [1\n", "line 2: "),
        ("- routers\n", "expected 'key: value' lines, not a list"),
        ("routers: \x00\n", "mine.yaml: "),
        (f"seed: {'9' * 5000}\n", "line 1: a value is longer than 250 characters"),
        ("a: &a [1]\nb: [*a, *a]\n", r"line 2: aliases \(\*name\) are not allowed"),
        ("routers: 1\n" * 60_000, "mine.yaml: larger than 500000 bytes"),
    ],
)
def test_an_invalid_configuration_file_is_refused_in_one_line(write, text, why):
    with pytest.raises(ConfigurationError, match=why) as refused:
        load_configuration(write(text))
    assert "\n" not in str(refused.value)


def test_a_missing_or_binary_file_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigurationError, match="nowhere.yaml: No such file"):
        load_configuration(tmp_path / "nowhere.yaml")
    with pytest.raises(ConfigurationError, match="Is a directory"):
        load_configuration(tmp_path)
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ConfigurationError, match="picture.png: not a text file"):
        load_configuration(picture)


def test_a_pipe_or_a_device_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", Path("/dev/zero")):
        with pytest.raises(ConfigurationError, match="not a regular file"):
            load_configuration(path)


def test_a_long_value_is_not_repeated_whole(write):
    path = write(f"routers: [{', '.join(['1'] * 1000)}]")
    with pytest.raises(ConfigurationError, match="expected a whole number of drones") as refused:
        load_configuration(path)
    assert len(str(refused.value)) < 200 + len(str(path))


def test_the_seed_of_the_file_is_used_and_shown(write, caplog):
    caplog.set_level(logging.INFO)
    assert load_configuration(write("seed: 42")).seed == 42
    assert "to repeat this run, use seed:=42" in caplog.text


@pytest.mark.parametrize(
    ("text", "overrides"),
    [("", {}), ("seed: null", {}), ("seed: null", {"seed": ""}), ("seed: 42", {"seed": "random"})],
)
def test_without_a_seed_a_new_one_is_chosen_each_time_and_shown(write, caplog, text, overrides):
    caplog.set_level(logging.INFO)
    path = write(text)
    seeds = [load_configuration(path, overrides).seed for _ in range(5)]
    assert len(set(seeds)) == 5
    assert all(f"to repeat this run, use seed:={seed}" in caplog.text for seed in seeds)
