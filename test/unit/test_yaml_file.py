"""YAML files of strangers: what expands or never ends, and numbers that people read otherwise."""

from __future__ import annotations

import pytest

from drone_mesh import yaml_file
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import read_mapping, read_mapping_text

LISTS = "a0: &a0 {x: 1}\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12)
)
MERGES = "a0: &a0 {x: 1}\n" + "".join(
    f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}\n" for n in range(1, 12)
)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (LISTS, "f: with aliases [(][*]name[)] more than 50000 values"),
        (MERGES, "f: with aliases [(][*]name[)] more than 50000 values"),
        ("a: &a [*a]", "f: maximum recursion depth"),
        ("a: &a {b: *a}", "f: maximum recursion depth"),
        ("a: " + "[" * 10_000, "f, line 1: nested deeper than 10 levels"),
        ("a: 1" + ":1" * 5_000, "f, line 1: a value is longer than 5000 characters"),
    ],
)
def test_what_a_few_lines_blow_up_is_refused_in_one(text, why):
    with pytest.raises(ConfigurationError, match=f"^{why}") as refused:
        read_mapping_text(text, "f", shares=True)
    assert "\n" not in str(refused.value)


def test_a_file_has_a_bounded_number_of_values(monkeypatch):
    monkeypatch.setattr(yaml_file, "MAX_VALUES", 50)
    assert read_mapping_text("a: [" + "1," * 47 + "]", "f").content == {"a": [1] * 47}
    with pytest.raises(ConfigurationError, match="f, line 1: more than 50 values"):
        read_mapping_text("a: [" + "1," * 48 + "]", "f")


def test_parts_that_are_shared_a_hundred_times_are_no_bomb():
    text = "a: &a {x: 1}\nb: [" + "*a, " * 100 + "{<<: *a, y: 2}]"
    content = read_mapping_text(text, "f", shares=True).content
    assert content["b"] == [{"x": 1}] * 100 + [{"x": 1, "y": 2}]


@pytest.mark.parametrize(
    "number", ["1_000", "010", "-007", "1:30", "0x10", "0b1", "1_0.5", "1:30.5", "9" * 19]
)
def test_numbers_that_yaml_reads_otherwise_than_people_are_refused(number):
    with pytest.raises(ConfigurationError, match="f, line 2: .* is not a number in decimal digits"):
        read_mapping_text(f"a: 1\nb: {number}", "f")


@pytest.mark.parametrize("number", ["1e6", "1e-3", "2.5e3", "-1E+6"])
def test_an_exponent_that_yaml_takes_for_a_text_is_refused_unless_quoted(number):
    with pytest.raises(ConfigurationError, match="f, line 2: .* is a text in YAML: write it as in"):
        read_mapping_text(f"a: 1\nb: {number}", "f")
    assert read_mapping_text(f"a: '{number}'", "f").content == {"a": number}


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("-12", -12), ("+3", 3), ("+1.5e+3", 1500)])
def test_numbers_in_decimal_digits_are_read(text, number):
    assert read_mapping_text(f"a: {text}", "f").content == {"a": number}


@pytest.mark.parametrize("value", ["!!bool perhaps", "!!timestamp x", "!!int ''", "!own {}"])
def test_tags_are_refused(value):
    with pytest.raises(ConfigurationError, match="f, line 1: tags are not allowed"):
        read_mapping_text(f"a: {value}", "f")


def test_of_a_file_without_an_end_only_the_beginning_is_read():
    with pytest.raises(ConfigurationError, match="/dev/zero: larger than 500000 bytes"):
        read_mapping("/dev/zero", shares=True)
