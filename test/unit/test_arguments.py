"""Numbers on command lines."""

from __future__ import annotations

import argparse

import pytest

from drone_mesh.arguments import ArgumentParser, decimal, finite, whole


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("-3", -3), ("007", 7), ("12", 12)])
def test_whole_numbers_within_the_bounds_are_taken(text, number):
    assert whole(-3, 12)(text) == number


@pytest.mark.parametrize("text", ["", "1_0", "0x10", "1.0", " 1", "+1", "١", "13", "-4", "9" * 30])
def test_anything_else_is_refused_with_the_bounds(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be a whole number -3\.\.12"):
        whole(-3, 12)(text)


@pytest.mark.parametrize(("text", "number"), [("-0.5", -0.5), (".5", 0.5), ("1e1", 10.0)])
def test_decimal_numbers_within_the_bounds_are_taken(text, number):
    assert decimal(-1, 10)(text) == number


@pytest.mark.parametrize("text", ["", "nan", "inf", "1_0", "0x1", "1e2", "--1", "1,5"])
def test_any_other_text_is_refused_with_the_bounds(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be a number -1\.\.10"):
        decimal(-1, 10)(text)


@pytest.mark.parametrize(("text", "number"), [("+1.5", 1.5), (" -2e3 ", -2000.0), ("7.", 7.0)])
def test_numbers_in_files_are_decimal_as_other_programs_write_them(text, number):
    assert finite(text) == number


@pytest.mark.parametrize("text", ["", "+", "nan", "-inf", "1e999", "1_0", "٣", "0x1", "++1", "+-1"])
def test_what_only_python_takes_for_a_number_is_none(text):
    with pytest.raises(ValueError, match="is not a number"):
        finite(text)


@pytest.mark.parametrize("text", ["-3", "-.5", "-1e3", "-33.86,151.21,3"])
def test_what_begins_as_a_negative_number_is_a_value_and_no_option(text):
    parser = ArgumentParser()
    parser.add_argument("--origin")
    parser.add_argument("x")
    parsed = parser.parse_args(["--origin", text, text])
    assert (parsed.origin, parsed.x) == (text, text)
    with pytest.raises(SystemExit):
        parser.parse_args([text, "-x"])
